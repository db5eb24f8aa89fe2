"""What two recorders have in common: the rising edge of a trigger (TTL), and a sine.

A sine is followed cycle by cycle: each whole cycle gives one phase by least squares of
a cos + b sin + c. Its error for a white noise of a signal-to-noise ratio S (power) with n samples
a cycle is 1 / sqrt(n S) radians, whatever the amplitude.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import fft

from rig.interop.basin.recording import Floats

LEAST_SAMPLES = 5  # of a cycle, for three coefficients
_AROUND = 0.15  # s, either side of a correlation's best lag, over which its top is looked for


class Edge(NamedTuple):
    """The first rise of a trigger."""

    time: float  # s, middle of the sample step in which it rose
    error: float  # s, standard error: the step over sqrt(12)
    rises: int  # in the whole record


class Track(NamedTuple):
    """Phase of a sine, cycle by cycle."""

    time: Floats  # s, middle of each cycle, on the clock of its samples
    phase: Floats  # rad, of sin(2 pi f t + phase) on that clock, unwrapped
    frequency: float  # Hz, f
    snr_db: float  # power of the sine over that of what is left; inf for a sine that was computed


def rising_edge(time: Floats, value: Floats) -> Edge | None:
    """The first rise through the middle of a trigger's two levels; None if there is none.

    The levels are its least and greatest value. A rise counts from the lower 40 % to above 60 %.
    """
    good = np.isfinite(value)
    time, value = time[good], value[good]
    if len(value) < 2 or float(np.ptp(value)) == 0.0:
        return None
    share = (value - value.min()) / np.ptp(value)
    level = np.where(share > 0.6, 1, np.where(share < 0.4, -1, 0))
    clear = np.flatnonzero(level)
    rises = clear[1:][(level[clear[1:]] == 1) & (level[clear[:-1]] == -1)]
    if rises.size == 0:
        return None
    i = int(rises[0])
    step = float(time[i] - time[i - 1])
    return Edge(float(time[i]) - 0.5 * step, step / 12.0**0.5, int(rises.size))


def computed(frequency: float) -> Track:
    """The sine sin(2 pi f t) that whoever keeps the clock makes from the clock itself."""
    return Track(np.zeros(1), np.zeros(1), frequency, float("inf"))


def phase_track(time: Floats, value: Floats, frequency: float) -> Track | None:
    """The phase of a sine near ``frequency`` (Hz) in samples; None for less than three cycles.

    Samples that are not finite are left out, cycles with fewer than five samples too.
    """
    good = np.isfinite(value)
    time, value = time[good], value[good]
    if len(time) == 0:
        return None
    cycle = np.floor((time - time[0]) * frequency + 1e-6).astype(np.int64)
    starts = np.flatnonzero(np.diff(cycle, prepend=-1))
    count = np.diff(starts, append=len(time))
    usual = float(np.median(count))
    whole = (count > 0.9 * usual) & (count >= LEAST_SAMPLES)
    if int(whole.sum()) < 3:
        return None
    angle = 2.0 * np.pi * frequency * time
    basis = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)])
    normal = np.empty((len(starts), 3, 3))
    for i in range(3):
        for j in range(i + 1):
            normal[:, i, j] = normal[:, j, i] = np.add.reduceat(basis[i] * basis[j], starts)
    right = np.stack([np.add.reduceat(row * value, starts) for row in basis], axis=1)
    found = np.linalg.solve(normal[whole], right[whole][..., None])[..., 0]
    a, b = found[:, 0], found[:, 1]
    middle = np.add.reduceat(time, starts)[whole] / count[whole]
    square = np.add.reduceat(value * value, starts)[whole]
    left = float((square - np.einsum("ki,ki->k", found, right[whole])).sum())
    free = float(count[whole].sum() - 3 * whole.sum())
    noise = max(left, 0.0) / free if free > 0.0 else float("nan")
    power = float(np.mean(0.5 * (a * a + b * b)))
    with np.errstate(divide="ignore", invalid="ignore"):
        snr = float(10.0 * np.log10(np.float64(power) / noise))
    return Track(middle, np.unwrap(np.arctan2(a, b)), frequency, snr)


def correlation_lag(
    time: Floats, value: Floats, reference: Floats, most: float
) -> tuple[float, float]:
    """The one lag (s) by which ``value`` trails ``reference``, both at the even ``time``.

    It is where their cross-correlation over the whole record is greatest, within +-``most`` s;
    with it comes the coefficient there.
    """
    step = float(time[-1] - time[0]) / (len(time) - 1)
    reach = min(round(most / step), len(time) // 2 - 1)
    a, b = value - value.mean(), reference - reference.mean()
    inner = slice(reach, len(a) - reach)  # so that every lag is made of equally many samples
    alone = np.zeros_like(b)
    alone[inner] = b[inner]
    room = fft.next_fast_len(len(a), real=True)
    whole = fft.irfft(fft.rfft(a, room) * np.conj(fft.rfft(alone, room)), room)
    lags: npt.NDArray[np.int64] = np.arange(-reach, reach + 1)
    energy = np.concatenate([[0.0], np.cumsum(a * a)])
    under = energy[len(a) - reach + lags] - energy[reach + lags]  # of a, where b lies over it
    size = float(np.linalg.norm(b[inner])) * np.sqrt(np.maximum(under, 0.0))
    alike = whole[lags] / np.where(size > 0.0, size, np.inf)
    best = int(np.argmax(alike))
    at = np.asarray(lags * step, dtype=np.float64)
    return _top(at, alike, best, round(_AROUND / step)), float(alike[best])


def _top(lag: Floats, alike: Floats, best: int, reach: int) -> float:
    """The lag of the highest point of a polynomial through what lies around the best sample.

    Of many points, because noise moves the best sample by far more than a step.
    """
    near = slice(max(best - reach, 0), best + reach + 1)
    if len(lag[near]) < 6:
        return float(lag[best])
    middle, half = float(lag[near].mean()), 0.5 * float(np.ptp(lag[near]))
    curve = np.polynomial.Polynomial.fit((lag[near] - middle) / half, alike[near], 4)
    flat = curve.deriv().roots()
    tops = flat[np.abs(flat.imag) < 1e-9].real
    tops = tops[np.abs(tops) <= 1.0]
    if tops.size == 0:
        return float(lag[best])
    return middle + half * float(tops[np.argmax(curve(tops))])
