"""Plans executed tick by tick with the loop's own step."""

import itertools
from pathlib import Path
from typing import Any, NamedTuple

from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from controllers import impedance
from rig.campaign import build_plan
from rig.campaign.record import RecordedCampaign
from rig.config.pydantic_errors import load
from rig.config.yaml_source import SourceLocation
from rig.kinds.wavebot.campaign import CAMPAIGNS, Plan, check_campaign
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.planning.point import ValueLocation, make_point
from rig.realtime import sequence
from rig.realtime.sequence import WAIT_ARRIVAL, WAIT_DRIVE, Phase

CONFIGS = Path(__file__).parents[2] / "configs"
RIG, _ = load(CONFIGS / "rigs" / "wavebot.yaml", RigFile)
RIG_100_HZ = RIG.model_copy(update={"rate_hz": 100})
READY = WAIT_ARRIVAL | WAIT_DRIVE


class Tick(NamedTuple):
    tick: int
    segment: int
    row: int
    phase: Phase
    attempt: int
    late: bool


def small_plan(frequency: float = 0.3) -> Plan:
    """Return a plan of three rows at 100 Hz, with a spring move before the last row."""
    campaign = CampaignFile.model_validate(
        {
            "name": "x", "rig": "x", "matrix": {"csv": "x"}, "tare": {"duration_s": 0.5},
            "sea": {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": frequency},
            "start": {"set_point_s": 1, "lead_in_s": 2},
            "timing": {"settle_s": 1, "interval_s": 5},
        }
    )  # fmt: skip
    location = ValueLocation(SourceLocation(Path("x"), 1), "x")
    columns = COLUMNS.required(impedance.COLUMNS)
    points = tuple(
        make_point(
            columns,
            [(value, location) for value in (rate, -1000.0, 0.0)],
        )
        for rate in (0.0, 0.0, 8340.0)
    )
    return build_plan(RecordedCampaign(CAMPAIGNS, campaign, RIG_100_HZ, None, points, None, 1))


def run_plan(planned: Plan, ticks: Any, ready: Any = None, stopped_ticks: Any = ()) -> list[Tick]:
    """Return every tick until the plan is done."""
    state, ticks_run = sequence.start(0), []
    for tick in ticks:
        flags = READY if ready is None else ready(tick)
        state, position = sequence.step(
            planned.segments, state, tick, flags, tick not in stopped_ticks, tick in stopped_ticks
        )
        phase = Phase(planned.segments.phase[state.segment])
        row = planned.segments.row[state.segment]
        ticks_run.append(Tick(tick, state.segment, row, phase, state.attempt, position.timed_out))
        if phase is Phase.DONE:
            assert position.finished
            break
    assert ticks_run[-1].phase is Phase.DONE
    return ticks_run


def counts(ticks_run: list[Tick]) -> list[int]:
    return [len(list(group)) for _, group in itertools.groupby(ticks_run, key=lambda t: t.segment)]


def test_the_default_campaign_takes_exactly_its_planned_ticks() -> None:
    planned = check_campaign(CONFIGS / "campaigns" / "default.yaml").plan
    assert planned is not None
    ticks_run = run_plan(planned, itertools.count())
    assert counts(ticks_run)[:-1] == list(planned.segments.ticks[:-1])
    assert ticks_run[-1].tick == round(planned.duration / planned.dt)
    measured = [t for t in ticks_run if t.phase is Phase.MEASURE]
    assert len(measured) == 66 * 14_000
    assert {t.attempt for t in ticks_run} == {0}


def test_waiting_extends_only_the_moving_segment() -> None:
    planned = small_plan()
    first = planned.segments.phase.index(Phase.MOVING)
    assert run_plan(planned, itertools.count())[-1].tick == round(planned.duration / planned.dt)

    def ready(tick: int) -> int:
        """The drive is ready after 3 s; the stator move takes 7.5 s, 2.5 s over its interval."""
        start = 50 + 300 + 200 + 2 * 500
        flags = WAIT_DRIVE if tick >= 350 else 0
        return flags | (WAIT_ARRIVAL if tick < start or tick >= start + 750 else 0)

    ticks_run = run_plan(planned, itertools.count(), ready)
    expected_ticks = list(planned.segments.ticks[:-1])
    expected_ticks[first] = 300
    expected_ticks[planned.segments.phase.index(Phase.MOVING, first + 1)] = 750
    assert counts(ticks_run)[:-1] == expected_ticks
    assert not any(t.late for t in ticks_run)


def test_a_stator_that_never_arrives_is_late_at_its_timeout() -> None:
    planned = small_plan()
    ticks_run = run_plan(
        planned, itertools.count(), lambda tick: READY if tick >= 6200 else WAIT_DRIVE
    )
    first_late = next(t for t in ticks_run if t.late)
    assert first_late.phase is Phase.MOVING
    assert first_late.tick == 50 + 6000  # 60 s after the tare


@settings(max_examples=examples(100))
@given(st.lists(st.integers(1, 40), min_size=3, max_size=30), st.floats(0.26, 2))
def test_lost_ticks_do_not_shift_a_window(gaps: list[int], frequency: float) -> None:
    """A segment that ends by time ends on its planned tick despite gaps of up to 0.4 s."""
    planned = small_plan(frequency)
    ticks = list(itertools.accumulate(itertools.islice(itertools.cycle(gaps), 100_000), initial=0))
    ticks_run = run_plan(planned, ticks)
    entered = 0
    state = sequence.start(0)
    for tick in ticks[: len(ticks_run)]:
        before = state
        state, _ = sequence.step(planned.segments, state, tick, READY, True, False)
        if state.segment != before.segment:
            entered += planned.segments.ticks[before.segment]
            if planned.segments.wait[before.segment]:
                assert entered <= state.entered
                entered = state.entered  # a segment that waited ends now
            assert state.entered == entered
    measured = {t.row for t in ticks_run if t.phase is Phase.MEASURE}
    assert measured == {0, 1, 2}


@settings(max_examples=examples(100))
@given(st.integers(0, 2600), st.integers(1, 300))
def test_a_hold_restarts_the_row(begin: int, length: int) -> None:
    planned = small_plan()
    undisturbed = run_plan(planned, itertools.count())
    end = undisturbed[-1].tick
    begin = min(begin, end - 1)
    stopped_ticks = range(begin, begin + length)
    ticks_run = run_plan(planned, itertools.count(), stopped_ticks=stopped_ticks)
    s = planned.segments
    # during the hold the segment remains that of the previous tick
    at = undisturbed[max(begin - 1, 0)]
    after = next(t for t in ticks_run if t.tick == begin + length)
    assert after.segment == s.restart[at.segment]
    assert s.row[after.segment] == at.row
    assert after.attempt == 1
    # from there on the ticks are those without a hold, but later
    lost = after.tick - next(t.tick for t in undisturbed if t.segment == after.segment)
    assert ticks_run[-1].tick == end + lost
    for t in ticks_run:
        if t.row >= 0 and t.tick >= begin + length:
            assert t.attempt == (1 if t.row == at.row else 0)
    for row in range(3):
        last = [t for t in ticks_run if t.row == row and t.phase is Phase.MEASURE
                and t.attempt == (1 if row == at.row else 0)]  # fmt: skip
        assert len(last) == s.ticks[s.phase.index(Phase.MEASURE, s.row.index(row))]


def test_a_plan_that_is_neither_running_nor_held_ends() -> None:
    planned = small_plan()
    state = sequence.start(0)
    for tick in range(1000):
        state, position = sequence.step(planned.segments, state, tick, READY, tick != 700, False)
    assert Phase(planned.segments.phase[state.segment]) is Phase.DONE
    assert position.finished
