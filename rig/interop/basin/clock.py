"""Conversion between a recorder's clock and a run's: offset, drift and slip, with errors.

    t = tau + offset + drift (tau - middle) [+ slip where tau >= slip_at]

tau is the recorder's time, t the run's. The line is referred to the middle of the fitted samples,
which makes the errors of offset and drift independent.
"""

from typing import Any, NamedTuple

import numpy as np

from rig.recording.channel_file import Floats

UNKNOWN_DRIFT_ERROR = (
    50e-6  # standard deviation of an unknown drift: the tolerance of quartz clocks
)
MIN_SIGNIFICANCE = 6.0  # standard errors; noise does not reach it at any of 1000 candidates
MIN_SLIP = 2e-3  # s; temperature makes clocks wander by as much
_END_CYCLES = 5  # cycles at either end that are no candidates for a step


class Clock(NamedTuple):
    """A recorder's clock in run time."""

    offset: float  # s, at ``middle``
    drift: float  # run seconds per recorder second, minus 1; 0 if unknown
    middle: float  # s of the recorder
    offset_error: float  # s, standard error
    drift_error: float  # standard error; `UNKNOWN_DRIFT_ERROR` if the drift is unknown
    slip_at: float = float("inf")  # s of the recorder; inf: no slip
    slip: float = 0.0  # s

    def to_run(self, tau: Any) -> Any:
        """Return run times (s) of recorder times (s)."""
        slipped = np.where(np.asarray(tau) >= self.slip_at, self.slip, 0.0)
        return tau + self.offset + self.drift * (tau - self.middle) + slipped

    def from_run(self, t: Any) -> Any:
        """Return recorder times (s) of run times (s); a time within a slip maps to ``slip_at``."""
        before_slip = self.middle + (t - self.middle - self.offset) / (1.0 + self.drift)
        after_slip = self.middle + (t - self.middle - self.offset - self.slip) / (1.0 + self.drift)
        return np.where(
            before_slip < self.slip_at, before_slip, np.maximum(after_slip, self.slip_at)
        )

    def error(self, tau: Any) -> Any:
        """Return the standard error (s) of `to_run` at recorder times (s)."""
        return np.hypot(self.offset_error, self.drift_error * (np.asarray(tau) - self.middle))


class LagStep(NamedTuple):
    """The step in the lags that reduces the residuals of a straight line most."""

    time: float  # s, midpoint of the two cycles around the step
    size: float  # s
    significance: float  # size divided by its standard error


def fit_clock(time: Floats, lag: Floats) -> tuple[Clock, Floats]:
    """Fit a clock to lags ``t - tau`` (s) at recorder times (s); return it and the residuals.

    A significant step is fitted as a slip. The errors assume white scatter of the lags. The scatter
    is estimated from differences of neighbouring cycles, so neither slip nor drift enters it.
    """
    scatter = float(np.sqrt(0.5 * np.mean(np.diff(lag) ** 2)))
    step = largest_step(time, lag, scatter)
    slipped = (
        step is not None and abs(step.size) > MIN_SLIP and step.significance > MIN_SIGNIFICANCE
    )
    middle = float(time.mean())
    columns = [np.ones_like(time), time - middle]
    if slipped and step is not None:
        columns.append((time >= step.time).astype(np.float64))
    design = np.stack(columns, axis=1)
    coefficients, *_ = np.linalg.lstsq(design, lag, rcond=None)
    errors = scatter * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    residuals = lag - design @ coefficients
    clock = Clock(
        float(coefficients[0]), float(coefficients[1]), middle, float(errors[0]), float(errors[1])
    )
    if slipped and step is not None:
        clock = clock._replace(slip_at=step.time, slip=float(coefficients[2]))
    return clock, residuals


def largest_step(time: Floats, lag: Floats, scatter: float) -> LagStep | None:
    """Return the best single step added to a straight line; None for too few lags.

    Every pair of neighbouring lags is a candidate. ``scatter`` (s) is the white scatter of one lag.
    """
    count = len(time)
    if count < 4 * _END_CYCLES:
        return None
    flat = np.full(count, count**-0.5)
    slope = time - time.mean()
    slope = slope / np.linalg.norm(slope)
    residuals = lag - flat * (flat @ lag) - slope * (slope @ lag)

    def tail_sums(values: Floats) -> Floats:
        """Return the sums from each index to the end."""
        return np.cumsum(values[::-1])[::-1]

    energy = np.arange(count, 0, -1) - tail_sums(flat) ** 2 - tail_sums(slope) ** 2
    tail_residuals = tail_sums(residuals)
    candidates = np.arange(_END_CYCLES, count - _END_CYCLES)
    gain = tail_residuals[candidates] ** 2 / energy[candidates]
    i = int(candidates[np.argmax(gain)])
    size, error = float(tail_residuals[i] / energy[i]), scatter / float(np.sqrt(energy[i]))
    significance = abs(size) / error if error > 0.0 else (np.inf if size else 0.0)
    return LagStep(0.5 * float(time[i - 1] + time[i]), size, float(significance))


def constant_clock(offset: float, error: float, time: float) -> Clock:
    """Return a clock of which one moment is known; its drift is that of any quartz clock."""
    return Clock(offset, 0.0, time, error, UNKNOWN_DRIFT_ERROR)
