"""NaN or infinity in any sensed value of a WaveBot removes power."""

from __future__ import annotations

import itertools
import math
from typing import Any, get_type_hints

import pytest
from core_runs import RunResult, plan, run
from core_wavebot import READY, ModifiedDevices, Quiet, params

from rig.kinds.wavebot.tick import KIND, Sense, WaveBotRow
from rig.kinds.wavebot.tick.reasons import WaveBotReason
from rig.realtime import safety
from rig.realtime.reasons import Reason
from rig.realtime.safety import ENABLING, OFF, RUN, STOP_0, STOP_1, STOP_2
from rig.realtime.sequence import Phase
from rig.recording.row_layout import leaves

pytestmark = pytest.mark.usefixtures("execution")

FLOATS = [leaf.path for leaf in leaves(Sense) if leaf.code == "d"]
GUARDED = [path for path in FLOATS if path != ("wave", "elevation")]
BAD = [math.nan, math.inf, -math.inf]
PLAN = plan(
    (-1, Phase.TARE, 10, 0, 0),
    (-1, Phase.MOVING, 10, READY, 0),
    (0, Phase.SETTLE, 20, 0, 0),
    (0, Phase.MEASURE, 60, 0, 0),
)
PARAMS = params(PLAN)._replace(safety=safety.Params(enable_ticks=50, stop_ticks=40))


def devices_with(path: tuple[str, ...], value: float, at: int) -> ModifiedDevices:
    """Return constant devices with one value replaced in one single tick."""

    def corrupt(tick: int, sense: Sense) -> Sense:
        if tick != at:
            return sense
        part = getattr(sense, path[0])
        return sense._replace(**{path[0]: part._replace(**{path[1]: value})})

    return ModifiedDevices(Quiet(), corrupt)


def check_stopped(result: RunResult, devices: ModifiedDevices, at: int) -> None:
    """Check that power is removed in this tick, and stays off."""
    assert result.error is None
    for row, command in zip(result.rows, devices.commands, strict=True):
        if row.tick >= at:
            assert row.safety.mode == STOP_0
            assert command.heave[:3] == (0.0, 0.0, 0)
            assert command.surge[:3] == (0.0, 0.0, 0)
            assert command.wave_trigger == 0
            assert command.spring.enable == 0
    assert result.rows[-1].tick == at + 19  # 20 more ticks are logged, then the run ends


def test_the_list_of_fields_is_that_of_the_type() -> None:
    assert len(FLOATS) == 26
    hints = get_type_hints(Sense)
    assert {path[0] for path in FLOATS} == set(hints) - {"drive"}  # flags only


@pytest.mark.parametrize("path", GUARDED, ids=".".join)
@pytest.mark.parametrize("bad", BAD)
def test_a_value_that_is_not_finite_removes_power_in_the_same_tick(
    path: tuple[str, ...], bad: float
) -> None:
    devices = devices_with(path, bad, at=55)
    result = run(KIND, PARAMS, devices)
    assert result.rows[54].safety.mode == RUN
    assert result.rows[55].safety.reason == Reason.NOT_FINITE
    assert result.end is not None
    assert result.end.reason == Reason.NOT_FINITE
    check_stopped(result, devices, 55)


@pytest.mark.parametrize("path", GUARDED, ids=".".join)
@pytest.mark.parametrize(
    ("at", "mode", "request_"),
    [
        (0, None, 0),
        (5, OFF, 0),
        (11, ENABLING, 0),
        (48, STOP_2, safety.REQUEST_HOLD),
        (48, STOP_1, safety.REQUEST_STOP),
    ],
)
def test_in_every_mode(path: tuple[str, ...], at: int, mode: int | None, request_: int) -> None:
    """In the first tick too, and during a stop."""
    devices = devices_with(path, math.nan, at)
    result = run(KIND, PARAMS, devices, requests={40: request_})
    if mode is not None:
        assert result.rows[at - 1].safety.mode == mode
    check_stopped(result, devices, at)


def test_two_infinities_of_opposite_sign_do_not_cancel() -> None:
    def corrupt(tick: int, sense: Sense) -> Sense:
        if tick != 55:
            return sense
        return sense._replace(load=sense.load._replace(lcb=math.inf, trs=-math.inf))

    devices = ModifiedDevices(Quiet(), corrupt)
    result = run(KIND, PARAMS, devices)
    check_stopped(result, devices, 55)


def test_an_unknown_elevation_does_not_trip() -> None:
    def unknown(tick: int, sense: Sense) -> Sense:
        return sense._replace(wave=sense.wave._replace(elevation=math.nan))

    result = run(KIND, PARAMS, ModifiedDevices(Quiet(), unknown))
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    assert isinstance(result.rows[0], WaveBotRow)
    assert all(math.isnan(row.wave.elevation) for row in result.rows)


AGES: list[tuple[tuple[str, str], float, Reason, int]] = [
    (("heave", "encoder_age"), 0.02, Reason.STALE_ENCODER, STOP_0),
    (("heave", "drive_age"), 0.1, Reason.STALE_DRIVE, STOP_0),
    (("load", "age"), 0.1, WaveBotReason.STALE_LOAD_CELL, STOP_1),
    (("power", "age"), 1.0, WaveBotReason.STALE_ANALYSER, STOP_1),
    (("spring", "age"), 1.0, WaveBotReason.STALE_STATOR, STOP_1),
]


@pytest.mark.parametrize(("path", "bound", "reason", "mode"), AGES)
def test_an_age_beyond_its_bound_stops_and_one_on_it_does_not(
    path: tuple[str, str], bound: float, reason: Reason, mode: int
) -> None:
    result = run(KIND, PARAMS, devices_with(path, bound, 55))
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    result = run(KIND, PARAMS, devices_with(path, math.nextafter(bound, 9.0), 55))
    assert result.rows[54].safety.mode == RUN
    assert result.rows[55].safety == (mode, 55, reason)
    assert result.end is not None
    assert result.end.reason == reason


def change(sense: Sense, **parts: dict[str, Any]) -> Sense:
    return sense._replace(
        **{name: getattr(sense, name)._replace(**values) for name, values in parts.items()}
    )


# Each fault of the WaveBot with the values that cause it, worst first.
FAULTS: list[tuple[Reason, dict[str, dict[str, Any]]]] = [
    (Reason.STALE_ENCODER, {"heave": {"encoder_age": 0.5}}),
    (Reason.STALE_DRIVE, {"heave": {"drive_age": 0.5}}),
    (Reason.DRIVE_FAULT, {"heave": {"fault": 1}}),
    (Reason.DRIVE_DROPPED, {"heave": {"enabled": 0}}),
    (Reason.ENCODER_JUMP, {"heave": {"counts": 183264 + 3000}}),
    (Reason.NOT_FINITE, {"load": {"lcb": math.nan}}),
    (WaveBotReason.POSITION_DISAGREES, {"load": {"string_pot": 0.2}}),
    (WaveBotReason.STALE_LOAD_CELL, {"load": {"age": 0.5}}),
    (WaveBotReason.STALE_ANALYSER, {"power": {"age": 2.0}}),
    (WaveBotReason.STALE_STATOR, {"spring": {"age": 2.0}}),
    (WaveBotReason.ROTOR_TRAVEL, {"load": {"rotor_angle": -2.1}}),
]
PAIRS = list(itertools.combinations_with_replacement(range(len(FAULTS)), 2))


@pytest.mark.parametrize(("i", "j"), PAIRS)
def test_of_two_simultaneous_faults_the_worse_counts(i: int, j: int) -> None:
    """A fault that allows no controlled stop is never hidden by one that does."""

    def corrupt(tick: int, sense: Sense) -> Sense:
        if tick != 55:
            return sense
        return change(change(sense, **FAULTS[j][1]), **FAULTS[i][1])

    result = run(KIND, PARAMS, ModifiedDevices(Quiet(), corrupt))
    reason = FAULTS[i][0]
    reasons = {FAULTS[i][0], FAULTS[j][0]}
    if reasons == {WaveBotReason.POSITION_DISAGREES, WaveBotReason.STALE_LOAD_CELL}:
        reason = WaveBotReason.STALE_LOAD_CELL  # a silent string pot cannot disagree
    assert result.rows[54].safety.mode == RUN
    assert result.rows[55].safety.reason == reason
    expected = STOP_0 if KIND.reason_table.categories[reason] == 0 else STOP_1
    assert result.rows[55].safety.mode == expected
