"""One stator position: what the cells read over rotor angle, going up and going down.

Samples are averaged in bins of angle, each direction by itself; half the sum of the two is the
spring, half their difference is what rubs. No filter is needed, and none shifts the curve.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats

Floats = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]

FIT = math.pi / 4.0 - 0.1
"""Half the window of the rate's line of best fit, rad: 39.27 deg (public fbWecCntrl repository,
magSpringMapping.m)."""

SMALL = math.radians(10.0)
"""Half the window of the small-displacement rate, rad."""

_BINS = 40  # from balance to the end of the fit window
WIDTH = FIT / _BINS
"""Width of a bin, rad: about a degree, and the fit window holds whole bins."""

_LEAST = 3  # samples that make a bin
_CONFIDENCE = 0.95


class Samples(NamedTuple):
    """Ticks of one stator position, all of one length, with zeros taken off."""

    angle: Floats  # rad, of the rotor from its balance
    upwards: Whole  # 1 up, -1 down, 0 turning round
    torque: Floats  # N m, restoring at a positive angle
    column: Floats  # N, column load cell: force on the body
    stator: Floats  # N, both cells of the stator together


class Curve(NamedTuple):
    """What one station gave over angle, NaN where the hoist did not go both ways."""

    bins: Whole  # numbers of the bins: bin i holds angles i .. i + 1 times WIDTH
    angle: Floats  # rad, mean in the bin
    torque: Floats
    column: Floats
    stator: Floats
    friction: Floats  # N, half of what the column cell reads less going up than going down


class Line(NamedTuple):
    """A slope with its 95 % interval from the scatter of whole passes."""

    slope: float
    interval: float  # either way; NaN for fewer than two whole passes
    passes: int


def middle(index: Whole) -> Floats:
    """Angle in the middle of bins, rad."""
    return np.asarray((index + 0.5) * WIDTH)


def curve(samples: Samples) -> Curve:
    """The means of both directions."""
    every = np.floor(samples.angle / WIDTH).astype(np.int64)
    index = np.arange(every.min(), every.max() + 1)
    up, down = (_means(samples, every - index[0], len(index), way) for way in (1, -1))
    angle, torque, column, stator = (0.5 * (a + b) for a, b in zip(up, down, strict=True))
    return Curve(index, angle, torque, column, stator, 0.5 * (down[2] - up[2]))


def _means(samples: Samples, bins: Whole, count: int, way: int) -> tuple[Floats, ...]:
    """Mean angle, torque, column and stator force of each bin in one direction."""
    going = samples.upwards == way
    inside = bins[going]
    number = np.bincount(inside, minlength=count)
    enough = np.where(number >= _LEAST, number, np.nan)
    fields = (samples.angle, samples.torque, samples.column, samples.stator)
    return tuple(
        np.asarray(np.bincount(inside, values[going], minlength=count) / enough)
        for values in fields
    )


def rate_line(samples: Samples, found: Curve, values: Floats, each: Floats) -> Line:
    """Slope of a field over angle in the fit window, and how much single passes differ in it.

    ``values`` is the field by bin, ``each`` by sample. NaN where a bin of the window is empty.
    """
    every = (_pass_slope(samples, each, begin, end) for begin, end in _passes(samples))
    slopes = [slope for slope in every if not math.isnan(slope)]
    count, spread = len(slopes), math.nan
    if count > 1:
        quantile = float(stats.t.ppf(0.5 + 0.5 * _CONFIDENCE, count - 1))
        spread = quantile * float(np.std(slopes, ddof=1)) / math.sqrt(count)
    return Line(slope_within(found, values, FIT), spread, count)


def slope_within(found: Curve, values: Floats, half: float) -> float:
    """Least-squares slope over the bins within ``half`` rad; NaN where one of them is empty."""
    inside = np.abs(middle(found.bins)) < half
    angle, value = found.angle[inside], values[inside]
    wanted = 2 * round(half / WIDTH)
    if len(angle) < wanted or not np.isfinite(value).all():
        return math.nan
    return _slope(angle, value)


def _slope(angle: Floats, value: Floats) -> float:
    centred = angle - angle.mean()
    return float(centred @ value / (centred @ centred))


def _passes(samples: Samples) -> list[tuple[int, int]]:
    """Index ranges in which the hoist kept its direction."""
    way = samples.upwards
    edges = [0, *(np.flatnonzero(np.diff(way)) + 1).tolist(), len(way)]
    return [(begin, end) for begin, end in pairwise(edges) if way[begin] != 0]


def _pass_slope(samples: Samples, each: Floats, begin: int, end: int) -> float:
    """Slope of one pass, bins weighted alike; NaN if it does not lead through the whole window."""
    angle, value = samples.angle[begin:end], each[begin:end]
    inside = np.abs(angle) < FIT
    bins = np.floor(angle[inside] / WIDTH).astype(np.int64) + _BINS
    number = np.bincount(bins, minlength=2 * _BINS)
    if len(number) > 2 * _BINS or (number < _LEAST).any():
        return math.nan
    means = (np.bincount(bins, field[inside]) / number for field in (angle, value))
    return _slope(*means)


class Sine(NamedTuple):
    """The law T = Tp sin 2 theta + T0 through a torque curve."""

    peak: float  # N m
    departure: float  # N m, rms of what the law leaves


def sine(found: Curve) -> Sine:
    """Least squares over all angles that were reached."""
    there = np.isfinite(found.torque)
    angle, torque = found.angle[there], found.torque[there]
    basis = np.column_stack([np.sin(2.0 * angle), np.ones(len(angle))])
    found_by, *_ = np.linalg.lstsq(basis, torque, rcond=None)
    left = torque - basis @ found_by
    return Sine(float(found_by[0]), float(np.sqrt(np.mean(left * left))))


class Reversal(NamedTuple):
    """Angles (rad) either side of balance at which the stator's force changes sign; NaN: not."""

    below: float
    above: float

    @property
    def nearest(self) -> float:
        """The lesser of the two, from balance; infinite where the force does not reverse."""
        return float(np.nanmin([-self.below, self.above, math.inf]))


def reversal(found: Curve) -> Reversal:
    """Where the stator's force first has the sign that it has not at balance, in two bins."""
    there = np.isfinite(found.stator)
    angle, force = found.angle[there], found.stator[there]
    near = np.abs(angle) <= 0.5 * SMALL
    if not near.any():
        return Reversal(math.nan, math.nan)
    held = force * math.copysign(1.0, float(force[near].mean()))
    return Reversal(
        -_crossing(-angle[angle < 0.0][::-1], held[angle < 0.0][::-1]),
        _crossing(angle[angle >= 0.0], held[angle >= 0.0]),
    )


def _crossing(angle: Floats, held: Floats) -> float:
    """Angle at which a force that begins above zero falls below it for two bins and more."""
    below = held < 0.0
    twice = np.flatnonzero(below[:-1] & below[1:])
    if not len(twice) or twice[0] == 0:
        return math.nan
    i = int(twice[0])
    share = held[i - 1] / (held[i - 1] - held[i])
    return float(angle[i - 1] + share * (angle[i] - angle[i - 1]))
