"""The quarters of a sinusoidal command, told by its own phase: growing and falling, either sign.

Domains of fits are chosen in them (OSWEC thesis, Figs. 3.1 and 3.5: by hand and in rectangles;
here by rule).
"""

from typing import NamedTuple

import numpy as np

from rig.analysis.session import periods
from rig.analysis.session.estimate import Floats
from rig.analysis.session.linear_fit import Line, line
from rig.analysis.session.periods import Cut


class Quarter(NamedTuple):
    """A quarter of one oscillation."""

    half: int  # which half wave, from zero through its peak to zero; from 0
    sign: int  # of the command: 1, -1
    growing: bool  # its magnitude
    where: slice  # of the signals cut to their whole periods


class Domain(NamedTuple):
    """The part of a quarter that a line was fitted to."""

    quarter: Quarter
    where: slice
    fitted: Line


def quarters(command: Floats, of: Cut) -> list[Quarter]:
    """Every whole quarter of a command, cut to its periods, in the order of time."""
    turn = periods.fundamentals(command, of).mean()
    if not abs(turn) > 1e-9:
        return []
    per = of.period / of.dt / 4.0
    # The command is a cosine of phase angle(turn): maxima where it is 0, a quarter every pi / 2.
    first = -float(np.angle(turn)) / (0.5 * np.pi)
    begin = int(np.ceil(-first - 1e-6))
    out = []
    for k in range(begin, begin + 4 * of.whole + 1):
        low, high = round((first + k) * per), round((first + k + 1) * per)
        if low < 0 or high > len(command):
            continue
        sign, growing = ((1, False), (-1, True), (-1, False), (1, True))[k % 4]
        out.append(Quarter((k + 1) // 2, sign, growing, slice(low, high)))
    return out


def domain(
    quarter: Quarter, command: Floats, response: Floats, *, by: Floats, low: float, high: float
) -> Domain | None:
    """The line of response over command where ``by`` lies between shares of its largest value.

    ``by`` (a signal like the others) is taken along the quarter's sign; its first and last sample
    between the shares end the domain. None if fewer than ten samples remain.
    """
    at = quarter.where
    size = quarter.sign * by[at]
    top = size.max()
    inside = np.flatnonzero((size >= low * top) & (size <= high * top))
    if len(inside) < 10 or top <= 0.0:
        return None
    where = slice(at.start + int(inside[0]), at.start + int(inside[-1]) + 1)
    x = command[where]
    if not np.ptp(x) > 0.0:
        return None
    return Domain(quarter, where, line(x, response[where]))
