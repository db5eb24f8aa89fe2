"""The loop's parameters of a powered axis, from its keys in the rig file and the limits file.

For an axis that rotates read rad for m and N*m for N.
"""

import math
from functools import lru_cache

from controllers import estimator
from rig.config.limits_file import AxisLimits, DriveLimits, MotorPowerLimits, RotaryAxisLimits
from rig.config.rig_file import Axis, RotaryAxis
from rig.design.estimator import design
from rig.realtime import average, axis, limits, motor_power

_cached_design = lru_cache(maxsize=64)(design)  # sweeps repeat the same designs


def gear_ratio(motor: Axis | RotaryAxis) -> float:
    """Return the rotation of the motor per motion of the axis (rad/m)."""
    return motor.gear_ratio if isinstance(motor, RotaryAxis) else motor.gear_ratio_rad_per_m


def newtons_per_ampere(motor: Axis | RotaryAxis) -> float:
    """Return the force on the body per ampere of drive current, Kt N (N/A)."""
    return motor.torque_constant_n_m_per_a * gear_ratio(motor)


def metres_per_count(motor: Axis | RotaryAxis) -> float:
    """Return the motion of the axis per encoder count (m)."""
    turn = 2.0 * math.pi / gear_ratio(motor)
    return turn / motor.counts_per_revolution


def estimator_params(motor: Axis | RotaryAxis, dt: float) -> estimator.Params:
    """Return the estimator for a period ``dt`` (s); ValueError if its gain does not converge."""
    if isinstance(motor, RotaryAxis):
        jerk = motor.jerk_density_rad2_per_s5
    else:
        jerk = motor.jerk_density_m2_per_s5
    return _cached_design(metres_per_count(motor), motor.encoder_noise_counts, jerk, dt)


def axis_params(
    motor: Axis | RotaryAxis,
    bounds: AxisLimits | RotaryAxisLimits,
    stop_damping: float,
    stop_ramp: float,
    dt: float,
) -> axis.Params:
    """Return the parameters of an axis for a period ``dt`` (s).

    ``stop_damping`` (N*s/m) damps the body in a stop, after ``stop_ramp`` (s).
    """
    if isinstance(bounds, RotaryAxisLimits):
        warn, stop = bounds.position_warn_rad, bounds.position_stop_rad
        velocity, slew = bounds.velocity_stop_rad_per_s, bounds.torque_slew_n_m_per_s
        jump = bounds.encoder_jump_stop_rad
    else:
        warn, stop = bounds.position_warn_m, bounds.position_stop_m
        velocity, slew = bounds.velocity_stop_m_per_s, bounds.force_slew_n_per_s
        jump = bounds.encoder_jump_stop_m
    return axis.Params(
        metres_per_count=metres_per_count(motor),
        estimator=estimator_params(motor, dt),
        limits=axis_limits(
            bounds,
            newtons_per_ampere(motor),
            dt,
            position_warn=warn,
            position_stop=stop,
            velocity_stop=velocity,
            force_slew=slew,
            encoder_jump_stop=jump,
        ),
        stop_damping=stop_damping,
        stop_ramp=stop_ramp,
    )


def axis_limits(
    bounds: DriveLimits, newtons_per_ampere: float, dt: float, **others: float
) -> limits.AxisLimits:
    """Return the limits of an axis, those of its drive and ``others``."""
    return limits.AxisLimits(
        current_peak=bounds.current_peak_a,
        current_rms=bounds.current_rms_a,
        current_rms_time=bounds.current_rms_time_s,
        encoder_age_stop=bounds.encoder_age_stop_s,
        drive_age_stop=bounds.drive_age_stop_s,
        current_difference_stop=bounds.current_difference_stop_a,
        current_ticks_stop=max(1, round(bounds.current_difference_time_s / dt)),
        newtons_per_ampere=newtons_per_ampere,
        **others,
    )


def motor_power_params(bounds: MotorPowerLimits, dt: float) -> motor_power.Params:
    """Return the limits of a motor's power for a period ``dt`` (s)."""
    return motor_power.Params(
        average.weight_of_tick(bounds.time_s, dt),
        bounds.fed_stop_w,
        bounds.motor_difference_stop_w,
        bounds.motor_difference_ratio,
    )
