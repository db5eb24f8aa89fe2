"""What trips the bench: every check of a tick, those that allow no controlled stop first."""

from controllers.blocks import finite
from controllers.signals import AxisSense
from rig.kinds.oswec_bench.signals import Motion, Sense, WrenchSense
from rig.kinds.oswec_bench.state import LoadLimits, Params, State, zeros
from rig.realtime import axis
from rig.realtime.safety import CATEGORY, FINE, Reason


def motor_sense(sense: Sense) -> AxisSense:
    """Encoder and servo as the axis that they are."""
    encoders, servo, _, _, _ = sense
    current, enabled, fault, age = servo
    return AxisSense(encoders.motor_counts, encoders.age, current, enabled, fault, age)


def check(params: Params, state: State, sense: Sense, motion: Motion, mode: int) -> int:
    """The first reason to trip, those that allow no controlled stop before others, or NONE."""
    encoders, _, load, brake, panel = sense
    motor, shaft = motion
    limits, tared = params.limits, state.tare
    e_stop, _, panel_age = panel
    if e_stop != 0:
        return Reason.EMERGENCY_STOP.value
    fx, fy, fz, tx, ty, tz, load_age = load
    current, brake_age = brake
    x, v, a = shaft
    # One sum instead of many tests: it is finite only if every term is.
    told = fx + fy + fz + tx + ty + tz + load_age + current + brake_age + panel_age + x + v + a
    if state.speed.absurd == 1 or not finite(told):
        return Reason.NOT_FINITE.value
    zero, shaft_zero = zeros(params, state, encoders)
    powers = state.stations.reason
    fault = axis.check(params.motor, state.motor, motor_sense(sense), motor, zero, mode)
    if fault != FINE and CATEGORY[fault] == 0:
        return fault
    most = limits.shaft_jump_stop
    measured = encoders.shaft_counts * params.shaft.radians_per_count - shaft_zero
    late = encoders.age - state.motor.min_age
    if late > 0.0:  # where the shaft is by now
        measured = measured + late * (v - 0.5 * late * a)
    if not -most <= measured - x <= most:
        return Reason.SHAFT_ENCODER_JUMP.value
    most = limits.slip_stop
    if not -most <= motor.position - x <= most:
        return Reason.COUPLING_SLIP.value
    if overloaded(load, limits.load_stop):
        return Reason.LOAD_CELL_OVERLOAD.value
    if state.mismatch >= limits.velocity_ticks_stop:
        return Reason.VELOCITY_DISAGREES.value
    if powers != FINE:
        return powers
    if fault != FINE:
        return fault
    if panel.limit_switch != 0:
        return Reason.LIMIT_SWITCH.value
    if not 0.0 <= panel_age <= limits.panel_age_stop:  # below 0: a clock is wrong
        return Reason.STALE_PANEL.value
    if not 0.0 <= load_age <= limits.load_age_stop:
        return Reason.STALE_LOAD_CELL.value
    if not 0.0 <= brake_age <= limits.brake_age_stop:
        return Reason.STALE_BRAKE.value
    if state.brake.mismatch_ticks >= limits.brake_ticks_stop:
        return Reason.BRAKE_LOST.value
    if tared.samples > 0 and tared.highest - tared.lowest > limits.tare_span_stop:
        return Reason.NOT_CALM.value
    return FINE


def overloaded(load: WrenchSense, most: LoadLimits) -> bool:
    """True if a force or a torque of the load cell is beyond its range."""
    fx, fy, fz, tx, ty, tz, _ = load
    across, along, bending, twisting = most
    return not (
        -across <= fx <= across
        and -across <= fy <= across
        and -along <= fz <= along
        and -bending <= tx <= bending
        and -bending <= ty <= bending
        and -twisting <= tz <= twisting
    )
