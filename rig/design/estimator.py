"""Design of the encoder estimator's steady-state gains, outside the loop.

Model: constant acceleration driven by white jerk of given spectral density, observed through
encoder counts (quantisation q^2/12 plus the encoder's own noise). The design iterates filterpy's
Kalman filter until its gain converges; the loop applies that gain (controllers/estimator.py).

filterpy imports scipy.stats, which costs two seconds before the first design of a process. Gains
are therefore cached on disk, exact to the last bit. The cache key covers every input: count, noise,
density, period, this file, and the versions of filterpy and numpy. An incomplete cache entry is
ignored and the gains are designed again.
"""

import hashlib
import json
import math
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers import estimator
from rig.compilation.cache_folder import cache_root, cached_json
from rig.spectra.periods import Complexes, Floats

_CONVERGED = 1e-12  # relative change of the gain in one step
_MAX_STEPS = 200_000
_DIGITS = 10  # digits of a gain converged to 1e-12 that agree on every processor and BLAS


def design(
    metres_per_count: float, noise_counts: float, jerk_density: float, dt: float
) -> estimator.Params:
    """Return the steady-state gains for a count of ``metres_per_count`` (m) and period ``dt`` (s).

    ``noise_counts`` is the standard deviation of the encoder noise in addition to quantisation.
    ``jerk_density`` is the spectral density of the white jerk, m^2/s^5; a larger value follows
    faster and smooths less. Raises ValueError if the gain does not converge.
    """
    arguments = [float(x) for x in (metres_per_count, noise_counts, jerk_density, dt)]
    versions = [metadata.version(name) for name in ("filterpy", "numpy")]
    fingerprint = [arguments, versions, _MAX_STEPS, Path(__file__).read_text()]
    digest = hashlib.sha256(json.dumps(fingerprint).encode()).hexdigest()[:24]
    entry = cached_json(
        cache_root() / f"estimator_{digest}.json",
        lambda: {"arguments": arguments, "gains": list(design_with_filterpy(*arguments))},
        lambda entry: (
            entry["arguments"] == arguments and all(math.isfinite(gain) for gain in entry["gains"])
        ),
    )
    return estimator.Params(*entry["gains"])


def design_with_filterpy(
    metres_per_count: float, noise_counts: float, jerk_density: float, dt: float
) -> estimator.Params:
    """Return the gains of `design`, computed by filterpy without the cache."""
    from filterpy.common import Q_continuous_white_noise  # noqa: PLC0415 - see above
    from filterpy.kalman import KalmanFilter  # noqa: PLC0415

    count = abs(metres_per_count)
    filter_ = KalmanFilter(dim_x=3, dim_z=1)
    filter_.F = transition(dt)
    filter_.H = np.array([[1.0, 0.0, 0.0]])
    filter_.R = np.array([[(1.0 / 12.0 + noise_counts * noise_counts) * count * count]])
    filter_.Q = Q_continuous_white_noise(dim=3, dt=dt, spectral_density=jerk_density)
    filter_.P = np.diag([count * count, 1e-2, 1.0])
    gain = np.zeros((3, 1))
    for _ in range(_MAX_STEPS):
        filter_.predict()
        filter_.update(np.array([[0.0]]))
        if np.all(np.abs(filter_.K - gain) <= _CONVERGED * np.abs(filter_.K)):
            break
        gain = filter_.K.copy()
    else:
        raise ValueError(
            f"the estimator's gain did not settle in {_MAX_STEPS} steps: "
            "check jerk density and noise"
        )
    position, velocity, acceleration = (float(f"{k:.{_DIGITS}g}") for k in filter_.K[:, 0])
    return estimator.Params(position, velocity, acceleration)


class EstimatorResponse(NamedTuple):
    """Estimates per metre of the measured position, by line; neither hold nor delay is included."""

    position: Complexes
    velocity: Complexes  # 1/s; divided by j omega it gives the filter's error
    acceleration: Complexes  # 1/s^2


def transition(dt: float) -> Floats:
    """Return the transition matrix over one tick: constant acceleration."""
    return np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])


def correction(params: estimator.Params) -> tuple[Floats, Floats]:
    """Return gain G and matrix I - G H of the estimator, which measures position only."""
    gain = np.array([params.gain_position, params.gain_velocity, params.gain_acceleration])
    return gain, np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])


def response(params: estimator.Params, omega: Floats, dt: float) -> EstimatorResponse:
    """Return the response of the estimator to its measured position at ``omega`` (rad/s)."""
    gain, correction_matrix = correction(params)
    error_dynamics = correction_matrix @ transition(dt)
    z_inv = np.exp(-1j * omega * dt)
    system = np.eye(3) - z_inv[:, None, None] * error_dynamics
    states = np.linalg.solve(system, np.broadcast_to(gain, (omega.size, 3))[..., None])[..., 0]
    return EstimatorResponse(states[:, 0], states[:, 1], states[:, 2])
