"""Position, velocity and acceleration from encoder counts: a steady-state Kalman filter.

The model is a constant acceleration driven by white jerk; the gains are designed outside the
loop (rig/estimator_design.py) and only applied here.
"""

from typing import NamedTuple

from controllers.signals import Estimate


class Params(NamedTuple):
    """Scale of the encoder and the filter's steady-state gains."""

    metres_per_count: float  # signed: counts that grow when the body rises give a positive scale
    gain_position: float  # 1
    gain_velocity: float  # 1/s
    gain_acceleration: float  # 1/s^2


class State(NamedTuple):
    """Filter state relative to the encoder's zero, and whether it has seen a count yet."""

    position: float  # m
    velocity: float  # m/s
    acceleration: float  # m/s^2
    seeded: int


def start() -> State:
    """State before the first count."""
    return State(0.0, 0.0, 0.0, 0)


def step(params: Params, state: State, counts: int, periods: int, dt: float) -> State:
    """Predict over ``periods`` ticks (1 unless ticks were lost), then correct with the counts."""
    scale, gain_position, gain_velocity, gain_acceleration = params
    x, v, a, seeded = state
    measured = counts * scale
    if seeded == 0:
        return State(measured, 0.0, 0.0, 1)
    span = periods * dt
    x = x + v * span + 0.5 * a * span * span
    v = v + a * span
    residual = measured - x
    return State(
        x + gain_position * residual,
        v + gain_velocity * residual,
        a + gain_acceleration * residual,
        1,
    )


def estimate(state: State, zero: float) -> Estimate:
    """Motion relative to the tared zero (m in the encoder's own frame)."""
    return Estimate(state.position - zero, state.velocity, state.acceleration)
