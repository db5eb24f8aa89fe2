"""Fourier coefficients of a repeating wave, period by period, from even or uneven samples.

A line k of a wave that repeats after T is A cos(2 pi k t / T + phase), t on the wave clock. Whole
periods of even samples go through an FFT, which is exact; a period with missing samples (a lost
tick, a late probe) through least squares on the same lines, which leaves no leakage between them.
"""

from collections.abc import Container
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]

LEAST_SHARE = 0.9  # of a period's samples: with fewer the period is not used
_EVEN = 1e-3  # of a sample step: time stamps that differ by less are even


class Samples(NamedTuple):
    """What a probe saw: values and when each was taken."""

    time: Floats  # s of the wave clock, rising
    value: Floats  # m


class Lines(NamedTuple):
    """The coefficients of a wave: mean over periods and what the periods say of its error."""

    mean: Complexes  # m, by line: amplitude exp(1j phase)
    standard_error: Floats  # m, of the mean's amplitude; NaN for a single period
    periods: Complexes  # m, by period and line


def steps(samples: Samples) -> float:
    """The usual time between two samples, s."""
    return float(np.median(np.diff(samples.time)))


def finite(samples: Samples) -> Samples:
    """The samples without those that are not finite."""
    good = np.isfinite(samples.value)
    return Samples(samples.time[good], samples.value[good])


def period_edges(samples: Samples, repeat: float, start: float) -> Floats:
    """Where each whole period (s) from ``start`` on begins, and the last one ends, s.

    Half a step before its first sample; of the last one 90 % have to be there.
    """
    if len(samples.time) < 2:
        return np.empty(0)
    step = steps(samples)
    count = int(np.floor((samples.time[-1] + step - start) / repeat + 1.0 - LEAST_SHARE))
    return np.asarray(start - 0.5 * step + repeat * np.arange(count + 1), np.float64)


def by_period(
    samples: Samples, repeat: float, start: float, without: Container[int] = ()
) -> list[Samples]:
    """The samples of each whole period (s) from ``start`` (s of the wave clock) on.

    Periods that hold fewer than 90 % of their samples are left out, as are those whose number is
    in ``without``; samples that are not finite count as missing.
    """
    time, value = there = finite(samples)
    edges = np.searchsorted(time, period_edges(there, repeat, start))
    pieces = [
        Samples(time[a:b], value[a:b])
        for i, (a, b) in enumerate(pairwise(edges))
        if i not in without
    ]
    least = LEAST_SHARE * repeat / steps(there) if pieces else 0.0
    return [piece for piece in pieces if len(piece.time) >= least]


def coefficients(piece: Samples, repeat: float, cycles: Any) -> Complexes:
    """Coefficient of each line in one period's samples, m.

    Raises ValueError for fewer samples than the lines need.
    """
    count = len(piece.time)
    if count <= 2 * int(np.max(cycles)) or count <= 2 * len(cycles):
        raise ValueError(f"{count} samples a period cannot show {np.max(cycles)} cycles of a wave")
    step = repeat / count
    even = piece.time[0] + step * np.arange(count)
    if float(np.abs(piece.time - even).max()) < _EVEN * step:
        found = np.fft.rfft(piece.value)[cycles] * (2.0 / count)
        turned = np.exp(-2j * np.pi * np.asarray(cycles) * piece.time[0] / repeat)
        return np.asarray(found * turned, dtype=np.complex128)
    angle = 2.0 * np.pi / repeat * np.outer(piece.time, cycles)
    design = np.hstack([np.cos(angle), -np.sin(angle), np.ones((count, 1))])
    solved = np.linalg.solve(design.T @ design, design.T @ piece.value)
    return np.asarray(solved[: len(cycles)] + 1j * solved[len(cycles) : -1], dtype=np.complex128)


def lines(pieces: list[Samples], repeat: float, cycles: Any) -> Lines:
    """Mean coefficients over periods; the error is their scatter over the root of their number.

    Scatter is pooled over real and imaginary part, 2 (periods - 1) degrees of freedom a line.
    Raises ValueError without a period.
    """
    if not pieces:
        raise ValueError("no whole period was measured")
    found = np.array([coefficients(piece, repeat, cycles) for piece in pieces])
    mean = found.mean(axis=0)
    count = len(found)
    if count < 2:
        return Lines(mean, np.full(mean.size, np.nan), found)
    spread = np.sum(np.abs(found - mean) ** 2, axis=0) / (2.0 * (count - 1))
    return Lines(mean, np.sqrt(spread / count), found)


def mean_period(pieces: list[Samples], repeat: float, count: int) -> tuple[Floats, Floats]:
    """Mean elevation and its standard error (m) over ``count`` even parts of a period.

    Part i is centred on wave clock times of i repeat/count modulo the period; NaN where no sample
    fell into it, and for the error where only one did.
    """
    part = np.concatenate([np.round(piece.time / repeat * count) for piece in pieces])
    index = part.astype(np.int64) % count
    value = np.concatenate([piece.value for piece in pieces])
    number = np.bincount(index, minlength=count)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(index, value, minlength=count) / number
        square = np.bincount(index, (value - mean[index]) ** 2, minlength=count)
        error = np.sqrt(square / (number - 1) / number)
    return mean, np.where(number > 1, error, np.nan)


def significant_height(amplitude: Any) -> float:
    """Hm0 = 4 sqrt(m0) of line amplitudes (m), m."""
    return float(4.0 * np.sqrt(0.5 * np.sum(np.abs(amplitude) ** 2)))
