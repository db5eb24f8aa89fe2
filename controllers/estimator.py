"""Position, velocity and acceleration from a measured position: a steady-state Kalman filter.

The model is a constant acceleration driven by white jerk; the gains are designed outside the
loop (rig/design/estimator.py) and only applied here.
"""

from typing import NamedTuple

from controllers.signals import Estimate


class Params(NamedTuple):
    """Steady-state gains of the filter."""

    gain_position: float  # 1
    gain_velocity: float  # 1/s
    gain_acceleration: float  # 1/s^2


def predict(previous: Estimate, periods: int, dt: float) -> Estimate:
    """Return the motion after ``periods`` ticks without a measurement."""
    return _after(previous, periods * dt)


def _after(previous: Estimate, span: float) -> Estimate:
    """Return the motion ``span`` (s) later at constant acceleration."""
    x, v, a = previous
    return Estimate(x + v * span + 0.5 * a * span * span, v + a * span, a)


def step(params: Params, previous: Estimate, measured: float, periods: int, dt: float) -> Estimate:
    """Return the prediction over ``periods`` ticks corrected with ``measured`` (m).

    ``periods`` is 1 unless ticks were lost. The last estimate is all of the filter's memory.
    """
    gain_position, gain_velocity, gain_acceleration = params
    x, v, a = previous
    span = periods * dt
    x = x + v * span + 0.5 * a * span * span
    v = v + a * span
    residual = measured - x
    return Estimate(
        x + gain_position * residual,
        v + gain_velocity * residual,
        a + gain_acceleration * residual,
    )


def stretch_gains(params: Params, factor: float) -> Params:
    """Return the gains for measurements whose spacing is ``factor`` times the tick.

    With its own gains the filter would oscillate on them, because a correction acts until the next
    one. The returned gains are those of the same filter with all its time constants multiplied by
    ``factor``: equally stable, and slower in proportion.
    """
    gain_position, gain_velocity, gain_acceleration = params
    return Params(gain_position, gain_velocity / factor, gain_acceleration / (factor * factor))


def step_late(
    params: Params, previous: Estimate, measured: float, delay: float, periods: int, dt: float
) -> Estimate:
    """Return `step` for a measurement taken ``delay`` seconds (> 0) before the estimate's time.

    The estimate is corrected at the time of the measurement and predicted from there. A constant
    delay thus leaves the filter's poles where they are; a delay that changes from tick to tick
    makes the measurements unevenly spaced, for which the caller stretches the gains.
    """
    gain_position, gain_velocity, gain_acceleration = params
    x, v, a = _after(previous, periods * dt - delay)
    residual = measured - x
    corrected = Estimate(
        x + gain_position * residual,
        v + gain_velocity * residual,
        a + gain_acceleration * residual,
    )
    return _after(corrected, delay)
