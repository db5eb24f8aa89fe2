"""Quarters of a sinusoidal command, split by its own phase: rising and falling, of either sign.

Fits choose their domains in them (OSWEC thesis, Figs. 3.1 and 3.5: by hand and in rectangles; here
by rule).
"""

from typing import NamedTuple

import numpy as np

from rig.kinds.oswec_bench.products import periods
from rig.kinds.oswec_bench.products.estimate import Floats
from rig.kinds.oswec_bench.products.linear_fit import Line, fit_line
from rig.kinds.oswec_bench.products.periods import PeriodCut


class Quarter(NamedTuple):
    """A quarter of one oscillation."""

    half: int  # index of the half wave (zero, peak, zero), from 0
    sign: int  # of the command: 1, -1
    growing: bool  # the magnitude grows
    samples: slice  # in signals cut to their whole periods


class FitDomain(NamedTuple):
    """The part of a quarter to which a line was fitted."""

    quarter: Quarter
    samples: slice
    line: Line


def split_quarters(command: Floats, cut: PeriodCut) -> list[Quarter]:
    """Return every whole quarter of a command that is cut to its periods, in the order of time."""
    fundamental = periods.fundamentals(command, cut).mean()
    if not abs(fundamental) > 1e-9:
        return []
    quarter_samples = cut.period / cut.dt / 4.0
    # The command is a cosine of phase angle(turn): maxima where it is 0, a quarter every pi / 2.
    first = -float(np.angle(fundamental)) / (0.5 * np.pi)
    begin = int(np.ceil(-first - 1e-6))
    result = []
    for k in range(begin, begin + 4 * cut.period_count + 1):
        low, high = round((first + k) * quarter_samples), round((first + k + 1) * quarter_samples)
        if low < 0 or high > len(command):
            continue
        sign, growing = ((1, False), (-1, True), (-1, False), (1, True))[k % 4]
        result.append(Quarter((k + 1) // 2, sign, growing, slice(low, high)))
    return result


def fit_domain(
    quarter: Quarter,
    command: Floats,
    response: Floats,
    *,
    criterion: Floats,
    low: float,
    high: float,
) -> FitDomain | None:
    """Return the line of response over command where ``criterion`` lies between shares of its peak.

    ``criterion`` (a signal like the others) is multiplied by the quarter's sign; its first and last
    sample between the shares bound the domain. The result is None if fewer than ten samples remain.
    """
    samples = quarter.samples
    magnitude = quarter.sign * criterion[samples]
    top = magnitude.max()
    inside = np.flatnonzero((magnitude >= low * top) & (magnitude <= high * top))
    if len(inside) < 10 or top <= 0.0:
        return None
    domain_samples = slice(samples.start + int(inside[0]), samples.start + int(inside[-1]) + 1)
    x = command[domain_samples]
    if not np.ptp(x) > 0.0:
        return None
    return FitDomain(quarter, domain_samples, fit_line(x, response[domain_samples]))
