"""Signals common to two recorders: the rising edge of a trigger (TTL), and a sine.

The phase of a sine is estimated cycle by cycle: each whole cycle gives one phase by least squares
of a cos + b sin + c. Its standard error for white noise, a signal-to-noise ratio S (power) and n
samples per cycle is 1 / sqrt(n S) radians at any amplitude.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import fft

from rig.recording.channel_file import Floats

MIN_SAMPLES = 5  # of a cycle that is fitted with three coefficients
_PEAK_HALF_WIDTH = 0.15  # s, either side of the best lag, of the polynomial through the peak


class Edge(NamedTuple):
    """The first rise of a trigger."""

    time: float  # s, middle of the sampling step in which it rose
    error: float  # s, standard error: the step divided by sqrt(12)
    rises: int  # number of rises in the whole record


class PhaseTrack(NamedTuple):
    """Phase of a sine, cycle by cycle."""

    time: Floats  # s, middle of each cycle, on the clock of its samples
    phase: Floats  # rad, of sin(2 pi f t + phase) on that clock, unwrapped
    frequency: float  # Hz, f
    snr_db: float  # power of the sine over that of the residual; inf for a computed sine


def rising_edge(time: Floats, value: Floats) -> Edge | None:
    """Return the first rise through the middle of a trigger's two levels; None without a rise.

    The levels are the least and the greatest value. A rise goes from the lower 40 % to above 60 %.
    """
    finite = np.isfinite(value)
    time, value = time[finite], value[finite]
    if len(value) < 2 or float(np.ptp(value)) == 0.0:
        return None
    relative = (value - value.min()) / np.ptp(value)
    level = np.where(relative > 0.6, 1, np.where(relative < 0.4, -1, 0))
    decided = np.flatnonzero(level)
    rises = decided[1:][(level[decided[1:]] == 1) & (level[decided[:-1]] == -1)]
    if rises.size == 0:
        return None
    i = int(rises[0])
    step = float(time[i] - time[i - 1])
    return Edge(float(time[i]) - 0.5 * step, step / 12.0**0.5, int(rises.size))


def ideal_sine(frequency: float) -> PhaseTrack:
    """Return the track of sin(2 pi f t), generated from the clock itself: zero phase, no noise."""
    return PhaseTrack(np.zeros(1), np.zeros(1), frequency, float("inf"))


def phase_track(time: Floats, value: Floats, frequency: float) -> PhaseTrack | None:
    """Return the phase of a sine near ``frequency`` (Hz); None for fewer than three cycles.

    Non-finite samples and cycles with fewer than five samples are left out.
    """
    finite = np.isfinite(value)
    time, value = time[finite], value[finite]
    if len(time) == 0:
        return None
    cycle = np.floor((time - time[0]) * frequency + 1e-6).astype(np.int64)
    starts = np.flatnonzero(np.diff(cycle, prepend=-1))
    count = np.diff(starts, append=len(time))
    median_count = float(np.median(count))
    complete = (count > 0.9 * median_count) & (count >= MIN_SAMPLES)
    if int(complete.sum()) < 3:
        return None
    angle = 2.0 * np.pi * frequency * time
    basis = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)])
    normal = np.empty((len(starts), 3, 3))
    for i in range(3):
        for j in range(i + 1):
            normal[:, i, j] = normal[:, j, i] = np.add.reduceat(basis[i] * basis[j], starts)
    right = np.stack([np.add.reduceat(row * value, starts) for row in basis], axis=1)
    coefficients = np.linalg.solve(normal[complete], right[complete][..., None])[..., 0]
    a, b = coefficients[:, 0], coefficients[:, 1]
    middle = np.add.reduceat(time, starts)[complete] / count[complete]
    square = np.add.reduceat(value * value, starts)[complete]
    residual = float((square - np.einsum("ki,ki->k", coefficients, right[complete])).sum())
    degrees_of_freedom = float(count[complete].sum() - 3 * complete.sum())
    noise = max(residual, 0.0) / degrees_of_freedom if degrees_of_freedom > 0.0 else float("nan")
    power = float(np.mean(0.5 * (a * a + b * b)))
    with np.errstate(divide="ignore", invalid="ignore"):
        snr = float(10.0 * np.log10(np.float64(power) / noise))
    return PhaseTrack(middle, np.unwrap(np.arctan2(a, b)), frequency, snr)


def correlation_lag(
    time: Floats, value: Floats, reference: Floats, max_lag: float
) -> tuple[float, float]:
    """Return the lag (s) by which ``value`` trails ``reference``, and the correlation there.

    Both signals are sampled at the evenly spaced ``time``. The lag maximises the cross-correlation
    over the whole record, within +-``max_lag`` s.
    """
    step = float(time[-1] - time[0]) / (len(time) - 1)
    reach = min(round(max_lag / step), len(time) // 2 - 1)
    a, b = value - value.mean(), reference - reference.mean()
    inner = slice(reach, len(a) - reach)  # every lag then uses the same number of samples
    inner_reference = np.zeros_like(b)
    inner_reference[inner] = b[inner]
    fft_length = fft.next_fast_len(len(a), real=True)
    correlation = fft.irfft(
        fft.rfft(a, fft_length) * np.conj(fft.rfft(inner_reference, fft_length)), fft_length
    )
    lags: npt.NDArray[np.int64] = np.arange(-reach, reach + 1)
    energy = np.concatenate([[0.0], np.cumsum(a * a)])
    # Energy of a where b overlaps it.
    overlap_energy = energy[len(a) - reach + lags] - energy[reach + lags]
    norm = float(np.linalg.norm(b[inner])) * np.sqrt(np.maximum(overlap_energy, 0.0))
    coefficient = correlation[lags] / np.where(norm > 0.0, norm, np.inf)
    best = int(np.argmax(coefficient))
    lag_times = np.asarray(lags * step, dtype=np.float64)
    return _peak_lag(lag_times, coefficient, best, round(_PEAK_HALF_WIDTH / step)), float(
        coefficient[best]
    )


def _peak_lag(lag: Floats, coefficient: Floats, best: int, reach: int) -> float:
    """Return the lag at the peak of a polynomial through the points around the best sample.

    The fit takes many points, because noise moves the best sample by far more than a step.
    """
    window = slice(max(best - reach, 0), best + reach + 1)
    if len(lag[window]) < 6:
        return float(lag[best])
    middle, half = float(lag[window].mean()), 0.5 * float(np.ptp(lag[window]))
    curve = np.polynomial.Polynomial.fit((lag[window] - middle) / half, coefficient[window], 4)
    stationary = curve.deriv().roots()
    peaks = stationary[np.abs(stationary.imag) < 1e-9].real
    peaks = peaks[np.abs(peaks) <= 1.0]
    if peaks.size == 0:
        return float(lag[best])
    return middle + half * float(peaks[np.argmax(curve(peaks))])
