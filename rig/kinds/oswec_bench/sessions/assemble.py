"""Conversion of a checked session to the loop's parameters, with units of degrees, counts and
volts.
"""

import math
from typing import Any

from controllers import brake_damping, oswec_position, torque_tracking
from rig.design.axis_params import axis_limits, motor_power_params
from rig.design.estimator import design
from rig.kinds.oswec_bench.config.limits_file import BenchLimitsFile
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile, Encoder
from rig.kinds.oswec_bench.sessions.files import Session
from rig.kinds.oswec_bench.sessions.plan import SessionPlan, setpoint_table
from rig.kinds.oswec_bench.tick import manual, speed
from rig.kinds.oswec_bench.tick.signals import TORQUE, VELOCITY
from rig.kinds.oswec_bench.tick.state import Homing, Limits, LoadLimits, Params, ShaftParams
from rig.realtime import axis, cycle, safety


def motor_radians_per_count(rig: BenchRigFile) -> float:
    """Return the angle at the gearbox output per count of the motor's encoder, rad."""
    servo = rig.servo
    return 2.0 * math.pi / (servo.encoder.counts_per_revolution * servo.gear_ratio)


def shaft_radians_per_count(rig: BenchRigFile) -> float:
    """Return the angle per count of the encoder behind the coupling, rad."""
    return 2.0 * math.pi / rig.shaft_encoder.counts_per_revolution


def analysis_scales(session: Session) -> dict[str, Any]:
    """Return the constants by which the analysis reads counts and commands of a run."""
    constants = session.constants
    return {
        "motor_rad_per_count": motor_radians_per_count(session.rig),
        "shaft_rad_per_count": shaft_radians_per_count(session.rig),
        "torque_constant_n_m_per_a": session.rig.servo.torque_constant_n_m_per_a,
        "torque_constant_positive_n_m_per_a": constants.torque_positive,
        "torque_constant_negative_n_m_per_a": constants.torque_negative,
        "velocity_constant_rad_per_s_per_v": constants.velocity,
        "velocity_loop_lag_s": constants.lag,
        "origin": constants.origin,
    }


def bench_params(session: Session, plan: SessionPlan) -> cycle.Params:
    """Return all parameters of the bench's cycle, with the designed estimators."""
    rig, limits_file, session_file = session.rig, session.limits, session.file
    dt, in_torque_loop = plan.dt, session_file.loop == "torque"
    return cycle.Params(
        segments=plan.segments,
        safety=safety.Params(
            enable_ticks=round(rig.drive_enable_timeout_s / dt),
            stop_ticks=round(rig.stop.duration_s / dt),
        ),
        lost_ticks_stop=limits_file.loop.lost_ticks_stop,
        rig=Params(
            mode=TORQUE if in_torque_loop else VELOCITY,
            motor=_motor(rig, limits_file, in_torque_loop, dt),
            shaft=ShaftParams(
                shaft_radians_per_count(rig),
                _estimator(rig.shaft_encoder, shaft_radians_per_count(rig), dt),
            ),
            speed=speed.Params(
                session.constants.velocity,
                rig.servo.command_v,
                limits_file.motor.velocity_command_rad_per_s,
                limits_file.motor.acceleration_rad_per_s2,
            ),
            homing=Homing(rig.homing.rate_per_s, rig.homing.speed_rad_per_s),
            position_feedback=session_file.position_feedback_per_s,
            position=_position(session),
            torque=_torque(session),
            brake=brake_damping.Params(
                session.constants.brake_torques,
                session.constants.brake_currents,
                rig.brake.slew_a_per_s,
                rig.brake.velocity_filter_s,
            ),
            manual=_manual(rig, limits_file),
            locked=1 if session_file.shaft == "clamped" else 0,
            limits=_limits(limits_file, in_torque_loop, dt),
            motor_power=motor_power_params(limits_file.power, dt),
            setpoints=setpoint_table(plan.setpoints),
        ),
    )


def _manual(rig: BenchRigFile, limits_file: BenchLimitsFile) -> manual.Params:
    motor, rate = limits_file.motor, rig.homing.rate_per_s
    end = 0.5 * (motor.angle_warn_deg + motor.angle_stop_deg)
    quickness = max(1.0 / rig.manual_ramp_s, 2.0 * rate)
    return manual.Params(
        rig.manual_ramp_s, math.radians(end), rate, quickness, motor.acceleration_rad_per_s2
    )


def _estimator(encoder: Encoder, radians_per_count: float, dt: float) -> Any:
    return design(radians_per_count, encoder.noise_counts, encoder.jerk_density_rad2_per_s5, dt)


def _motor(
    rig: BenchRigFile, limits_file: BenchLimitsFile, in_torque_loop: bool, dt: float
) -> axis.Params:
    """Return the motor as a rotating axis: rad for m, N*m for N.

    In the velocity loop the drive controls its current itself, so there is no commanded current to
    compare with.
    """
    motor, scale = limits_file.motor, motor_radians_per_count(rig)
    constant = rig.servo.torque_constant_n_m_per_a
    limits = axis_limits(
        motor,
        constant,
        dt,
        position_warn=math.radians(motor.angle_warn_deg),
        position_stop=math.radians(motor.angle_stop_deg),
        velocity_stop=motor.velocity_stop_rad_per_s,
        force_slew=motor.current_slew_a_per_s * constant,
        encoder_jump_stop=math.radians(motor.encoder_jump_stop_deg),
    )
    return axis.Params(
        metres_per_count=scale,
        estimator=_estimator(rig.servo.encoder, scale, dt),
        limits=limits if in_torque_loop else limits._replace(current_difference_stop=math.inf),
        stop_damping=rig.stop.damping_n_m_s_per_rad,
        stop_ramp=rig.stop.ramp_s,
    )


def _position(session: Session) -> oswec_position.Params:
    authority = session.limits.authority
    return oswec_position.Params(
        session.correction.torques,
        session.correction.deflections,
        2.0 * math.pi * session.rig.instant_correction.filter_hz,
        math.radians(authority.angle_deg),
        authority.velocity_rad_per_s,
    )


def _torque(session: Session) -> torque_tracking.Params:
    constants, feedback = session.constants, session.rig.torque_feedback
    closed = 1.0 if session.file.control == "closed loop" else 0.0
    return torque_tracking.Params(
        constants.torque_positive,
        constants.torque_negative,
        closed * feedback.proportional,
        closed * feedback.integral_per_s,
        session.limits.authority.torque_n_m,
    )


def _limits(limits_file: BenchLimitsFile, in_torque_loop: bool, dt: float) -> Limits:
    load_cell, brake, motor = limits_file.load_cell, limits_file.brake, limits_file.motor
    max_velocity_difference = motor.velocity_difference_stop_rad_per_s
    return Limits(
        slip_stop=math.radians(limits_file.shaft.slip_stop_deg),
        shaft_jump_stop=math.radians(limits_file.shaft.encoder_jump_stop_deg),
        load_stop=LoadLimits(
            load_cell.across_stop_n,
            load_cell.along_stop_n,
            load_cell.bending_stop_n_m,
            load_cell.twisting_stop_n_m,
        ),
        load_age_stop=limits_file.loop.load_cell_age_stop_s,
        brake_difference_stop=brake.difference_stop_a,
        brake_ticks_stop=max(1, round(brake.difference_time_s / dt)),
        velocity_difference_stop=math.inf if in_torque_loop else max_velocity_difference,
        velocity_ticks_stop=max(1, round(motor.velocity_difference_time_s / dt)),
        brake_age_stop=brake.age_stop_s,
        panel_age_stop=limits_file.loop.panel_age_stop_s,
        tare_span_stop=math.radians(limits_file.tare.angle_span_stop_deg),
    )
