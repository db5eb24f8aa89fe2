"""Position, velocity and acceleration from a measured position: a steady-state Kalman filter.

The model is a constant acceleration driven by white jerk; the gains are designed outside the
loop (rig/design/estimator.py) and only applied here.
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


def stretched(params: Params, times: float) -> Params:
    """The same filter for measurements that lie so many ``times`` farther apart.

    With its own gains it would swing up on them: a correction acts for as long as it takes until
    the next one. These are the same filter with all times of its motion stretched, and so as
    stable, and slower in that proportion.
    """
    gain_position, gain_velocity, gain_acceleration = params
    return Params(gain_position, gain_velocity / times, gain_acceleration / (times * times))


def step_late(
    params: Params, before: Estimate, measured: float, late: float, periods: int, dt: float
) -> Estimate:
    """As `step`, with a measurement of ``late`` seconds (> 0) before the moment of the estimate.

    It is compared with where the estimate says the body was then. A correction that was due so
    long ago swings up in a filter that is quicker than the delay, so the filter is made slower:
    with its bandwidth w = gain_velocity / gain_position, as one of bandwidth w / (1 + 2 late w),
    which decays for any constant delay. Of two such filters the gains differ by that factor, its
    square and its cube.
    """
    gain_position, gain_velocity, gain_acceleration = params
    x, v, a = predict(before, periods, dt)
    residual = measured - (x - v * late + 0.5 * a * late * late)
    slower = 1.0 / (1.0 + 2.0 * late * gain_velocity / gain_position)
    return Estimate(
        x + slower * gain_position * residual,
        v + slower * slower * gain_velocity * residual,
        a + slower * slower * slower * gain_acceleration * residual,
    )
