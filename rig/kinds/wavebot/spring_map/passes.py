"""Load cell readings of one stator position over rotor angle, upwards and downwards.

Samples are averaged in bins of angle for each direction. Half the sum of both directions is the
spring, half their difference is friction. No filter is needed, so none shifts the curve.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.intervals import half_width
from rig.analysis.scatter import standard_error
from rig.spectra.periods import Floats

Integers = npt.NDArray[np.int64]

FIT_HALF_ANGLE = math.pi / 4.0 - 0.1
"""Half width of the window of the rate's linear fit, rad: 39.27 deg (public fbWecCntrl repository,
magSpringMapping.m)."""

SMALL_HALF_ANGLE = math.radians(10.0)
"""Half width of the window of the small-displacement rate, rad."""

_HALF_WINDOW_BINS = 40  # from balance to the end of the fit window
BIN_WIDTH = FIT_HALF_ANGLE / _HALF_WINDOW_BINS
"""Width of a bin, rad: about one degree; the fit window contains whole bins."""

_MIN_SAMPLES = 3  # in a bin


class Samples(NamedTuple):
    """Ticks of one stator position as arrays of equal length, relative to their tare."""

    angle: Floats  # rad, of the rotor from its balance
    direction: Integers  # 1 up, -1 down, 0 at reversal
    torque: Floats  # N m, restoring at a positive angle
    column: Floats  # N, column load cell: force on the body
    stator: Floats  # N, both cells of the stator together


class StationCurve(NamedTuple):
    """Means of one station over angle; NaN where the hoist did not pass in both directions."""

    bins: Integers  # bin i contains angles i * BIN_WIDTH .. (i + 1) * BIN_WIDTH
    angle: Floats  # rad, mean in the bin
    torque: Floats
    column: Floats
    stator: Floats
    friction: Floats  # N, half of (column force downwards - column force upwards)


class RateEstimate(NamedTuple):
    """A slope with its 95 % interval from the scatter of whole passes."""

    slope: float
    interval: float  # half width; NaN for fewer than two whole passes
    passes: int


def bin_centres(index: Integers) -> Floats:
    """Return the angles at the centres of bins, rad."""
    return np.asarray((index + 0.5) * BIN_WIDTH)


def average_passes(samples: Samples) -> StationCurve:
    """Return the means over both directions."""
    bins = np.floor(samples.angle / BIN_WIDTH).astype(np.int64)
    bin_numbers = np.arange(bins.min(), bins.max() + 1)
    up, down = (
        _bin_means(samples, bins - bin_numbers[0], len(bin_numbers), direction)
        for direction in (1, -1)
    )
    angle, torque, column, stator = (0.5 * (a + b) for a, b in zip(up, down, strict=True))
    return StationCurve(bin_numbers, angle, torque, column, stator, 0.5 * (down[2] - up[2]))


def _bin_means(samples: Samples, bins: Integers, count: int, direction: int) -> tuple[Floats, ...]:
    """Return mean angle, torque, column and stator force of each bin in one direction."""
    moving = samples.direction == direction
    inside = bins[moving]
    number = np.bincount(inside, minlength=count)
    divisor = np.where(number >= _MIN_SAMPLES, number, np.nan)
    fields = (samples.angle, samples.torque, samples.column, samples.stator)
    return tuple(
        np.asarray(np.bincount(inside, values[moving], minlength=count) / divisor)
        for values in fields
    )


def estimate_rate(samples: Samples, curve: StationCurve) -> RateEstimate:
    """Return the slope of the torque over angle in the fit window, with its interval.

    The slope is NaN if a bin of the window is empty. The interval comes from the slopes of single
    passes.
    """
    slopes_by_pass = (_pass_slope(samples, begin, end) for begin, end in _passes(samples))
    slopes = [slope for slope in slopes_by_pass if not math.isnan(slope)]
    spread = half_width(standard_error(slopes), len(slopes) - 1)
    return RateEstimate(window_slope(curve, curve.torque, FIT_HALF_ANGLE), spread, len(slopes))


def window_slope(curve: StationCurve, values: Floats, half_angle: float) -> float:
    """Return the least-squares slope within ±``half_angle`` rad; NaN if a bin is empty."""
    inside = np.abs(bin_centres(curve.bins)) < half_angle
    angle, value = curve.angle[inside], values[inside]
    expected = 2 * round(half_angle / BIN_WIDTH)
    if len(angle) < expected or not np.isfinite(value).all():
        return math.nan
    return _slope(angle, value)


def _slope(angle: Floats, value: Floats) -> float:
    centred = angle - angle.mean()
    return float(centred @ value / (centred @ centred))


def _passes(samples: Samples) -> list[tuple[int, int]]:
    """Return the index ranges in which the hoist kept its direction."""
    direction = samples.direction
    edges = [0, *(np.flatnonzero(np.diff(direction)) + 1).tolist(), len(direction)]
    return [(begin, end) for begin, end in pairwise(edges) if direction[begin] != 0]


def _pass_slope(samples: Samples, begin: int, end: int) -> float:
    """Return the slope of one pass with equal weight for each bin; NaN for a partial pass."""
    angle, value = samples.angle[begin:end], samples.torque[begin:end]
    inside = np.abs(angle) < FIT_HALF_ANGLE
    bins = np.floor(angle[inside] / BIN_WIDTH).astype(np.int64) + _HALF_WINDOW_BINS
    number = np.bincount(bins, minlength=2 * _HALF_WINDOW_BINS)
    if len(number) > 2 * _HALF_WINDOW_BINS or (number < _MIN_SAMPLES).any():
        return math.nan
    means = (np.bincount(bins, field[inside]) / number for field in (angle, value))
    return _slope(*means)


class SineFit(NamedTuple):
    """The law T = Tp sin 2 theta + T0, fitted to a torque curve."""

    peak: float  # N m
    residual: float  # N m, rms


def fit_sine(curve: StationCurve) -> SineFit:
    """Return the least-squares fit over all measured angles."""
    measured = np.isfinite(curve.torque)
    angle, torque = curve.angle[measured], curve.torque[measured]
    basis = np.column_stack([np.sin(2.0 * angle), np.ones(len(angle))])
    coefficients, *_ = np.linalg.lstsq(basis, torque, rcond=None)
    residual = torque - basis @ coefficients
    return SineFit(float(coefficients[0]), float(np.sqrt(np.mean(residual * residual))))


class ForceReversal(NamedTuple):
    """Angles (rad) on both sides of balance at which the stator's force changes sign; NaN: none."""

    below: float
    above: float

    @property
    def nearest(self) -> float:
        """The smaller distance from balance, rad; infinite if the force does not reverse."""
        return float(np.nanmin([-self.below, self.above, math.inf]))


def find_reversal(curve: StationCurve) -> ForceReversal:
    """Return where the stator's force first has the opposite sign of balance in two bins."""
    measured = np.isfinite(curve.stator)
    angle, force = curve.angle[measured], curve.stator[measured]
    near = np.abs(angle) <= 0.5 * SMALL_HALF_ANGLE
    if not near.any():
        return ForceReversal(math.nan, math.nan)
    normalised = force * math.copysign(1.0, float(force[near].mean()))
    return ForceReversal(
        -_sign_change(-angle[angle < 0.0][::-1], normalised[angle < 0.0][::-1]),
        _sign_change(angle[angle >= 0.0], normalised[angle >= 0.0]),
    )


def _sign_change(angle: Floats, normalised: Floats) -> float:
    """Return the angle where a force that starts above zero falls below it for two bins or more."""
    below = normalised < 0.0
    starts = np.flatnonzero(below[:-1] & below[1:])
    if not len(starts) or starts[0] == 0:
        return math.nan
    i = int(starts[0])
    share = normalised[i - 1] / (normalised[i - 1] - normalised[i])
    return float(angle[i - 1] + share * (angle[i] - angle[i - 1]))
