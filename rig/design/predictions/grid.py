"""One repeat period of a sea as samples and as frequencies: where motion and force are compared.

A periodic record of N samples and its N/2 + 1 complex lines are one thing in two forms. Lines are
those of e^{+i omega t}, scaled as `numpy.fft.rfft` gives them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]

LEAST = 512  # samples of a period: a sine's drag and friction to 1e-4
RATE = 32.0  # Hz at least: the eighth harmonic of 2 Hz, above which nothing excites


class Grid(NamedTuple):
    """Samples and lines of one period."""

    period: float  # s
    samples: int  # even
    omega: Floats  # rad/s of each line, from 0 on

    @property
    def step(self) -> float:
        """Seconds between samples."""
        return self.period / self.samples


def grid(period: float, rate: float = RATE) -> Grid:
    """The grid of a period, s; ``rate`` (Hz) is the least of its samples."""
    least = max(LEAST, math.ceil(rate * period))
    samples = 2 * int(fft.next_fast_len(math.ceil(least / 2), real=True))
    omega = np.asarray(2.0 * np.pi * np.arange(samples // 2 + 1) / period, dtype=np.float64)
    return Grid(period, samples, omega)


def lines(on: Grid, cycles: NDArray[np.int64], amplitude: Complexes) -> Complexes:
    """The lines of Re(sum amplitude e^{-i omega t}), cycles counted per period."""
    found = np.zeros(on.samples // 2 + 1, dtype=np.complex128)
    found[cycles] = np.conj(amplitude) * (0.5 * on.samples)
    return found


def record(on: Grid, spectrum: Complexes) -> Floats:
    """Samples of lines; the last axis turns from lines to samples."""
    samples: Floats = fft.irfft(spectrum, on.samples, axis=-1)
    return samples


def spectrum(samples: Floats) -> Complexes:
    """Lines of samples; the last axis turns from samples to lines."""
    found: Complexes = fft.rfft(samples, axis=-1)
    return found
