"""Multisines: periodic signals of chosen lines and random phases, for seas and for references.

Line k has the frequency k/repeat, so the signal repeats exactly. Phases are drawn at random as
often as asked and the draw of least peak-to-peak value is kept, which buys the most signal for a
given peak (the method of the public fbWecCntrl repository, genMultiSine). A seed and a number of
the realisation name the phases for good: other realisations of one seed are as independent as
those of other seeds.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

MOST_DRAWS = 1000
"""Most draws of phases to choose from."""

_PER_PERIOD = 32  # samples of the fastest line when a peak is looked for: 0.5 % of it at most
_SLACK = 1e-9  # a line that misses the band by rounding alone is in it


class Multisine(NamedTuple):
    """The signal sum of amplitude cos(2 pi cycles t / repeat + phase), amplitudes in its unit."""

    repeat: float  # s
    cycles: npt.NDArray[np.int64]  # whole periods of each line in a repeat period
    amplitude: Floats
    phase: Floats  # rad, 0 .. 2 pi


def lines(low_hz: float, high_hz: float, repeat_s: float) -> range:
    """Whole periods of the lines k/repeat from ``low_hz`` to ``high_hz``, both ends in it."""
    first = math.ceil(low_hz * repeat_s * (1.0 - _SLACK))
    return range(max(first, 1), math.floor(high_hz * repeat_s * (1.0 + _SLACK)) + 1)


Cycles = npt.NDArray[np.int64]


def odd_lines(cycles: Cycles) -> Cycles:
    """The odd ones: what answers on an even line is an even nonlinearity."""
    odd: Cycles = cycles[cycles % 2 == 1]
    return odd


def some_odd_lines(seed: int) -> Callable[[Cycles], Cycles]:
    """Odd lines less one of each four in turn, drawn by ``seed``: what answers there is odd.

    The lines left out are the same in all realisations. Source: Pintelon & Schoukens, System
    Identification (2nd ed.), section 4.3, random harmonic grid.
    """

    def choose(cycles: Cycles) -> Cycles:
        odd = odd_lines(cycles)
        left = np.random.default_rng([seed, 0, 1]).integers(0, 4, odd.size // 4 + 1)
        place = np.arange(odd.size)
        kept: Cycles = odd[left[place // 4] != place % 4]
        return kept

    return choose


def design(
    low_hz: float,
    high_hz: float,
    repeat_s: float,
    *,
    rms: float,
    exponent: float = 0.0,
    seed: int,
    realisation: int = 1,
    draws: int = 1,
    choose: Callable[[Cycles], Cycles] | None = None,
) -> Multisine:
    """A multisine on the lines of a band with amplitudes proportional to f^exponent.

    ``exponent``: 0 is flat, -0.5 pink. ``rms`` is that of the signal, in its unit. Of ``draws``
    sets of random phases the one of least peak-to-peak value is kept. ``choose`` picks some of the
    lines; all of them without it.
    Raises ValueError for a band without a line, rms < 0, or draws outside 1 .. 1000.
    """
    cycles = np.array(lines(low_hz, high_hz, repeat_s), dtype=np.int64)
    cycles = cycles if choose is None else choose(cycles)
    if cycles.size == 0:
        raise ValueError(
            f"no multiple of 1/{repeat_s:g} Hz lies between {low_hz:g} and {high_hz:g} Hz"
        )
    if not (math.isfinite(rms) and rms >= 0.0):
        raise ValueError(f"rms must be a finite number >= 0, not {rms}")
    if not 1 <= draws <= MOST_DRAWS:
        raise ValueError(f"draws must be 1 .. {MOST_DRAWS}, not {draws}")
    shape = (cycles / repeat_s) ** exponent
    amplitude = shape * (rms / np.sqrt(0.5 * np.sum(shape * shape)))
    random = np.random.default_rng([seed, realisation])
    phases = random.uniform(0.0, 2.0 * np.pi, (draws, cycles.size))
    best = 0
    if draws > 1:
        spans = [_span(Multisine(repeat_s, cycles, amplitude, phase)) for phase in phases]
        best = int(np.argmin(spans))
    return Multisine(repeat_s, cycles, amplitude, phases[best])


def series(signal: Multisine, count: int) -> Floats:
    """One repeat period in ``count`` even samples from t = 0; the next period is the same.

    Raises ValueError for fewer than two samples a period of the fastest line.
    """
    if 2 * int(signal.cycles[-1]) >= count:
        raise ValueError(f"{count} samples cannot show {signal.cycles[-1]} periods")
    bins = np.zeros(count // 2 + 1, dtype=np.complex128)
    bins[signal.cycles] = 0.5 * count * signal.amplitude * np.exp(1j * signal.phase)
    return np.fft.irfft(bins, count)


def peak(signal: Multisine) -> float:
    """Greatest magnitude, in the signal's unit, found on 32 samples of the fastest period."""
    return float(np.abs(_fine(signal)).max())


def scaled_to_peak(signal: Multisine, most: float) -> Multisine:
    """The same signal with ``most`` as its greatest magnitude (as current amplitudes are given)."""
    factor = most / peak(signal)
    return Multisine(signal.repeat, signal.cycles, factor * signal.amplitude, signal.phase)


def _fine(signal: Multisine) -> Floats:
    wanted = _PER_PERIOD * int(signal.cycles[-1])
    return series(signal, 1 << math.ceil(math.log2(wanted)))


def _span(signal: Multisine) -> float:
    return float(np.ptp(_fine(signal)))
