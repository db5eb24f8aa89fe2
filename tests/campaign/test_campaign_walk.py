"""Plans walked tick by tick with the loop's own step."""

import itertools
from pathlib import Path
from typing import Any, NamedTuple

from hypothesis import given, settings
from hypothesis import strategies as st

from rig.config import CampaignFile, Place, RigFile, load
from rig.config.columns import ALWAYS
from rig.planning.campaign import Plan, check, plan
from rig.planning.campaign.point import Where, point
from rig.realtime import sequence
from rig.realtime.sequence import WAIT_DRIVE, WAIT_STATOR, Phase

CONFIGS = Path(__file__).parents[2] / "configs"
RIG, _ = load(CONFIGS / "rigs" / "wavebot.yaml", RigFile)
SLOW = RIG.model_copy(update={"rate_hz": 100})
READY = WAIT_STATOR | WAIT_DRIVE


class Tick(NamedTuple):
    tick: int
    segment: int
    row: int
    phase: Phase
    attempt: int
    late: bool


def small(frequency: float = 0.3) -> Plan:
    """Three rows, a spring move before the last, 100 Hz."""
    campaign = CampaignFile.model_validate(
        {
            "name": "x", "rig": "x", "matrix": {"csv": "x"}, "tare": {"duration_s": 0.5},
            "sea": {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": frequency},
            "start": {"set_point_s": 1, "lead_in_s": 2},
            "timing": {"settle_s": 1, "interval_s": 5},
        }
    )  # fmt: skip
    here = Where(Place(Path("x"), 1), "x")
    points = tuple(
        point(ALWAYS, [(value, here) for value in (rate, -1000.0, 0.0)])
        for rate in (0.0, 0.0, 8340.0)
    )
    return plan(campaign, SLOW, points)


def walk(made: Plan, ticks: Any, ready: Any = None, held: Any = ()) -> list[Tick]:
    """Every tick of a walk until the plan is done."""
    state, walked = sequence.start(0), []
    for tick in ticks:
        flags = READY if ready is None else ready(tick)
        state, position = sequence.step(
            made.segments, state, tick, flags, tick not in held, tick in held
        )
        phase = Phase(made.segments.phase[state.segment])
        row = made.segments.row[state.segment]
        walked.append(Tick(tick, state.segment, row, phase, state.attempt, position.late))
        if phase is Phase.DONE:
            assert position.finished
            break
    assert walked[-1].phase is Phase.DONE
    return walked


def counts(walked: list[Tick]) -> list[int]:
    return [len(list(group)) for _, group in itertools.groupby(walked, key=lambda t: t.segment)]


def test_the_default_campaign_takes_exactly_its_planned_ticks() -> None:
    made = check(CONFIGS / "campaigns" / "default.yaml").plan
    assert made is not None
    walked = walk(made, itertools.count())
    assert counts(walked)[:-1] == list(made.segments.ticks[:-1])
    assert walked[-1].tick == round(made.duration / made.dt)
    measured = [t for t in walked if t.phase is Phase.MEASURE]
    assert len(measured) == 66 * 14_000
    assert {t.attempt for t in walked} == {0}


def test_waiting_makes_moving_longer_and_nothing_else() -> None:
    made = small()
    first = made.segments.phase.index(Phase.MOVING)
    assert walk(made, itertools.count())[-1].tick == round(made.duration / made.dt)

    def ready(tick: int) -> int:
        """Drive up after 3 s; the stator takes 7.5 s (2.5 s over its interval) later on."""
        start = 50 + 300 + 200 + 2 * 500
        flags = WAIT_DRIVE if tick >= 350 else 0
        return flags | (WAIT_STATOR if tick < start or tick >= start + 750 else 0)

    walked = walk(made, itertools.count(), ready)
    planned = list(made.segments.ticks[:-1])
    planned[first] = 300
    planned[made.segments.phase.index(Phase.MOVING, first + 1)] = 750
    assert counts(walked)[:-1] == planned
    assert not any(t.late for t in walked)


def test_a_stator_that_never_arrives_is_late_at_its_timeout() -> None:
    made = small()
    walked = walk(made, itertools.count(), lambda tick: READY if tick >= 6200 else WAIT_DRIVE)
    first_late = next(t for t in walked if t.late)
    assert first_late.phase is Phase.MOVING
    assert first_late.tick == 50 + 6000  # 60 s after the tare


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(1, 40), min_size=3, max_size=30), st.floats(0.26, 2))
def test_lost_ticks_do_not_shift_a_window(gaps: list[int], frequency: float) -> None:
    """Losing up to 0.4 s at a time, a segment that ends by time still ends on its planned tick."""
    made = small(frequency)
    ticks = list(itertools.accumulate(itertools.islice(itertools.cycle(gaps), 100_000), initial=0))
    walked = walk(made, ticks)
    entered = 0
    state = sequence.start(0)
    for tick in ticks[: len(walked)]:
        before = state
        state, _ = sequence.step(made.segments, state, tick, READY, True, False)
        if state.segment != before.segment:
            entered += made.segments.ticks[before.segment]
            if made.segments.wait[before.segment]:
                assert entered <= state.entered
                entered = state.entered  # one that waited ends now
            assert state.entered == entered
    measured = {t.row for t in walked if t.phase is Phase.MEASURE}
    assert measured == {0, 1, 2}


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2600), st.integers(1, 300))
def test_a_hold_makes_the_row_start_over(begin: int, length: int) -> None:
    made = small()
    plain = walk(made, itertools.count())
    end = plain[-1].tick
    begin = min(begin, end - 1)
    held = range(begin, begin + length)
    walked = walk(made, itertools.count(), held=held)
    s = made.segments
    # the tick of the hold itself stands still in the segment of the tick before
    at = plain[max(begin - 1, 0)]
    after = next(t for t in walked if t.tick == begin + length)
    assert after.segment == s.restart[at.segment]
    assert s.row[after.segment] == at.row
    assert after.attempt == 1
    # from there on the walk is the plain one, later
    lost = after.tick - next(t.tick for t in plain if t.segment == after.segment)
    assert walked[-1].tick == end + lost
    for t in walked:
        if t.row >= 0 and t.tick >= begin + length:
            assert t.attempt == (1 if t.row == at.row else 0)
    for row in range(3):
        last = [t for t in walked if t.row == row and t.phase is Phase.MEASURE
                and t.attempt == (1 if row == at.row else 0)]  # fmt: skip
        assert len(last) == s.ticks[s.phase.index(Phase.MEASURE, s.row.index(row))]


def test_neither_running_nor_held_leaves_the_plan_for_good() -> None:
    made = small()
    state = sequence.start(0)
    for tick in range(1000):
        state, position = sequence.step(made.segments, state, tick, READY, tick != 700, False)
    assert Phase(made.segments.phase[state.segment]) is Phase.DONE
    assert position.finished
