"""Trip checks of the bench, evaluated every tick.

Checks whose reason allows no controlled stop (stop category 0) come first.
"""

from controllers.blocks import finite
from controllers.signals import AxisSense, DriveFault
from rig.kinds.oswec_bench.tick.reasons import BenchReason
from rig.kinds.oswec_bench.tick.signals import Motion, Sense, WrenchSense
from rig.kinds.oswec_bench.tick.state import LoadLimits, Params, State, zeros_in_use
from rig.realtime import axis
from rig.realtime.reasons import NO_REASON, Reason
from rig.realtime.safety import CATEGORY


def motor_sense(sense: Sense) -> AxisSense:
    """Return encoder and servo readings in the form of an axis."""
    encoders, servo, _, _, _ = sense
    current, enabled, fault, age = servo
    # The drive's own number of an error, which may be negative, is a fault of the drive.
    general = DriveFault.GENERAL.value if fault != 0 else 0
    return AxisSense(encoders.motor_counts, encoders.age, current, enabled, general, age)


def check(params: Params, state: State, sense: Sense, motion: Motion, mode: int) -> int:
    """Return the first reason to trip, or NONE.

    Reasons that allow no controlled stop come before all others.
    """
    encoders, _, load, brake, panel = sense
    motor, shaft = motion
    limits, tare_state = params.limits, state.tare
    e_stop, _, panel_age = panel
    if e_stop != 0:
        return Reason.EMERGENCY_STOP.value
    load_age = load.age
    current, brake_age = brake
    x, v, a = shaft
    # One sum replaces many tests: it is finite only if every term is finite.
    total = load.fx + load.fy + load.fz + load.tx + load.ty + load.tz + load_age
    total = total + current + brake_age + panel_age + x + v + a
    if state.speed.not_finite == 1 or not finite(total):
        return Reason.NOT_FINITE.value
    motor_zero, shaft_zero = zeros_in_use(params, state, encoders)
    fault = axis.check(params.motor, state.motor, motor_sense(sense), motor, motor_zero, mode)
    if fault != NO_REASON and CATEGORY[fault] == 0:
        return fault
    most = limits.shaft_jump_stop
    measured = encoders.shaft_counts * params.shaft.radians_per_count - shaft_zero
    excess_age = encoders.age - state.motor.min_age
    if excess_age > 0.0:  # extrapolate the estimate to the present
        measured = measured + excess_age * (v - 0.5 * excess_age * a)
    if not -most <= measured - x <= most:
        return BenchReason.SHAFT_ENCODER_JUMP.value
    most = limits.slip_stop
    if not -most <= motor.position - x <= most:
        return BenchReason.COUPLING_SLIP.value
    if exceeds_range(load, limits.load_stop):
        return BenchReason.LOAD_CELL_OVERLOAD.value
    if state.mismatch >= limits.velocity_ticks_stop:
        return BenchReason.VELOCITY_DISAGREES.value
    if state.motor_power.reason != NO_REASON:
        return state.motor_power.reason
    if fault != NO_REASON:
        return fault
    if panel.limit_switch != 0:
        return Reason.LIMIT_SWITCH.value
    if not 0.0 <= panel_age <= limits.panel_age_stop:  # an age below 0 means that a clock is wrong
        return Reason.STALE_PANEL.value
    if not 0.0 <= load_age <= limits.load_age_stop:
        return BenchReason.STALE_LOAD_CELL.value
    if not 0.0 <= brake_age <= limits.brake_age_stop:
        return BenchReason.STALE_BRAKE.value
    if state.brake.mismatch_ticks >= limits.brake_ticks_stop:
        return BenchReason.BRAKE_LOST.value
    if tare_state.samples > 0 and tare_state.highest - tare_state.lowest > limits.tare_span_stop:
        return Reason.NOT_CALM.value
    return NO_REASON


def exceeds_range(load: WrenchSense, bounds: LoadLimits) -> bool:
    """Return True if a force or a torque of the load cell lies outside its range."""
    lateral, axial, bending, torsion = bounds
    return not (
        -lateral <= load.fx <= lateral
        and -lateral <= load.fy <= lateral
        and -axial <= load.fz <= axial
        and -bending <= load.tx <= bending
        and -bending <= load.ty <= bending
        and -torsion <= load.tz <= torsion
    )
