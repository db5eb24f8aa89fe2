"""Position, velocity and acceleration from a measured position: a steady-state Kalman filter.

The model is a constant acceleration driven by white jerk; the gains are designed outside the
loop (rig/estimator_design.py) and only applied here.
"""

from typing import NamedTuple

from controllers.signals import Estimate


class Params(NamedTuple):
    """The filter's steady-state gains."""

    gain_position: float  # 1
    gain_velocity: float  # 1/s
    gain_acceleration: float  # 1/s^2


def predict(before: Estimate, periods: int, dt: float) -> Estimate:
    """The motion after ``periods`` ticks without a measurement."""
    x, v, a = before
    span = periods * dt
    return Estimate(x + v * span + 0.5 * a * span * span, v + a * span, a)


def step(params: Params, before: Estimate, measured: float, periods: int, dt: float) -> Estimate:
    """Predict over ``periods`` ticks (1 unless some were lost), then correct with ``measured`` (m).

    The filter has no memory but its last estimate.
    """
    gain_position, gain_velocity, gain_acceleration = params
    x, v, a = before
    span = periods * dt
    x = x + v * span + 0.5 * a * span * span
    v = v + a * span
    residual = measured - x
    return Estimate(
        x + gain_position * residual,
        v + gain_velocity * residual,
        a + gain_acceleration * residual,
    )
