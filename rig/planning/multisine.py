"""Multisines: periodic signals of selected lines with random phases, for seas and references.

Line k has the frequency k/repeat, so the signal is exactly periodic. Of a given number of draws of
random phases, the one with the least peak-to-peak value is kept, which gives the most signal power
for a given peak (the method of the public fbWecCntrl repository, genMultiSine). Seed and
realisation number determine the phases: realisations of one seed are as independent of each other
as those of different seeds.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

MAX_DRAWS = 1000
"""Maximum number of draws of phases."""

_PER_PERIOD = 32  # samples per period of the fastest line: error of a peak at most 0.5 %
_SLACK = 1e-9  # relative; includes a line that is outside the band only by rounding


class Multisine(NamedTuple):
    """The signal sum of amplitude cos(2 pi cycles t / repeat + phase)."""

    repeat: float  # s
    cycles: npt.NDArray[np.int64]  # periods of each line per repeat period
    amplitude: Floats  # in the unit of the signal
    phase: Floats  # rad, 0 .. 2 pi


def line_range(low_hz: float, high_hz: float, repeat_s: float) -> range:
    """Return the numbers k of the lines k/repeat from ``low_hz`` to ``high_hz``, both inclusive."""
    first = math.ceil(low_hz * repeat_s * (1.0 - _SLACK))
    return range(max(first, 1), math.floor(high_hz * repeat_s * (1.0 + _SLACK)) + 1)


Cycles = npt.NDArray[np.int64]


def odd_lines(cycles: Cycles) -> Cycles:
    """Return the odd lines; a response on an even line is then an even nonlinearity."""
    odd: Cycles = cycles[cycles % 2 == 1]
    return odd


def random_odd_lines(seed: int) -> Callable[[Cycles], Cycles]:
    """Return a selector of odd lines that omits a random one of each four in turn.

    A response on an omitted odd line is an odd nonlinearity. The omitted lines depend on ``seed``
    and are the same in all realisations. Source: Pintelon & Schoukens, System Identification (2nd
    ed.), section 4.3, random harmonic grid.
    """

    def choose(cycles: Cycles) -> Cycles:
        odd = odd_lines(cycles)
        omitted = np.random.default_rng([seed, 0, 1]).integers(0, 4, odd.size // 4 + 1)
        index = np.arange(odd.size)
        selected: Cycles = odd[omitted[index // 4] != index % 4]
        return selected

    return choose


def design_multisine(
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
    """Return a multisine on the lines of a band with amplitudes proportional to f^exponent.

    ``exponent`` is 0 for a flat and -0.5 for a pink spectrum; ``rms`` is that of the signal, in
    its unit. Of ``draws`` sets of random phases, the one with the least peak-to-peak value is
    kept. ``choose`` selects lines of the band; None selects all.
    Raises ValueError for a band without a line, rms < 0, or draws outside 1 .. 1000.
    """
    cycles = np.array(line_range(low_hz, high_hz, repeat_s), dtype=np.int64)
    cycles = cycles if choose is None else choose(cycles)
    if cycles.size == 0:
        raise ValueError(
            f"no multiple of 1/{repeat_s:g} Hz lies between {low_hz:g} and {high_hz:g} Hz"
        )
    if not (math.isfinite(rms) and rms >= 0.0):
        raise ValueError(f"rms must be a finite number >= 0, not {rms}")
    if not 1 <= draws <= MAX_DRAWS:
        raise ValueError(f"draws must be 1 .. {MAX_DRAWS}, not {draws}")
    shape = (cycles / repeat_s) ** exponent
    amplitude = shape * (rms / np.sqrt(0.5 * np.sum(shape * shape)))
    random = np.random.default_rng([seed, realisation])
    phases = random.uniform(0.0, 2.0 * np.pi, (draws, cycles.size))
    best = 0
    if draws > 1:
        spans = [_peak_to_peak(Multisine(repeat_s, cycles, amplitude, phase)) for phase in phases]
        best = int(np.argmin(spans))
    return Multisine(repeat_s, cycles, amplitude, phases[best])


def draw_noise(low_hz: float, high_hz: float, repeat_s: float, seed: int) -> Multisine:
    """Return Gaussian noise of a band: cosine and sine of each line have normal amplitudes.

    Source: S. O. Rice, Mathematical Analysis of Random Noise, Bell System Technical Journal 23,
    1944, section 2.8.
    """
    cycles = np.array(line_range(low_hz, high_hz, repeat_s), np.int64)
    cosine, sine = np.random.default_rng([seed, 0, 2]).standard_normal((2, cycles.size))
    return Multisine(
        repeat_s, cycles, np.hypot(cosine, sine), np.mod(np.arctan2(-sine, cosine), 2.0 * np.pi)
    )


def one_period(signal: Multisine, count: int) -> Floats:
    """Return one repeat period as ``count`` equidistant samples from t = 0.

    Raises ValueError for fewer than two samples per period of the fastest line.
    """
    if 2 * int(signal.cycles[-1]) >= count:
        raise ValueError(f"{count} samples cannot show {signal.cycles[-1]} periods")
    bins = np.zeros(count // 2 + 1, dtype=np.complex128)
    bins[signal.cycles] = 0.5 * count * signal.amplitude * np.exp(1j * signal.phase)
    return np.fft.irfft(bins, count)


def peak(signal: Multisine) -> float:
    """Return the greatest magnitude, in the signal's unit, from 32 samples per fastest period."""
    return float(np.abs(_oversampled(signal)).max())


def scale_to_peak(signal: Multisine, magnitude: float) -> Multisine:
    """Return the signal scaled to a greatest magnitude, by which current amplitudes are given."""
    factor = magnitude / peak(signal)
    return Multisine(signal.repeat, signal.cycles, factor * signal.amplitude, signal.phase)


def _oversampled(signal: Multisine) -> Floats:
    count = _PER_PERIOD * int(signal.cycles[-1])
    return one_period(signal, 1 << math.ceil(math.log2(count)))


def _peak_to_peak(signal: Multisine) -> float:
    return float(np.ptp(_oversampled(signal)))
