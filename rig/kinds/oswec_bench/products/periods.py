"""Whole periods of an oscillation: drift, fundamental, peaks, mean period.

Arrays are (samples,) of evenly sampled signals and start with a period. Periods of a fractional
number of samples are cut at the nearest sample.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import minimum_filter1d
from scipy.signal import savgol_filter

from rig.kinds.oswec_bench.products.estimate import Floats, fit_line

Complexes = npt.NDArray[np.complex128]


class PeriodCut(NamedTuple):
    """Location of the whole periods in a signal."""

    edges: npt.NDArray[np.int64]  # sample index of each period's start, and of the last one's end
    period: float  # s
    dt: float  # s

    @property
    def period_count(self) -> int:
        """Number of whole periods."""
        return len(self.edges) - 1

    @property
    def omega(self) -> float:
        """Angular frequency, rad/s."""
        return float(2.0 * np.pi / self.period)

    def trim(self, values: Any) -> Any:
        """Return the whole periods of a signal."""
        return values[self.edges[0] : self.edges[-1]]


def cut_periods(samples: int, period: float, dt: float, first: int = 0) -> PeriodCut:
    """Return the whole periods (s) from sample ``first`` on; ValueError if there is none."""
    period_count = int((samples - first) * dt / period + 0.5 * dt / period)
    if period_count < 1:
        raise ValueError(f"{(samples - first) * dt:g} s contain no whole period of {period:g} s")
    edges = first + np.rint(np.arange(period_count + 1) * period / dt).astype(np.int64)
    return PeriodCut(np.minimum(edges, samples), period, dt)


def detrend(values: Floats, cut: PeriodCut) -> Floats:
    """Return the signal over its whole periods, without drift and mean."""
    trimmed = cut.trim(values)
    t = cut.dt * np.arange(len(trimmed))
    detrended: Floats = trimmed - trimmed.mean() - drift(values, cut) * (t - t.mean())
    return detrended


def drift(values: Floats, cut: PeriodCut) -> float:
    """Return the linear drift, per second: the slope of the means of whole periods; 0 for one
    period.

    A line through the samples themselves would contain part of every sine: 0.7 deg at the ends of
    26 periods of 20 deg.
    """
    if cut.period_count < 2:
        return 0.0
    starts = cut.edges[:-1] - cut.edges[0]
    sums = np.add.reduceat(cut.trim(values), starts)
    centres = 0.5 * cut.dt * (cut.edges[:-1] + cut.edges[1:])
    return fit_line(centres, sums / np.diff(cut.edges)).slope


def split_periods(values: Floats, cut: PeriodCut) -> list[Floats]:
    """Return the periods of a signal that is cut to them."""
    return np.split(values, (cut.edges[1:-1] - cut.edges[0]).tolist())


def fundamentals(values: Floats, cut: PeriodCut) -> Complexes:
    """Return the coefficient of the fundamental, by period: A cos(omega t + phase) gives A exp(1j
    phase).

    ``values`` are cut to the periods. The transform is the discrete Fourier transform of one period
    at a time.
    """
    coefficients = []
    for period, edge in zip(split_periods(values, cut), cut.edges[:-1], strict=True):
        t = cut.dt * (edge - cut.edges[0] + np.arange(len(period)))
        coefficients.append(2.0 * np.mean(period * np.exp(-1j * cut.omega * t)))
    return np.array(coefficients)


def half_strokes(values: Floats, cut: PeriodCut) -> Floats:
    """Return half of peak to peak, by period."""
    return np.array([0.5 * np.ptp(piece) for piece in split_periods(values, cut)])


def mean_period(values: Floats, cut: PeriodCut) -> Floats:
    """Return the mean over periods by phase, (samples of the shortest period,)."""
    periods = split_periods(values, cut)
    shortest = min(len(piece) for piece in periods)
    mean: Floats = np.mean([piece[:shortest] for piece in periods], axis=0)
    return mean


def first_maximum(reference: Floats, period: float, dt: float) -> int:
    """Return the sample at which a reference's periods start, its maximum, as in the thesis.

    The result is 0 for a constant reference.
    """
    samples = round(period / dt)
    first_period = reference[:samples]
    t = dt * np.arange(len(first_period))
    fundamental = np.mean((first_period - first_period.mean()) * np.exp(-2j * np.pi * t / period))
    if not abs(fundamental) > 1e-9:
        return 0
    first = round(float(-np.angle(fundamental) / (2.0 * np.pi) % 1.0) * period / dt)
    return first if first < 0.99 * samples else 0  # rounding must not lose a period


def velocity(angle: Floats, dt: float, window: float) -> Floats:
    """Return the derivative by least squares of a line in a moving window (s), without delay.

    This is the moving-window differentiator of section 3.2.1 of the OSWEC thesis.
    """
    window_samples = max(3, 2 * round(0.5 * window / dt) + 1)
    derivative: Floats = savgol_filter(angle, window_samples, 1, deriv=1, delta=dt, mode="interp")
    return derivative


def rms(values: Floats) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(values * values)))


def moving_samples(velocity: Floats, guard_samples: int, min_share: float = 0.12) -> Floats:
    """Return a mask of samples faster than a share of the top speed, with ``guard_samples`` on each
    side.
    """
    fast = np.abs(velocity) > min_share * np.abs(velocity).max()
    steady = fast & (np.sign(velocity) == np.sign(np.roll(velocity, 1)))
    moving: Floats = minimum_filter1d(steady, 2 * guard_samples + 1)
    return moving


def split_moving(signals: list[Floats], moving: Floats, cut: PeriodCut) -> list[list[Floats]]:
    """Return the moving samples of signals that are cut to the periods, period by period."""
    by_signal = [split_periods(each, cut) for each in (*signals, moving)]
    return [
        [signal[mask > 0] for signal in period] for *period, mask in zip(*by_signal, strict=True)
    ]
