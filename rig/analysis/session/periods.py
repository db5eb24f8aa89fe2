"""Whole periods of an oscillation: its drift, its fundamental, its peaks, its mean period.

Arrays are (samples,) of evenly sampled signals and begin with a period. A period that is no whole
number of samples is cut at the nearest sample.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from rig.analysis.session.estimate import Floats
from rig.analysis.session.linear_fit import line

Complexes = npt.NDArray[np.complex128]


class Cut(NamedTuple):
    """Where the whole periods of a signal lie."""

    edges: npt.NDArray[np.int64]  # sample index of each period's begin, and of the last one's end
    period: float  # s
    dt: float  # s

    @property
    def whole(self) -> int:
        """Whole periods."""
        return len(self.edges) - 1

    @property
    def omega(self) -> float:
        """rad/s."""
        return float(2.0 * np.pi / self.period)


def cut(samples: int, period: float, dt: float, first: int = 0) -> Cut:
    """The whole periods (s) from sample ``first`` on; ValueError if there is none."""
    count = int((samples - first) * dt / period + 0.5 * dt / period)
    if count < 1:
        raise ValueError(f"{(samples - first) * dt:g} s hold no whole period of {period:g} s")
    edges = first + np.rint(np.arange(count + 1) * period / dt).astype(np.int64)
    return Cut(np.minimum(edges, samples), period, dt)


def detrended(values: Floats, of: Cut) -> Floats:
    """The signal over its whole periods without drift and mean."""
    here = values[of.edges[0] : of.edges[-1]]
    t = of.dt * np.arange(len(here))
    off: Floats = here - here.mean() - drift(values, of) * (t - t.mean())
    return off


def drift(values: Floats, of: Cut) -> float:
    """The linear drift, per second: the slope of the means of whole periods; 0 for one period.

    A line through the samples themselves would take part of every sine with it: 0.7 deg at the
    ends of 26 periods of 20 deg.
    """
    if of.whole < 2:
        return 0.0
    begins = of.edges[:-1] - of.edges[0]
    sums = np.add.reduceat(values[of.edges[0] : of.edges[-1]], begins)
    middles = 0.5 * of.dt * (of.edges[:-1] + of.edges[1:])
    return line(middles, sums / np.diff(of.edges)).slope


def pieces(values: Floats, of: Cut) -> list[Floats]:
    """The periods of a signal that has been cut down to them."""
    return np.split(values, (of.edges[1:-1] - of.edges[0]).tolist())


def fundamentals(values: Floats, of: Cut) -> Complexes:
    """Coefficient of the fundamental, by period: A cos(omega t + phase) gives A exp(1j phase).

    ``values`` cut down to the periods. The discrete Fourier transform of one period at a time.
    """
    out = []
    for piece, edge in zip(pieces(values, of), of.edges[:-1], strict=True):
        t = of.dt * (edge - of.edges[0] + np.arange(len(piece)))
        out.append(2.0 * np.mean(piece * np.exp(-1j * of.omega * t)))
    return np.array(out)


def half_strokes(values: Floats, of: Cut) -> Floats:
    """Half of peak to peak, by period."""
    return np.array([0.5 * np.ptp(piece) for piece in pieces(values, of)])


def mean_period(values: Floats, of: Cut) -> Floats:
    """The mean over periods by phase, (samples of the shortest period,)."""
    found = pieces(values, of)
    least = min(len(piece) for piece in found)
    out: Floats = np.mean([piece[:least] for piece in found], axis=0)
    return out


def begin(reference: Floats, period: float, dt: float) -> int:
    """The sample from which a reference's periods begin at its maximum, as the thesis's do.

    0 for a reference that stands still.
    """
    samples = round(period / dt)
    here = reference[:samples]
    t = dt * np.arange(len(here))
    found = np.mean((here - here.mean()) * np.exp(-2j * np.pi * t / period))
    if not abs(found) > 1e-9:
        return 0
    first = round(float(-np.angle(found) / (2.0 * np.pi) % 1.0) * period / dt)
    return first if first < 0.99 * samples else 0  # rounding shall not cost a period


def velocity(angle: Floats, dt: float, window: float) -> Floats:
    """Derivative by least squares of a line in a moving window (s), without delay.

    The moving-window differentiator of section 3.2.1 of the OSWEC thesis.
    """
    count = max(3, 2 * round(0.5 * window / dt) + 1)
    out: Floats = savgol_filter(angle, count, 1, deriv=1, delta=dt, mode="interp")
    return out


def rms(values: Floats) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values * values)))
