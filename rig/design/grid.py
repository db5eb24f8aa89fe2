"""Time and frequency grid of one repeat period of a sea, for motion and force.

A periodic record of N samples is equivalent to its N/2 + 1 complex spectral lines. Lines are
amplitudes of e^{+i omega t} with the scaling of `numpy.fft.rfft`.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]

MIN_SAMPLES = 512  # per period: drag and friction of a sine to 1e-4
MIN_RATE = 32.0  # Hz: twice the eighth harmonic of 2 Hz, the highest wave frequency


class Grid(NamedTuple):
    """Samples and spectral lines of one period."""

    period: float  # s
    samples: int  # even
    omega: Floats  # rad/s of each line, starting at 0

    @property
    def step(self) -> float:
        """Seconds between samples."""
        return self.period / self.samples


def build_grid(period: float, rate: float = MIN_RATE) -> Grid:
    """Return the grid of a period (s) with a sampling rate of at least ``rate`` (Hz)."""
    min_samples = max(MIN_SAMPLES, math.ceil(rate * period))
    samples = 2 * _quick_length(math.ceil(min_samples / 2))
    omega = np.asarray(2.0 * np.pi * np.arange(samples // 2 + 1) / period, dtype=np.float64)
    return Grid(period, samples, omega)


def _quick_length(least: int) -> int:
    """Return the smallest product of 2, 3 and 5 from ``least`` on, whose transform is quick.

    As `scipy.fft.next_fast_len` for real samples, whose import takes a quarter of a second.
    """
    length = least
    while True:
        rest = length
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return length
        length += 1


def spectrum_from_amplitudes(
    grid: Grid, cycles: NDArray[np.int64], amplitude: Complexes
) -> Complexes:
    """Return the spectrum of Re(sum amplitude e^{-i omega t}); ``cycles`` counts per period."""
    spectrum = np.zeros(grid.samples // 2 + 1, dtype=np.complex128)
    spectrum[cycles] = np.conj(amplitude) * (0.5 * grid.samples)
    return spectrum


def samples_from_spectrum(grid: Grid, spectrum: Complexes) -> Floats:
    """Return the samples of a spectrum; the transform acts on the last axis."""
    return np.fft.irfft(spectrum, grid.samples, axis=-1)


def spectrum_from_samples(samples: Floats) -> Complexes:
    """Return the spectrum of samples; the transform acts on the last axis."""
    return np.fft.rfft(samples, axis=-1)
