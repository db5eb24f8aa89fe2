"""Power stations: the code of a table, its means over the measured ticks, and refused tables."""

import math
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.kinds.wavebot.tick import stations
from rig.kinds.wavebot.tick.stations import SIGNALS, STATIONS
from rig.realtime.power import compile_stations
from rig.realtime.sequence import Phase
from rig.stations import Station, as_records, find, from_records


def step(previous: Any, phase: Phase, value: float = 0.0, **signals: float) -> Any:
    """Return the power of a tick; signals that are not given have one ``value``."""
    return stations.step(previous, **(dict.fromkeys(SIGNALS, value) | signals), phase=phase)


def test_power_is_force_on_the_body_times_velocity_and_absorbed_is_negative() -> None:
    signals = {"lcb": -800.0, "trs": -750.0, "velocity": 0.2, "ac": -40.0, "dc": -10.0}
    now = step(stations.start(), Phase.SETTLE, **signals)
    assert now[:4] == (-160.0, -150.0, -40.0, -10.0)
    assert now[4:] == (0.0, 0.0, 0.0, 0)


@given(st.lists(st.tuples(*[st.floats(-1e3, 1e3)] * 4), min_size=1, max_size=50))
def test_means_are_those_of_the_measured_ticks(
    samples: list[tuple[float, float, float, float]],
) -> None:
    state = stations.start()
    for _ in range(3):
        state = step(state, Phase.SETTLE, 9e9, velocity=1.0)
    for force, velocity, ac, dc in samples:
        state = step(state, Phase.MEASURE, lcb=force, velocity=velocity, ac=ac, dc=dc)
    n = len(samples)
    assert state.samples == n
    for mean, column in (
        (state.mean_mechanical_1, [f * v for f, v, _, _ in samples]),
        (state.mean_ac, [ac for _, _, ac, _ in samples]),
        (state.mean_dc, [dc for _, _, _, dc in samples]),
    ):
        size = max(abs(x) for x in column) + 1.0
        assert mean == pytest.approx(math.fsum(column) / n, abs=1e-9 * size)
    tail = step(state, Phase.TAIL, 9e9)
    assert tail[4:] == state[4:]
    assert step(tail, Phase.SETTLE, 1.0)[4:] == (0.0, 0.0, 0.0, 0)


def test_a_run_starts_with_no_power_and_empty_means() -> None:
    assert stations.start() == (0.0,) * 7 + (0,)


def test_the_fields_follow_from_the_table() -> None:
    assert stations.Power._fields == (
        "mechanical_1", "mechanical_2", "ac", "dc", "mean_mechanical_1", "mean_ac", "mean_dc",
        "samples",
    )  # fmt: skip
    assert stations.Power.__module__ == stations.step.__module__ == stations.__name__


def table(*stations_: tuple[str, str]) -> tuple[Station, ...]:
    return tuple(Station(name, formula, name, name, name) for name, formula in stations_)


def test_a_table_without_means_and_of_other_formulas_is_compiled() -> None:
    code = compile_stations(table(("p", "2.0 * (a - b) * a"), ("b", "-b")), ("a", "b"), __name__)
    assert code.step(code.start(), a=3.0, b=1.0, phase=Phase.MEASURE) == (12.0, -1.0, 1)


@pytest.mark.parametrize(
    ("stations_", "reason"),
    [
        ([("p", "a * v")], "station 'p': formula 'a * v': no signal 'v'; signals are a, b"),
        ([("p", "a"), ("p", "b")], "station 'p': a second field of this name"),
        ([("samples", "a")], "station 'samples': a second field of this name"),
        ([("P", "a")], r"station 'P': not a ROS field name"),
        ([("a__b", "a")], "station 'a__b': not a ROS field name"),
        ([("is", "a")], "station 'is': not a ROS field name"),
        ([("p", "a *")], "station 'p': formula 'a \\*': invalid syntax"),
        ([("p", "a / b")], "write \\+, - and \\* of signals"),
        ([("p", "a ** 2.0")], "write \\+, - and \\* of signals"),
        ([("p", "a.real")], "write \\+, - and \\* of signals"),
        ([("p", "a * 2")], "numbers such as 2.0"),
        ([("p", "1.0")], "write \\+, - and \\* of signals"),
        ([("p", "abs(a)")], "no signal 'abs'"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_refused_by_station_and_reason(
    stations_: list[tuple[str, str]], reason: str
) -> None:
    reason = reason if "\\" in reason else reason.replace("*", r"\*")
    with pytest.raises(ValueError, match=reason):
        compile_stations(table(*stations_), ("a", "b"), __name__)


def test_a_mean_must_not_have_the_name_of_a_station() -> None:
    twice = (*table(("mean_p", "a")), Station("p", "a", "p", "p", "p", running_mean=True))
    with pytest.raises(ValueError, match="station 'mean_p': a second field"):
        compile_stations(twice, ("a",), __name__)


def test_a_recorded_table_is_read_back_and_may_hold_other_fields() -> None:
    records = as_records(STATIONS)
    assert from_records(records) == STATIONS
    assert from_records([{**each, "later": 1} for each in records]) == STATIONS


@pytest.mark.parametrize(
    "name",
    ["mechanical_1", "mechanical", "mech 1", "Mech 1", "mechanical (column load cell)",
     "power_mechanical_1"],
)  # fmt: skip
def test_a_station_is_found_by_id_and_labels(name: str) -> None:
    assert find(STATIONS, name) == STATIONS[0]


def test_an_unknown_station_is_refused_with_labels_and_ids() -> None:
    assert find(STATIONS, "shaft") == find(STATIONS, "mechanical_2") == STATIONS[1]
    allowed = ", ".join(f"{station.label} [{station.name}]" for station in STATIONS)
    with pytest.raises(ValueError, match=re.escape(f"unknown station 'sun'; allowed {allowed}")):
        find(STATIONS, "sun")
    twins = [each._replace(label="tether") for each in STATIONS[2:]]
    with pytest.raises(ValueError, match="ambiguous station 'tether'"):
        find(twins, "tether")


def test_an_id_counts_before_a_label() -> None:
    other = STATIONS[3]._replace(label="ac")
    assert find([other, STATIONS[2]], "ac") == STATIONS[2]
