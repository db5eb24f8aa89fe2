"""Error of amplitudes by rounding, as an encoder rounds a position to whole counts.

A motion that repeats passes the same counts in each period, so its rounding error repeats too and
no scatter of periods shows it. Nor is it white for slow motion: the error is a sawtooth of the
motion, and much of it lies within the frequencies of the motion itself. So the measured motion is
rounded anew, displaced by fractions of a count, and the spectrum of its error is averaged. The
measured motion contains the error: for a standard deviation of 2 counts the result is 5 % small, of
half a count 17 %. B. Widrow, I. Kollar, Quantization Noise, Cambridge 2008, chapters 19 and 20.
"""

import numpy as np

from rig.spectra.periods import Floats

_DISPLACEMENTS = 32  # of the motion, over one count: their mean has a standard error of 18 %


def shared_rounding(counts: Floats, period: int, lines: int) -> Floats:
    """Return the standard deviation of lines 1 .. ``lines`` (counts) by rounding, of a mean period.

    ``counts`` are whole numbers at evenly spaced times, ``period`` the samples of a repeat period.
    It is the part of the error that all periods share: noise of half a count makes it zero, since
    their scatter then shows all of it. The root of the mean |error|^2 of each complex amplitude.
    """
    number = len(counts) // period
    blocks = counts[: number * period].reshape(number, period)
    spectra = np.fft.rfft(blocks, axis=1)
    spectra[:, lines + 1 :] = 0.0
    motion = np.fft.irfft(spectra, period, axis=1)
    share = _shared_part(blocks - motion)
    mean_motion = motion.mean(axis=0)
    power = np.zeros(lines)
    for displacement in (np.arange(_DISPLACEMENTS) + 0.5) / _DISPLACEMENTS:
        displaced = mean_motion + displacement
        error = np.fft.rfft(np.rint(displaced) - displaced)[1 : lines + 1] * (2.0 / period)
        power += np.abs(error) ** 2
    return np.asarray(np.sqrt(share * power / _DISPLACEMENTS), dtype=np.float64)


def _shared_part(residuals: Floats) -> float:
    """Return the correlation of the periods' residuals, 0 .. 1; 1 for a single period."""
    number, energy = len(residuals), float(np.sum(residuals**2))
    if number < 2 or energy == 0.0:
        return 1.0
    products = float(np.sum(residuals.sum(axis=0) ** 2)) - energy
    return min(max(products / ((number - 1) * energy), 0.0), 1.0)
