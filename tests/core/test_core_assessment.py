"""Assessment of rows: settled transients, known powers, rows that cannot be the best."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from rig.realtime import assessment, sequence
from rig.realtime.sequence import LEAD_IN, MEASURE, SETTLE, WAIT_KNOWN, WAIT_SETTLED

PERIOD = 100.0  # ticks, of 0.5 s at the lowest rate of 200 Hz
PARAMS = assessment.Params(
    period=PERIOD,
    station=1,
    least_periods=2,
    most_periods=20,
    precision=0.1,
    precision_of_best=0.0,
    ends_worse=0,
)
Signal = Callable[[float], float]  # of the tick


class Run:
    """A plan of which each segment lasts until its condition is met."""

    def __init__(self, params: assessment.Params = PARAMS) -> None:
        self.params, self.state, self.tick, self.segment = params, assessment.start(), 0, 0

    def last(self, phase: int, power: Signal, velocity: Signal, most: int = 200) -> int:
        """Run a segment until it settles, or is known, or ``most`` periods; return its ticks."""
        plan = sequence.State(self.segment, self.tick, 0, 0)
        while self.tick - plan.entered < round(most * self.params.period):
            powers, now = (math.nan, power(self.tick)), velocity(self.tick)
            self.state = assessment.step(
                self.params, self.state, plan, phase, self.tick, 1, (powers, now)
            )
            self.tick += 1
            if self.state.flags:
                break
        self.segment += 1
        return self.tick - plan.entered

    def row(self, periods: Iterator[float]) -> int:
        """Measure a row with these mean powers of periods; return the number of periods."""
        powers = list(periods)
        begin = self.tick
        return round(
            self.last(
                MEASURE, lambda tick: powers[int((tick - begin) // PERIOD)], still, len(powers)
            )
            / PERIOD
        )


def still(tick: float) -> float:
    return 0.0


def wave(amplitude: float, rest: float, decay: float, period: float = PERIOD) -> Signal:
    """A motion whose amplitude has a ``rest`` that decays within ``decay`` ticks."""

    def velocity(tick: float) -> float:
        share = 1.0 + rest * math.exp(-tick / decay)
        return amplitude * share * math.cos(2.0 * math.pi * tick / period + 0.3)

    return velocity


@pytest.mark.parametrize("period", [PERIOD, 142.86, 357.1])
@pytest.mark.parametrize("periods_of_decay", [0.3, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("rest", [-1.0, 0.5, 2.0])
def test_a_segment_ends_once_the_rest_of_the_transient_is_small(
    period: float, periods_of_decay: float, rest: float
) -> None:
    """The rest is known here; the test sees changes of periods only, and is up to twice off."""
    decay = periods_of_decay * period
    run = Run(PARAMS._replace(period=period))
    ticks = run.last(SETTLE, lambda tick: 0.0, wave(0.3, rest, decay, period))
    left = abs(rest) * math.exp(-ticks / decay)
    assert run.state.flags == WAIT_SETTLED
    assert left <= 2.0 * assessment.SETTLED
    # Two changes at least, and no more than two periods beyond the time at which the rest is small.
    needed = decay * math.log(abs(rest) / assessment.SETTLED)
    assert 1.9 * period <= ticks <= max(4.1 * period, needed + 2.5 * period)


def test_a_growing_motion_does_not_settle() -> None:
    run = Run()
    run.last(SETTLE, still, lambda tick: wave(1e-3, 0.0, 1.0)(tick) * math.exp(tick / 2000.0), 50)
    assert run.state.flags == 0


@pytest.mark.parametrize("periods_of_decay", [0.1, 0.3, 1.0, 3.0, 10.0])
def test_after_a_row_the_first_change_counts(periods_of_decay: float) -> None:
    """From the steady motion of the row before to new gains, with which it is half as large."""
    run, decay = Run(), periods_of_decay * PERIOD
    run.last(SETTLE, still, wave(0.3, 0.0, 1.0))
    run.last(MEASURE, still, wave(0.3, 0.0, 1.0), 4)
    begin = run.tick

    def changed(tick: float) -> float:
        share = 0.5 + 0.5 * math.exp(-(tick - begin) / decay)
        return share * wave(0.3, 0.0, 1.0)(tick)

    ticks = run.last(SETTLE, still, changed)
    assert math.exp(-ticks / decay) <= 2.0 * assessment.SETTLED
    assert ticks <= max(3.1 * PERIOD, decay * math.log(1.0 / assessment.SETTLED) + 2.0 * PERIOD)


def test_the_power_must_settle_as_well() -> None:
    """As the voltage of a bus that charges slowly, while the motion repeats from the start."""
    run = Run()
    run.last(SETTLE, lambda tick: -50.0, wave(0.3, 0.0, 1.0))
    decay = 4.0 * PERIOD
    begin = run.tick
    power: Signal = lambda tick: -50.0 * (1.0 - math.exp(-(tick - begin) / decay))  # noqa: E731
    ticks = run.last(SETTLE, power, wave(0.3, 0.0, 1.0))
    assert math.exp(-ticks / decay) <= 2.0 * assessment.SETTLED_POWER


def test_a_lead_in_waits_for_the_waves() -> None:
    run = Run()
    front = 30.0 * PERIOD

    def arrives(tick: float) -> float:
        return 0.0 if tick < front else wave(0.3, -1.0, 2.0 * PERIOD)(tick - front)

    assert run.last(LEAD_IN, still, arrives) > front + 5.0 * PERIOD


def draw(seed: int, mean: float, scatter: float, count: int = 20) -> Iterator[float]:
    return iter(np.random.default_rng(seed).normal(mean, scatter, count).tolist())


def test_a_row_ends_with_the_precision_from_its_own_scatter_and_that_of_rows_before() -> None:
    run, before = Run(), []
    for seed in range(5):
        powers = np.array(list(draw(seed, -10.0, 0.3)))
        count = run.row(iter(powers))
        freedom = min(sum(len(each) - 1 for each in before), assessment.POOLED)
        pooled = sum(((each - each.mean()) ** 2).sum() for each in before)
        earlier = max(sum(len(each) - 1 for each in before), 1)

        def error(n: int) -> tuple[float, int]:
            own = ((powers[:n] - powers[:n].mean()) ** 2).sum()  # noqa: B023
            dof = freedom + n - 1  # noqa: B023
            return math.sqrt((own + freedom * pooled / earlier) / dof / n), dof  # noqa: B023

        met = [
            n
            for n in range(2, 21)
            if error(n)[0] <= PARAMS.precision and error(n)[1] >= assessment.LEAST_FREEDOM
        ]
        assert count == met[0]
        before.append(powers[:count])
    assert run.state.rows.best == pytest.approx(min(each.mean() for each in before))
    assert run.state.rows.freedom == sum(len(each) - 1 for each in before)


def test_a_row_that_cannot_be_the_best_ends_at_once() -> None:
    run = Run(PARAMS._replace(precision=1e-6, ends_worse=1))
    assert run.row(draw(1, -10.0, 0.3, 20)) == 20
    assert run.row(draw(2, -8.0, 0.3, 20)) == 2  # 4.5 standard errors worse after two periods
    assert run.row(draw(3, -10.1, 0.3, 20)) == 20
    assert run.row(draw(4, -12.0, 0.3, 20)) == 20  # the best one
    assert run.state.rows.best == pytest.approx(-12.0, abs=0.3)


def test_a_precision_may_be_a_share_of_the_best_power() -> None:
    run = Run(PARAMS._replace(precision=0.0, precision_of_best=0.01))
    run.row(draw(1, -100.0, 2.0, 20))
    assert run.row(draw(2, -60.0, 2.0, 20)) < 8  # 1 W, about four periods


def test_without_a_wave_period_nothing_is_assessed() -> None:
    run = Run(assessment.NOTHING._replace(period=0.0))
    state = assessment.step(
        run.params, run.state, sequence.State(1, 0, 0, 0), MEASURE, 5, 1, ((1.0,), 1.0)
    )
    assert state == assessment.start()


def test_lost_ticks_and_holds() -> None:
    """A period whose last ticks are lost ends with the next one; a hold begins anew."""
    state, plan = assessment.start(), sequence.State(3, 0, 0, 0)
    for tick in range(30):
        state = assessment.step(PARAMS, state, plan, MEASURE, tick, 1, ((0.0, 2.0), 0.0))
    state = assessment.step(PARAMS, state, plan, MEASURE, 101, 72, ((0.0, 2.0), 0.0))
    assert (state.segment.periods, state.scatter.mean) == (1, 2.0)
    paused = plan._replace(paused=1)
    state = assessment.step(PARAMS, state, paused, MEASURE, 102, 1, ((0.0, 2.0), 0.0))
    assert (state.segment.periods, state.segment.ticks, state.flags) == (0, 0, 0)


def test_a_missed_power_ends_no_row() -> None:
    run = Run(PARAMS._replace(ends_worse=1))
    run.row(iter([-5.0, -5.1, -5.05, -4.95, -5.0, -5.1]))
    assert run.row(iter([math.nan] * 20)) == 20
    assert run.state.flags == 0
    assert math.isfinite(run.state.rows.best)
    assert run.row(iter([-5.0, -5.1] * 10)) == 20  # the scatter of the rows is unknown from now on


def test_known_is_a_flag_of_measurements_only() -> None:
    run = Run()
    run.last(SETTLE, lambda tick: -5.0, wave(0.3, 0.5, PERIOD))
    assert run.state.flags == WAIT_SETTLED
    run.row(draw(1, -5.0, 0.01))
    assert run.state.flags == WAIT_KNOWN
