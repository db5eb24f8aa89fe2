"""Assessment of a row at the end of each wave period: has it settled, is its power known?

A segment of the plan that waits for one of these ends on the tick of a whole period, or after its
longest time (`rig.realtime.sequence`).

*Settled*: what is left of the transient is below a bound, for the motion (its component at the wave
frequency) and for the power. Changes c from period to period that shrink by the factor r add up to
c r / (1 - r) from now on, so this sum is compared, not c itself. The first change after a row is
that from its steady motion to the mean over a period of the transient: r appears larger than it is.

*Known*: the standard error of the mean power, from the scatter of the periods, is at most the
precision that the campaign sets; or the row cannot be the best any more, because its power is
above the lowest of the rows before by more than the errors of both explain. A few periods alone
tell little about their scatter, so the scatter of the rows before counts for up to `POOLED` periods
of it (an estimate that shrinks towards the pooled variance).

All this is for a regular sea; `rig.realtime.paired_rows` has the rules for irregular ones.
"""

from math import cos, floor, inf, pi, sin, sqrt
from typing import Any, NamedTuple

from controllers.signals import Watt
from rig.realtime import paired_rows, sequence
from rig.realtime.sequence import LEAD_IN, MEASURE, SETTLE, WAIT_KNOWN, WAIT_SETTLED
from rig.realtime.student import quantile

SETTLED = 0.01  # rest of the transient, of the amplitude of the motion
SETTLED_POWER = 0.02  # of the power, which goes with the square of the motion
NOISE = 0.1  # of these bounds: changes as small as that are noise, and not compared
NOISE_ERRORS = 2.0  # standard errors of a difference of two periods that are noise, too
REST = 1.0e-3  # m/s or rad/s; an amplitude as small counts as rest
POOLED = 8  # degrees of freedom for which the scatter of earlier rows counts at most
LEAST_FREEDOM = 4  # degrees of freedom from which a row may end as no longer the best


Assessed = tuple[tuple[float, ...], float]
"""The powers of the stations (W) and the velocity (m/s or rad/s) of a tick."""


class Params(NamedTuple):
    """The bounds of the assessment."""

    period: float  # ticks of a wave period; 0: nothing, or an irregular sea
    station: int  # whose power, as of `Kind.assessed`
    least_periods: int  # of a measurement
    most_periods: int
    precision: Watt  # standard error with which a row ends; 0: none
    precision_of_best: float  # the same as a share of the lowest power so far; 0: none
    ends_worse: int  # 1: a row ends that cannot be the best any more
    paired: paired_rows.Params = paired_rows.NOTHING  # of an irregular sea


class Mean(NamedTuple):
    """Power, and the component of the velocity at the wave frequency: a mean, or sums for one."""

    power: Watt
    cosine: float
    sine: float


class Segment(NamedTuple):
    """The present segment of the plan."""

    number: int
    entered: int  # tick in which it began
    ticks: int  # since then
    periods: int  # whole ones


class Transient(NamedTuple):
    """The changes from period to period."""

    last: Mean  # over the last period, also one of the segment before
    known: int  # 1: there was one, and no other phase since
    motion: float  # change of the velocity's component to that period; inf: unknown
    power: float  # of the power


class Scatter(NamedTuple):
    """The mean power of periods, and the sum of its squared deviations."""

    mean: Watt
    squares: float  # W^2


class Rows(NamedTuple):
    """The findings of the rows before."""

    squares: float  # W^2, of all their periods
    freedom: int  # degrees of freedom of this sum
    best: Watt  # lowest power; inf: none is known
    variance: float  # W^2, of that mean


class State(NamedTuple):
    """Memory of the assessment."""

    segment: Segment
    samples: float  # executed ticks of the present period, of the first one a share
    sums: Mean  # over them
    transient: Transient
    scatter: Scatter  # of the present measurement
    rows: Rows
    paired: paired_rows.State  # in an irregular sea
    flags: int  # the conditions of the plan that are met at the end of this tick


NOTHING = Params(0.0, 0, 0, 0, 0.0, 0.0, 0)
_ZERO = Mean(0.0, 0.0, 0.0)
NO_SCATTER = Scatter(0.0, 0.0)
NO_ROWS = Rows(0.0, 0, inf, 0.0)
_NO_TRANSIENT = Transient(_ZERO, 0, inf, inf)


def start() -> State:
    """Return the state before the first tick."""
    return State(
        Segment(-1, -1, 0, 0),
        0.0,
        _ZERO,
        _NO_TRANSIENT,
        NO_SCATTER,
        NO_ROWS,
        paired_rows.start(),
        0,
    )


def nothing_assessed(row: Any) -> Assessed:
    """Return no power and no velocity: a kind of rig whose rows are not assessed."""
    return (0.0,), 0.0


def step(
    params: Params,
    state: State,
    plan: sequence.State,
    phase: int,
    tick: int,
    periods: int,
    values: Assessed,
) -> State:
    """Return the state after a tick of the plan.

    ``periods``: ticks since the last call, more than one if some were lost.
    """
    powers, velocity = values
    segment, samples, sums, transient, scatter, rows, paired, _ = state
    if params.paired.bin > 0.0:
        power = powers[params.station]
        paired = paired_rows.step(params.paired, paired, plan, phase, tick, power)
        return State(segment, samples, sums, transient, scatter, rows, paired, paired.flags)
    if params.period == 0.0:
        return state
    number, entered, ticks, count = segment
    if plan.paused == 1 or plan.segment != number or plan.entered != entered:
        number, entered, ticks, count = plan.segment, plan.entered, 0, 0
        samples, sums, scatter, periods = 0.0, _ZERO, NO_SCATTER, 1
    segment = Segment(number, entered, ticks, count)
    if plan.paused == 1 or phase not in (LEAD_IN, SETTLE, MEASURE):
        return State(segment, samples, sums, _NO_TRANSIENT, scatter, rows, paired, 0)
    turn = tick / params.period
    angle = 2.0 * pi * (turn - floor(turn))
    now = Mean(powers[params.station], 2.0 * velocity * cos(angle), 2.0 * velocity * sin(angle))
    ticks = ticks + periods
    end = (count + 1) * params.period
    if ticks < floor(end + 0.5):
        segment = Segment(number, entered, ticks, count)
        sums = _sum(sums, now, 1.0)
        return State(segment, samples + 1.0, sums, transient, scatter, rows, paired, 0)
    # The period ends within half a tick of this one's end; the next one begins with the rest.
    weight = end - ticks + 1.0 if periods == 1 else 1.0
    samples, sums = samples + weight, _sum(sums, now, weight)
    mean = Mean(sums.power / samples, sums.cosine / samples, sums.sine / samples)
    count = floor(ticks / params.period + 0.5)
    segment = Segment(number, entered, ticks, count)
    flags = 0
    if phase == MEASURE:
        scatter = add_period(scatter, mean.power, count)
        if count >= params.least_periods and is_known(params, rows, scatter, count):
            flags = WAIT_KNOWN
        if flags != 0 or count >= params.most_periods:
            rows = after_row(rows, scatter, count)
    elif transient.known == 1 and count > 1 and _is_settled(phase, transient, mean, rows):
        flags = WAIT_SETTLED
    samples, sums = 1.0 - weight, _sum(_ZERO, now, 1.0 - weight)
    transient = _after(transient, mean)
    return State(segment, samples, sums, transient, scatter, rows, paired, flags)


def _sum(sums: Mean, now: Mean, weight: float) -> Mean:
    return Mean(
        sums.power + weight * now.power,
        sums.cosine + weight * now.cosine,
        sums.sine + weight * now.sine,
    )


def _is_settled(phase: int, transient: Transient, mean: Mean, rows: Rows) -> bool:
    """Return whether what is left of the transients after a period is below the bounds."""
    last = transient.last
    amplitude = sqrt(mean.cosine * mean.cosine + mean.sine * mean.sine)
    if phase == LEAD_IN and amplitude <= REST:
        return False  # the waves are not there yet
    bound = SETTLED * (amplitude if amplitude > REST else REST)
    power_bound = SETTLED_POWER * abs(mean.power)
    if rows.freedom > 0:
        noise = NOISE_ERRORS * sqrt(2.0 * rows.squares / rows.freedom)
        power_bound = power_bound if power_bound > noise else noise
    return _fades(_distance(mean, last), transient.motion, bound) and _fades(
        abs(mean.power - last.power), transient.power, power_bound
    )


def _distance(mean: Mean, last: Mean) -> float:
    cosine, sine = mean.cosine - last.cosine, mean.sine - last.sine
    return sqrt(cosine * cosine + sine * sine)


def _fades(change: float, before: float, bound: float) -> bool:
    """Return whether changes that shrink as the last two did add up to less than a bound."""
    if change <= NOISE * bound:
        return True
    if not change < before or before == inf:
        return False
    ratio = change / before
    return change * ratio / (1.0 - ratio) <= bound


def _after(transient: Transient, mean: Mean) -> Transient:
    last = transient.last
    if transient.known == 0:
        return Transient(mean, 1, inf, inf)
    return Transient(mean, 1, _distance(mean, last), abs(mean.power - last.power))


def add_period(scatter: Scatter, power: float, count: int) -> Scatter:
    """Return the scatter with the mean power of one more period, the one with number ``count``.

    Welford's recurrence.
    """
    deviation = power - scatter.mean
    mean = scatter.mean + deviation / count
    return Scatter(mean, scatter.squares + deviation * (power - mean))


def _variance(rows: Rows, scatter: Scatter, count: int) -> tuple[float, int]:
    """Return the variance of the power of a period (W^2), and its degrees of freedom.

    It is that of the ``count`` periods of the row, and of the rows before for some more of them.
    """
    pooled = rows.freedom if rows.freedom < POOLED else POOLED
    freedom = pooled + count - 1
    if freedom < 1:
        return inf, 0
    squares = scatter.squares
    if pooled > 0:
        squares = squares + pooled * (rows.squares / rows.freedom)
    return squares / freedom, freedom


def is_precise(params: Params, rows: Rows, scatter: Scatter, count: int) -> bool:
    """Return whether the standard error after ``count`` periods is within the precision."""
    variance, freedom = _variance(rows, scatter, count)
    precision = params.precision_of_best * abs(rows.best) if rows.best < inf else 0.0
    precision = precision if precision > params.precision else params.precision
    return freedom >= LEAST_FREEDOM and variance / count <= precision * precision


def is_known(params: Params, rows: Rows, scatter: Scatter, count: int) -> bool:
    """Return whether the power of a row is known well enough after so many periods."""
    if is_precise(params, rows, scatter, count):
        return True
    variance, freedom = _variance(rows, scatter, count)
    if params.ends_worse == 0 or freedom < LEAST_FREEDOM or not rows.best < inf:
        return False
    allowed = quantile(freedom) * sqrt(variance / count + rows.variance)
    return scatter.mean - rows.best > allowed


def after_row(rows: Rows, scatter: Scatter, count: int) -> Rows:
    """Return what the rows have shown, with one more of ``count`` periods."""
    variance, _ = _variance(rows, scatter, count)
    best, best_variance = rows.best, rows.variance
    if scatter.mean < best:
        best, best_variance = scatter.mean, variance / count
    return Rows(rows.squares + scatter.squares, rows.freedom + count - 1, best, best_variance)
