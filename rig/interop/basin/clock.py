"""From a recorder's clock to a run's: offset and drift with their errors, and a slip if it slipped.

    t = tau + offset + drift (tau - middle) [+ slip where tau >= slip_at]

tau is the recorder's time, t the run's. Written about the middle of the fitted samples, errors of
offset and drift are independent.
"""

from typing import Any, NamedTuple

import numpy as np

from rig.interop.basin.recording import Floats

CRYSTAL = 50e-6  # standard deviation of an unknown drift: what quartz clocks are sold as
CLEAR = 6.0  # standard errors: a step that stands out so far is no noise in one of 1000 places
LEAST_SLIP = 2e-3  # s: below it a step cannot be told from a clock that wanders with temperature
_ENDS = 5  # cycles at either end where a step is not looked for


class Clock(NamedTuple):
    """A recorder's clock in run time."""

    offset: float  # s, at ``middle``
    drift: float  # run seconds a recorder second, less 1; 0 where it is not known
    middle: float  # s of the recorder
    offset_error: float  # s, standard error
    drift_error: float  # standard error; `CRYSTAL` where the drift is not known
    slip_at: float = float("inf")  # s of the recorder; inf: it did not slip
    slip: float = 0.0  # s

    def to_run(self, tau: Any) -> Any:
        """Run time (s) of recorder times (s)."""
        slipped = np.where(np.asarray(tau) >= self.slip_at, self.slip, 0.0)
        return tau + self.offset + self.drift * (tau - self.middle) + slipped

    def from_run(self, t: Any) -> Any:
        """Recorder time (s) of run times (s); of a time that a slip left out, that just after."""
        bare = self.middle + (t - self.middle - self.offset) / (1.0 + self.drift)
        late = self.middle + (t - self.middle - self.offset - self.slip) / (1.0 + self.drift)
        return np.where(bare < self.slip_at, bare, np.maximum(late, self.slip_at))

    def error(self, tau: Any) -> Any:
        """Standard error (s) of `to_run` at recorder times (s)."""
        return np.hypot(self.offset_error, self.drift_error * (np.asarray(tau) - self.middle))


class Step(NamedTuple):
    """The step in a lag that explains most of what a straight line leaves."""

    at: float  # s, between the two cycles it lies between
    size: float  # s
    clarity: float  # its size over its standard error


def fitted(time: Floats, lag: Floats) -> tuple[Clock, Floats]:
    """The clock that lags ``t - tau`` (s) at recorder times (s) tell, and what it leaves of them.

    A step that stands out is fitted with them as a slip. Errors are those of white scatter, which
    is taken from one cycle to the next, so neither slip nor drift is in it.
    """
    scatter = float(np.sqrt(0.5 * np.mean(np.diff(lag) ** 2)))
    step = largest_step(time, lag, scatter)
    slipped = step is not None and abs(step.size) > LEAST_SLIP and step.clarity > CLEAR
    middle = float(time.mean())
    columns = [np.ones_like(time), time - middle]
    if slipped and step is not None:
        columns.append((time >= step.at).astype(np.float64))
    design = np.stack(columns, axis=1)
    found, *_ = np.linalg.lstsq(design, lag, rcond=None)
    errors = scatter * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    left = lag - design @ found
    clock = Clock(float(found[0]), float(found[1]), middle, float(errors[0]), float(errors[1]))
    if slipped and step is not None:
        clock = clock._replace(slip_at=step.at, slip=float(found[2]))
    return clock, left


def largest_step(time: Floats, lag: Floats, scatter: float) -> Step | None:
    """The best single step beside a straight line, tried between all neighbours; None if too few.

    ``scatter`` (s) is the white scatter of one lag.
    """
    count = len(time)
    if count < 4 * _ENDS:
        return None
    flat = np.full(count, count**-0.5)
    slope = time - time.mean()
    slope = slope / np.linalg.norm(slope)
    left = lag - flat * (flat @ lag) - slope * (slope @ lag)

    def behind(values: Floats) -> Floats:
        """Sums from each place to the end."""
        return np.cumsum(values[::-1])[::-1]

    size = np.arange(count, 0, -1) - behind(flat) ** 2 - behind(slope) ** 2
    along = behind(left)
    places = np.arange(_ENDS, count - _ENDS)
    gain = along[places] ** 2 / size[places]
    i = int(places[np.argmax(gain)])
    found, error = float(along[i] / size[i]), scatter / float(np.sqrt(size[i]))
    clarity = abs(found) / error if error > 0.0 else (np.inf if found else 0.0)
    return Step(0.5 * float(time[i - 1] + time[i]), found, float(clarity))


def constant(offset: float, error: float, at: float) -> Clock:
    """A clock of which only one moment is known: its drift may be anything a quartz has."""
    return Clock(offset, 0.0, at, error, CRYSTAL)
