"""The plan of a campaign: windows, segments, order of the rows."""

import itertools
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from controllers import impedance
from rig.campaign import build_plan
from rig.campaign.record import RecordedCampaign
from rig.config.pydantic_errors import load
from rig.config.sea import CalmSea, JonswapSea, RecordedSea, RegularSea
from rig.config.task_file import Timing
from rig.config.yaml_source import SourceLocation
from rig.kinds.wavebot.campaign import CAMPAIGNS, Plan, check_campaign, open_campaign
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.planning.order import least_travel, order_points
from rig.planning.point import Point, ValueLocation, make_point
from rig.planning.windows import WindowError, row_windows
from rig.realtime.sequence import NO_ROW, WAIT_ARRIVAL, WAIT_DRIVE, Phase

CONFIGS = Path(__file__).parents[2] / "configs"
RIG, _ = load(CONFIGS / "rigs" / "wavebot.yaml", RigFile)
UNKNOWN_LOCATION = ValueLocation(SourceLocation(Path("x.yaml"), 1), "x")


def point_without_location(rate: float, kp: float, ki: float) -> Point:
    return make_point(
        COLUMNS.required(impedance.COLUMNS), [(value, UNKNOWN_LOCATION) for value in (rate, kp, ki)]
    )


RATES = (490.9, -5715.0, 8340.0, -10013.0, 0.0)


def regular(**change: Any) -> RegularSea:
    return RegularSea.model_validate({"kind": "regular", "amplitude_m": 0.1, **change})


JONSWAP = JonswapSea.model_validate({"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.5})
RECORDED = RecordedSea.model_validate(
    {"kind": "recorded", "file": "x.csv", "channel": "a", "unit": "m", "start_s": 5, "end_s": 65}
)


@pytest.mark.parametrize(
    ("sea", "timing", "expected"),
    [
        # settle, measure, tail, move, periods
        (regular(frequency_hz=0.3), {}, (5, 4 / 0.3, 15 - 4 / 0.3, 20, 4)),
        (regular(frequency_hz=0.5), {}, (5, 14, 1, 20, 7)),
        (regular(frequency_hz=0.2), {}, (5, 15, 0, 20, 3)),  # 3 x 5.000000000000001 s must fit
        (regular(period_s=2.5), {}, (5, 15, 0, 20, 6)),
        (regular(period_s=15), {}, (5, 15, 0, 20, 1)),
        (regular(frequency_hz=0.4), {"periods": 5}, (5, 12.5, 2.5, 20, 5)),
        (regular(frequency_hz=0.5), {"scheme": "mask4"}, (5, 14, 1, 20, 7)),
        (regular(frequency_hz=0.5), {"settle_s": 0, "interval_s": 5}, (0, 4, 1, 5, 2)),
        (JONSWAP, {}, (10, 300, 0, 10, 1)),
        (JONSWAP, {"scheme": "mask4"}, (2, 298, 0, 300, 0)),
        (JONSWAP, {"scheme": "mask4", "interval_s": 302}, (2, 300, 0, 302, 1)),
        (JONSWAP, {"periods": 2}, (10, 600, 0, 10, 2)),
        (JONSWAP, {"settle_s": 20}, (20, 300, 0, 20, 1)),
        (JONSWAP, {"interval_s": 700}, (10, 600, 90, 10, 2)),
        (RECORDED, {}, (10, 60, 0, 10, 1)),
        (CalmSea(kind="calm"), {}, (5, 15, 0, 20, 0)),
        (CalmSea(kind="calm"), {"interval_s": 30, "settle_s": 1}, (1, 29, 0, 30, 0)),
    ],
)
def test_windows(sea: Any, timing: dict[str, Any], expected: tuple[float, ...]) -> None:
    row_window = row_windows(sea, Timing.model_validate(timing))
    assert row_window[: len(expected)] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("sea", "timing", "key", "expected"),
    [
        (regular(period_s=16), {}, "timing", "one wave period of 16 s after 5 s of settling does "
         "not fit into an interval of 20 s; allowed interval_s at least 21 s"),
        (regular(frequency_hz=0.3), {"interval_s": 6}, "timing.interval_s", "at least 8.334 s"),
        (regular(frequency_hz=0.5), {"periods": 8}, "timing", "8 wave periods of 2 s"),
        (JONSWAP, {"interval_s": 300}, "timing.interval_s", "one repeat period of 300 s"),
        (JONSWAP, {"scheme": "mask4", "settle_s": 300}, "timing.settle_s", "leaves nothing"),
        (CalmSea(kind="calm"), {"settle_s": 30}, "timing.settle_s", "leaves nothing to measure"),
        (CalmSea(kind="calm"), {"interval_s": 4}, "timing.interval_s", "leaves nothing"),
        (CalmSea(kind="calm"), {"periods": 4}, "timing.periods", "but a calm sea has none"),
    ],
)  # fmt: skip
def test_windows_that_cannot_be_cut(
    sea: Any, timing: dict[str, Any], key: str, expected: str
) -> None:
    with pytest.raises(WindowError) as error_info:
        row_windows(sea, Timing.model_validate(timing))
    assert ".".join(str(k) for k in error_info.value.key) == key
    assert expected in error_info.value.message


def lengths(planned: Plan, row: int) -> list[tuple[Phase, int]]:
    s = planned.segments
    return [(Phase(p), t) for r, p, t in zip(s.row, s.phase, s.ticks, strict=True) if r == row]


def test_the_default_campaign() -> None:
    planned = check_campaign(CONFIGS / "campaigns" / "default.yaml").plan
    assert planned is not None
    assert len(planned.rows) == 66
    assert planned.wave_seconds == 1460.0
    assert planned.moves == 1
    assert planned.dt == 0.001
    assert lengths(planned, 0) == [(Phase.SETTLE, 5000), (Phase.MEASURE, 14000), (Phase.TAIL, 1000)]
    assert lengths(planned, 36)[0] == (Phase.MOVING, 20_000)
    for row, stator, expected in (
        (0, -13.0, (490.9, -1000.0, 0.0)),
        (1, -13.0, (490.9, -1000.0, 2000.0)),
        (36, 27.0, (-5715.0, -1000.0, -4000.0)),
        (65, 27.0, (-5715.0, -3500.0, 4000.0)),
    ):
        assert planned.rows[row].place == stator
        assert planned.rows[row].setting[:3] == expected
        assert planned.rows[row].setting[3:] == (
            0.0,
            1.0,
            0.0,
            -2500.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        )


def test_windows_at_0p3_hz_end_on_the_nearest_sample(write: Any) -> None:
    head = (
        "name: test\nrig: ../rigs/wavebot.yaml\n"
        "sea: {kind: regular, amplitude_m: 0.1, frequency_hz: 0.3}\n"
    )
    campaign = open_campaign(write("repeat: 3\n", head=head))
    planned = build_plan(campaign)
    for row in planned.rows:
        assert row.periods == 4
        assert row.measure == pytest.approx(40 / 3)
        assert lengths(planned, row.row) == [
            (Phase.SETTLE, 5000),
            (Phase.MEASURE, 13_333),
            (Phase.TAIL, 1667),
        ]


def test_the_segments_before_the_first_row(write: Any) -> None:
    body = """\
start: {set_point_s: 7, lead_in_s: 30, set_point: {kp_n_s_per_m: -2500, ki_n_per_m: 100}}
matrix:
  list:
    - {spring_n_per_m: -5715, kp_n_s_per_m: -1000, ki_n_per_m: 2000}
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -1000, ki_n_per_m: 2000}
"""
    campaign = open_campaign(write(body))
    planned = build_plan(campaign)
    s, p = planned.segments, planned.setpoints
    gains = [(p.law[0][i], p.law[1][i], p.spring_rate[i]) for i in s.setpoint]
    table = list(zip(s.row, s.phase, s.ticks, s.wait, s.timeout, s.restart, s.drive, s.waves,
                     gains, strict=True))  # fmt: skip
    set_point, first, second = (-2500, 100, -5715), (-1000, 2000, -5715), (-1000, 2000, 490.9)
    both = WAIT_ARRIVAL | WAIT_DRIVE
    assert table == [
        (NO_ROW, Phase.TARE, 5000, 0, 0, 0, 0, 0, set_point),
        (NO_ROW, Phase.MOVING, 500, both, 60_000, 1, 1, 0, set_point),
        (NO_ROW, Phase.LEAD_IN, 7000, 0, 0, 2, 1, 1, set_point),
        (NO_ROW, Phase.LEAD_IN, 23_000, 0, 0, 2, 1, 1, first),
        (0, Phase.SETTLE, 5000, 0, 0, 4, 1, 1, first),
        (0, Phase.MEASURE, 14_000, 0, 0, 4, 1, 1, first),
        (0, Phase.TAIL, 1000, 0, 0, 4, 1, 1, first),
        (1, Phase.MOVING, 20_000, WAIT_ARRIVAL, 60_000, 7, 1, 1, second),
        (1, Phase.SETTLE, 5000, 0, 0, 7, 1, 1, second),
        (1, Phase.MEASURE, 14_000, 0, 0, 7, 1, 1, second),
        (1, Phase.TAIL, 1000, 0, 0, 7, 1, 1, second),
        (NO_ROW, Phase.DONE, 0, 0, 0, 11, 0, 0, (-1000, 0, 490.9)),
    ]


def test_the_default_set_point_is_the_first_rows_damping_alone(write: Any) -> None:
    body = "matrix: {list: [{spring_n_per_m: 0, kp_n_s_per_m: -1500, ki_n_per_m: 3000}]}\n"
    campaign = open_campaign(write("tare: none\nstart: {set_point_s: 0, lead_in_s: 0}\n" + body))
    planned = build_plan(campaign)
    assert (planned.setpoints.law[0][0], planned.setpoints.law[1][0]) == (-1500.0, 0.0)
    phases = [Phase(p) for p in planned.segments.phase]
    assert phases[:2] == [
        Phase.MOVING,
        Phase.SETTLE,
    ]  # no tare and no lead-in: empty segments are left out


def test_ki_is_limited_to_a_stable_value_while_the_stator_moves(write: Any) -> None:
    """Ki 20 kN/m is stable at 490.9 N/m, but unstable at the previous spring rate."""
    body = """\
start: {set_point: {kp_n_s_per_m: -2000, ki_n_per_m: 9191}}
matrix:
  list:
    - {spring_n_per_m: -10013, kp_n_s_per_m: -2000, ki_n_per_m: 9000}
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 20000}
    - {spring_n_per_m: -8508, kp_n_s_per_m: -2000, ki_n_per_m: 11000}
"""
    campaign = open_campaign(write(body))
    planned = build_plan(campaign)
    s = planned.segments
    moving = [i for i, phase in enumerate(s.phase) if phase == Phase.MOVING]
    first, second, third = (planned.setpoints.law[1][s.setpoint[i]] for i in moving)
    assert first == 9191.0
    assert second == pytest.approx(24337 - 1.213 * 10013 - 3000)
    assert third == 11_000.0
    assert planned.setpoints.law[1][s.setpoint[moving[1] + 1]] == 20_000.0


POINTS = st.lists(
    st.tuples(
        st.sampled_from(RATES),
        st.floats(-3500, 0).map(round).map(float),
        st.sampled_from([0.0, 2000.0]),
    ),
    min_size=1,
    max_size=12,
).map(lambda sequence: tuple(point_without_location(*point) for point in sequence))


@given(POINTS, st.sampled_from(["as given", "least travel", "random"]), st.integers(1, 3))
def test_every_point_is_run_once_per_repetition(
    points: tuple[Point, ...], order: Any, repeat: int
) -> None:
    places = [-point.spring_rate for point in points]
    sequence = order_points(places, order, repeat, 7)
    everyone = itertools.product(range(len(points)), range(repeat))
    assert sorted(sequence) == sorted(everyone)
    assert sequence == order_points(places, order, repeat, 7)
    rates = [points[turn.point].spring_rate for turn in sequence]
    moves = sum(a != b for a, b in itertools.pairwise(rates))
    if order == "as given":
        given_rates = [point.spring_rate for point in points]
        assert moves == sum(a != b for a, b in itertools.pairwise(given_rates))
    if order == "least travel":
        assert moves == len(set(rates)) - 1
        for rate in set(rates):  # within a spring rate, the order is that of the file
            block = [t for t in sequence if points[t.point].spring_rate == rate]
            assert block == sorted(block, key=lambda t: (t.repetition, t.point))


@given(st.lists(st.sampled_from(RATES), min_size=1, max_size=8))
def test_the_order_of_spring_rates_has_the_least_stator_travel(rates: list[float]) -> None:
    def travel(order: tuple[float, ...]) -> float:
        return sum(abs(a - b) for a, b in itertools.pairwise(order))

    sequence = least_travel(rates)
    assert travel(sequence) == min(travel(p) for p in itertools.permutations(set(rates)))
    back = tuple(reversed(sequence))
    assert rates.index(sequence[0]) <= rates.index(back[0])  # first named end first


def test_another_seed_gives_another_random_order() -> None:
    places = [float(i) for i in range(20)]
    assert order_points(places, "random", 1, 1) != order_points(places, "random", 1, 2)


SEAS = st.one_of(
    st.floats(0.07, 2).map(lambda f: {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": f}),
    st.floats(10, 40).map(lambda r: {"kind": "jonswap", "hs_m": 0.1, "tp_s": 2, "repeat_s": r}),
    st.just({"kind": "calm"}),
)


@settings(max_examples=examples(200))
@given(SEAS, POINTS, st.sampled_from(["as given", "random"]), st.integers(1, 2),
       st.integers(100, 2000), st.floats(0, 20), st.floats(0, 20))  # fmt: skip
def test_any_plan_is_consistent(
    sea: dict[str, Any], points: tuple[Point, ...], order: str, repeat: int, rate: int,
    set_point: float, rest: float,
) -> None:  # fmt: skip
    campaign = CampaignFile.model_validate(
        {
            "name": "x", "rig": "x", "sea": sea, "order": order, "repeat": repeat,
            "matrix": {"csv": "x"},
            "start": {"set_point_s": set_point, "lead_in_s": set_point + rest},
        }
    )  # fmt: skip
    rig = RIG.model_copy(update={"rate_hz": rate})
    planned = build_plan(RecordedCampaign(CAMPAIGNS, campaign, rig, None, points, None, 1))
    s = planned.segments
    n = len(s.phase)
    row_window = row_windows(campaign.sea, campaign.timing)
    assert all(len(column) == n for column in s)
    assert s.phase[-1] == Phase.DONE
    assert s.phase.count(Phase.DONE) == 1
    assert all(ticks > 0 for ticks in s.ticks[:-1])
    # durations in seconds agree with the ticks
    assert sum(s.ticks) * planned.dt == pytest.approx(planned.duration)
    assert sum(planned.phases) == pytest.approx(planned.duration)
    waves = (
        set_point + rest + len(planned.rows) * row_window.interval + planned.moves * row_window.move
    )
    assert planned.wave_seconds == pytest.approx(waves, abs=1.01 * planned.dt)
    # rows are contiguous, in order, and each measured exactly once, to the nearest sample
    assert [r for r, _ in itertools.groupby(s.row)] == [NO_ROW, *range(len(planned.rows)), NO_ROW]
    for row in planned.rows:
        phases = lengths(planned, row.row)
        assert [p for p, _ in phases] == sorted({p for p, _ in phases})
        ((_, measured),) = [p for p in phases if p[0] is Phase.MEASURE]
        assert measured * planned.dt == pytest.approx(row_window.measure, abs=1.01 * planned.dt)
    for i in range(n):
        restart = s.restart[i]
        assert restart <= i
        assert s.row[restart] == s.row[i]
        assert restart == 0 or s.row[restart - 1] != s.row[i] or s.row[i] == NO_ROW
        if s.row[i] != NO_ROW:
            given = planned.rows[s.row[i]].setting
            j = s.setpoint[i]
            p = planned.setpoints
            assert (p.law[0][j], p.spring_rate[j]) == (given.kp, given.spring_rate)
            ki = p.law[1][j]
            assert ki == given.ki or (s.phase[i] == Phase.MOVING and ki < given.ki)
            assert (s.drive[i], s.waves[i]) == (1, 1)
        assert (s.wait[i] != 0) == (s.phase[i] == Phase.MOVING)
        assert s.wait[i] == 0 or s.timeout[i] >= s.ticks[i]
