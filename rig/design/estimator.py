"""Designing the encoder estimator's steady-state gains, outside the loop.

Model: constant acceleration driven by white jerk of given spectral density, observed through
encoder counts (quantisation q^2/12 plus the encoder's own noise). filterpy's Kalman filter is run
until its gain stands still; the loop applies that gain (controllers/estimator.py).

filterpy brings scipy's statistics: two seconds before the first design of a process. Gains are
therefore kept on disk, to the last bit, under all they follow from: count, noise, density, period,
this file, filterpy's and numpy's versions. Whatever is not whole there is designed anew.
"""

import hashlib
import json
import math
from contextlib import suppress
from importlib import metadata
from pathlib import Path

import numpy as np

from controllers import estimator
from rig.sweep.cache_folder import cache_root, write_atomically

_SETTLED = 1e-12  # relative change of the gain in one step
_MOST_STEPS = 200_000
_DIGITS = 10  # what a gain settled to 1e-12 has on every processor; the last bits are the BLAS's


def design(
    metres_per_count: float, noise_counts: float, jerk_density: float, dt: float
) -> estimator.Params:
    """Steady-state gains for a count of ``metres_per_count`` (m) and period ``dt`` (s).

    ``noise_counts``: standard deviation besides quantisation; ``jerk_density``: spectral density
    of the white jerk, m^2/s^5: larger follows faster and smooths less. ValueError where the gain
    does not settle.
    """
    asked = [float(x) for x in (metres_per_count, noise_counts, jerk_density, dt)]
    path = _kept_at(asked)
    found = _kept(path, asked)
    if found is None:
        found = designed(*asked)
        _keep(path, asked, found)
    return found


def designed(
    metres_per_count: float, noise_counts: float, jerk_density: float, dt: float
) -> estimator.Params:
    """The same by filterpy, whatever is kept."""
    from filterpy.common import Q_continuous_white_noise  # noqa: PLC0415 - see above
    from filterpy.kalman import KalmanFilter  # noqa: PLC0415

    count = abs(metres_per_count)
    filter_ = KalmanFilter(dim_x=3, dim_z=1)
    filter_.F = np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    filter_.H = np.array([[1.0, 0.0, 0.0]])
    filter_.R = np.array([[(1.0 / 12.0 + noise_counts * noise_counts) * count * count]])
    filter_.Q = Q_continuous_white_noise(dim=3, dt=dt, spectral_density=jerk_density)
    filter_.P = np.diag([count * count, 1e-2, 1.0])
    gain = np.zeros((3, 1))
    for _ in range(_MOST_STEPS):
        filter_.predict()
        filter_.update(np.array([[0.0]]))
        if np.all(np.abs(filter_.K - gain) <= _SETTLED * np.abs(filter_.K)):
            break
        gain = filter_.K.copy()
    else:
        raise ValueError("the estimator's gain did not settle: check jerk density and noise")
    position, velocity, acceleration = (float(f"{k:.{_DIGITS}g}") for k in filter_.K[:, 0])
    return estimator.Params(position, velocity, acceleration)


def _kept_at(asked: list[float]) -> Path:
    versions = [metadata.version(name) for name in ("filterpy", "numpy")]
    told = [asked, versions, _MOST_STEPS, Path(__file__).read_text()]
    word = hashlib.sha256(json.dumps(told).encode()).hexdigest()[:24]
    return cache_root() / f"estimator_{word}.json"


def _kept(path: Path, asked: list[float]) -> estimator.Params | None:
    try:
        told = json.loads(path.read_text())
        gains = [float(gain) for gain in told["gains"]]
        whole = told["asked"] == asked and all(map(math.isfinite, gains))
        return estimator.Params(*gains) if whole else None
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _keep(path: Path, asked: list[float], found: estimator.Params) -> None:
    """Best effort: where nothing can be written, the next process designs again."""
    with suppress(OSError):
        write_atomically(path, json.dumps({"asked": asked, "gains": list(found)}))


def response(
    params: estimator.Params, f_hz: np.ndarray, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity estimate per metre of true position, complex, at ``f_hz``.

    Both include no hold and no delay; dividing the velocity by j omega gives the filter's error.
    """
    transition = np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    gain = np.array([[params.gain_position], [params.gain_velocity], [params.gain_acceleration]])
    observe = np.array([[1.0, 0.0, 0.0]])
    closed = (np.eye(3) - gain @ observe) @ transition
    z = np.exp(2j * np.pi * np.asarray(f_hz) * dt)
    states = np.stack([np.linalg.solve(np.eye(3) - closed / one, gain)[:, 0] for one in z])
    return states[:, 0], states[:, 1]
