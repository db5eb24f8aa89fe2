"""Ends of rows in an irregular sea that repeats: each row is compared with a reference row.

The sea is the same for every row at the same time of its repeat period. So the power of a row
follows that of a reference row, which covers the whole repeat period; the regression of one on the
other over the part that the row has measured estimates its mean over the whole period:

    Y = y + b (X - x)      y, x: means of row and reference over that part; X: of the reference

(the regression estimator of survey sampling: W. G. Cochran, Sampling Techniques, ch. 7). Batches of
a thirtieth of the repeat period, some waves long, are its samples. Their residuals grow with the
waves, so the variance is that of weighted residuals with their leverage (HC3: J. G. MacKinnon and
H. White, Journal of Econometrics 29, 1985), times the share of the period that is not measured
(finite population), times `CORRELATED` because neighbouring batches are not independent.

The first row is the first reference; a row over the whole period with less power replaces it. Any
other row ends on a whole batch, once its standard error is at most the precision that the campaign
sets; or once its power is above the least one so far by more than 99.5 % of Student's distribution
explain; or after the repeat period.

Batches consist of `PER_BATCH` bins, and rows begin with a bin. Two rings hold the powers of the
last `BINS` bins, and those of the reference at the same times of the repeat period: the next bin
replaces the first entry of the one, and is compared with the first entry of the other.
"""

from math import floor, inf, sqrt
from typing import NamedTuple

from controllers.signals import Watt
from rig.realtime import sequence
from rig.realtime.sequence import MEASURE, SETTLE, WAIT_KNOWN, WAIT_SETTLED
from rig.realtime.student import quantile

BINS = 60  # of a repeat period
PER_BATCH = 2
LEAST_BATCHES = 5  # of a row: three degrees of freedom
LEAST_PRECISE = 8  # batches whose standard error may be compared with a precision
CORRELATED = 1.4  # 1 + 2 rho for batches that correlate with their neighbours by rho = 0.2
_WHOLE = 0.9  # share of the ticks of a bin without which it does not count


class Params(NamedTuple):
    """The bounds of the assessment."""

    bin: float  # ticks; 0: nothing
    least_batches: int
    precision: Watt  # standard error with which a row ends; 0: none
    precision_of_best: float  # the same as a share of the least power so far; 0: none
    ends_worse: int  # 1: a row ends that cannot be the best any more


class Estimate(NamedTuple):
    """Mean power over the repeat period."""

    power: Watt
    variance: float  # W^2; inf: unknown


class Row(NamedTuple):
    """The present segment of the plan."""

    segment: int
    entered: int  # tick in which it began
    bins: int  # whole ones


class State(NamedTuple):
    """Memory of the assessment."""

    row: Row
    bin: int  # number of the present bin, counted from tick 0; -1: none yet
    samples: int  # executed ticks in it
    sum: float  # W, of their powers
    own: tuple[float, ...]  # W, of the last bins
    reference: tuple[float, ...]  # W, of the reference row
    reference_mean: Watt  # inf: there is no reference yet
    best: Estimate  # of the row with the least power; inf: there is none
    flags: int  # the conditions of the plan that are met at the end of this tick


NOTHING = Params(0.0, 0, 0.0, 0.0, 0)
_NO_BINS = (0.0,) * BINS


def start() -> State:
    """Return the state before the first tick."""
    return State(Row(-1, -1, 0), -1, 0, 0.0, _NO_BINS, _NO_BINS, inf, Estimate(inf, 0.0), 0)


def step(
    params: Params, state: State, plan: sequence.State, phase: int, tick: int, power: Watt
) -> State:
    """Return the state after a tick of the plan, in which the row had a ``power``."""
    (segment, entered, bins), number, samples, total, own, reference, mean, best, _ = state
    if number < 0:
        number = floor(tick / params.bin)
    if plan.paused == 1 or plan.segment != segment or plan.entered != entered:
        segment, entered, bins = plan.segment, plan.entered, 0
        samples, total = 0, 0.0
    samples, total = samples + 1, total + power
    following = floor((tick + 1) / params.bin)
    if following == number:
        row = Row(segment, entered, bins)
        return State(row, number, samples, total, own, reference, mean, best, 0)
    # The last tick of a bin; or, if that one was lost, the first one after it.
    own = own[1:] + (total / samples,)  # noqa: RUF005 - not compiled otherwise
    while number < following:
        reference = reference[1:] + reference[:1]
        number = number + 1
    is_measured = phase == MEASURE and plan.paused == 0 and samples >= _WHOLE * params.bin
    bins = bins + 1 if is_measured else 0
    flags = WAIT_SETTLED if phase == SETTLE else 0
    if bins >= BINS:
        flags, whole = WAIT_KNOWN, _mean(own)
        best = Estimate(whole, 0.0) if whole < best.power else best
        if whole < mean:
            reference, mean = own, whole
    elif bins >= PER_BATCH * params.least_batches and bins % PER_BATCH == 0 and mean < inf:
        estimate = estimated(own, reference, mean, bins)
        if _is_known(params, estimate, best, bins // PER_BATCH):
            flags = WAIT_KNOWN
            best = estimate if estimate.power < best.power else best
    row = Row(segment, entered, bins)
    return State(row, number, 0, 0.0, own, reference, mean, best, flags)


def _mean(ring: tuple[float, ...]) -> float:
    total = 0.0
    for power in ring:
        total = total + power
    return total / BINS


def estimated(
    own: tuple[float, ...], reference: tuple[float, ...], reference_mean: Watt, bins: int
) -> Estimate:
    """Return the mean power over the repeat period of a row of some ``bins``, less than all.

    ``own`` and ``reference``: powers of `BINS` bins (W), of which the last ``bins`` are those of
    the row and of the reference at the same time; ``reference_mean``: of all bins.
    """
    count = bins // PER_BATCH
    y = x = 0.0
    for i in range(BINS - bins, BINS):
        y, x = y + own[i], x + reference[i]
    y, x = y / bins, x / bins
    xx = xy = 0.0
    for i in range(BINS - bins, BINS, PER_BATCH):
        dx = _batch(reference, i) - x
        xx, xy = xx + dx * dx, xy + dx * (_batch(own, i) - y)
    if not xx > 0.0:
        return Estimate(y, inf)
    slope, beyond = xy / xx, (reference_mean - x) / xx
    variance = 0.0
    for i in range(BINS - bins, BINS, PER_BATCH):
        dx = _batch(reference, i) - x
        residual = _batch(own, i) - y - slope * dx
        unlike = 1.0 - 1.0 / count - dx * dx / xx  # 1 less the leverage
        if not unlike > 0.0:
            return Estimate(y, inf)
        error = (1.0 / count + dx * beyond) * residual / unlike
        variance = variance + error * error
    unmeasured = 1.0 - bins / BINS
    return Estimate(y + slope * beyond * xx, CORRELATED * unmeasured * variance)


def _batch(ring: tuple[float, ...], first: int) -> float:
    """Return the mean power of a batch from its first bin on."""
    return 0.5 * (ring[first] + ring[first + 1])


def is_precise(params: Params, estimate: Estimate, best: Estimate, batches: int) -> bool:
    """Return whether the standard error of an estimate is within the precision."""
    precision = params.precision_of_best * abs(best.power) if best.power < inf else 0.0
    precision = precision if precision > params.precision else params.precision
    return batches >= LEAST_PRECISE and estimate.variance <= precision * precision


def _is_known(params: Params, estimate: Estimate, best: Estimate, batches: int) -> bool:
    """Return whether the power of a row is known well enough after so many batches."""
    if is_precise(params, estimate, best, batches):
        return True
    if params.ends_worse == 0 or not best.power < inf:
        return False
    allowed = quantile(batches - 2) * sqrt(estimate.variance + best.variance)
    return estimate.power - best.power > allowed
