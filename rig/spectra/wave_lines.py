"""Fourier coefficients of a repeating wave by period, from even or uneven samples.

Line k of a wave with repeat period T is A cos(2 pi k t / T + phase), t on the wave clock. Whole
periods of even samples use an FFT, which is exact. A period with missing samples (a lost tick, a
late probe) uses least squares on the same lines, which has no leakage between them.
"""

from collections.abc import Container
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from rig.spectra.periods import Complexes, Floats

MIN_SAMPLE_SHARE = 0.9  # of the samples of a period; a period with fewer is not used
_EVEN_TOLERANCE = 1e-3  # of a sample step; time stamps within it are even


class Samples(NamedTuple):
    """Samples of a probe with their times."""

    time: Floats  # s of the wave clock, increasing
    value: Floats  # m


class LineEstimates(NamedTuple):
    """Line coefficients of a wave: mean over periods with its standard error."""

    mean: Complexes  # m, by line: amplitude * exp(1j * phase)
    standard_error: Floats  # m, of the mean's amplitude; NaN for a single period
    periods: Complexes  # m, by period and line


def sample_step(samples: Samples) -> float:
    """Return the median time between two samples, s."""
    return float(np.median(np.diff(samples.time)))


def finite_samples(samples: Samples) -> Samples:
    """Return the samples with a finite value."""
    valid = np.isfinite(samples.value)
    return Samples(samples.time[valid], samples.value[valid])


def period_edges(samples: Samples, repeat: float, start: float) -> Floats:
    """Return the edges (s) of the whole periods of length ``repeat`` (s) from ``start`` on.

    An edge lies half a step before the first sample of a period. The last period must contain 90 %
    of its samples.
    """
    if len(samples.time) < 2:
        return np.empty(0)
    step = sample_step(samples)
    count = int(np.floor((samples.time[-1] + step - start) / repeat + 1.0 - MIN_SAMPLE_SHARE))
    return np.asarray(start - 0.5 * step + repeat * np.arange(count + 1), np.float64)


def split_periods(
    samples: Samples, repeat: float, start: float, skip: Container[int] = ()
) -> list[Samples]:
    """Return the samples of each whole period (s) from ``start`` (s of the wave clock) on.

    Periods with fewer than 90 % of their samples are left out, and those whose number is in
    ``skip``. Samples that are not finite count as missing.
    """
    time, value = valid = finite_samples(samples)
    edges = np.searchsorted(time, period_edges(valid, repeat, start))
    periods = [
        Samples(time[a:b], value[a:b]) for i, (a, b) in enumerate(pairwise(edges)) if i not in skip
    ]
    min_samples = MIN_SAMPLE_SHARE * repeat / sample_step(valid) if periods else 0.0
    return [piece for piece in periods if len(piece.time) >= min_samples]


def line_coefficients(period: Samples, repeat: float, cycles: Any) -> Complexes:
    """Return the coefficient (m) of each line from the samples of one period.

    Raises ValueError for fewer samples than the lines need.
    """
    count = len(period.time)
    if count <= 2 * int(np.max(cycles)) or count <= 2 * len(cycles):
        most = np.max(cycles)
        raise ValueError(f"{count} samples per period cannot resolve {most} cycles of a wave")
    step = repeat / count
    even = period.time[0] + step * np.arange(count)
    if float(np.abs(period.time - even).max()) < _EVEN_TOLERANCE * step:
        spectrum = np.fft.rfft(period.value)[cycles] * (2.0 / count)
        rotation = np.exp(-2j * np.pi * np.asarray(cycles) * period.time[0] / repeat)
        return np.asarray(spectrum * rotation, dtype=np.complex128)
    angle = 2.0 * np.pi / repeat * np.outer(period.time, cycles)
    design = np.hstack([np.cos(angle), -np.sin(angle), np.ones((count, 1))])
    solution = np.linalg.solve(design.T @ design, design.T @ period.value)
    return np.asarray(
        solution[: len(cycles)] + 1j * solution[len(cycles) : -1], dtype=np.complex128
    )


def estimate_lines(periods: list[Samples], repeat: float, cycles: Any) -> LineEstimates:
    """Return the mean coefficients over periods; the error is scatter / sqrt(number of periods).

    The scatter is pooled over real and imaginary part: 2 (periods - 1) degrees of freedom per line.
    Raises ValueError without a period.
    """
    if not periods:
        raise ValueError("no whole period was measured")
    by_period = np.array([line_coefficients(piece, repeat, cycles) for piece in periods])
    mean = by_period.mean(axis=0)
    count = len(by_period)
    if count < 2:
        return LineEstimates(mean, np.full(mean.size, np.nan), by_period)
    spread = np.sum(np.abs(by_period - mean) ** 2, axis=0) / (2.0 * (count - 1))
    return LineEstimates(mean, np.sqrt(spread / count), by_period)


def mean_period(periods: list[Samples], repeat: float, count: int) -> tuple[Floats, Floats]:
    """Return mean elevation and standard error (m) in ``count`` equal bins of the repeat period.

    Bin i is centred on the wave clock time i * repeat / count, modulo the period. A bin without a
    sample is NaN; the error of a bin with a single sample is NaN.
    """
    bin_index = np.concatenate([np.round(piece.time / repeat * count) for piece in periods])
    index = bin_index.astype(np.int64) % count
    value = np.concatenate([piece.value for piece in periods])
    samples_per_bin = np.bincount(index, minlength=count)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(index, value, minlength=count) / samples_per_bin
        square = np.bincount(index, (value - mean[index]) ** 2, minlength=count)
        error = np.sqrt(square / (samples_per_bin - 1) / samples_per_bin)
    return mean, np.where(samples_per_bin > 1, error, np.nan)


def significant_height(amplitude: Any) -> float:
    """Return Hm0 = 4 sqrt(m0) (m) of line amplitudes (m)."""
    return float(4.0 * np.sqrt(0.5 * np.sum(np.abs(amplitude) ** 2)))
