"""Limits: trip checks, warnings, and the force that is granted for a demand.

The checks run every tick, on levels, never on events, and in the same tick as the safety machine.
They test finiteness first, because a NaN compares false with every bound.
"""

from enum import IntFlag
from typing import NamedTuple

from controllers.blocks import clamp, finite
from controllers.signals import AxisCommand, AxisSense, DriveFault, Estimate
from rig.realtime.reasons import NO_REASON, Reason
from rig.realtime.safety import ENABLING, RUN, STOP_1


class LimitFlag(IntFlag):
    """Reasons why a demand was not granted in full."""

    CURRENT_PEAK = 1
    CURRENT_RMS = 2  # the mean square reached its limit: continuous current only
    SLEW = 4
    MODE = 8  # the safety machine grants no force
    NOT_FINITE = 16  # the demand was NaN or infinite
    GATED = 32  # the drive's power stage rests below its thresholds
    VELOCITY = 64  # the demand exceeded the greatest velocity that may be commanded


class WarningFlag(IntFlag):
    """Conditions that the operator should look at; the rig does not stop."""

    POSITION = 1


class AxisLimits(NamedTuple):
    """Limits of one powered axis."""

    position_warn: float  # m
    position_stop: float  # m
    velocity_stop: float  # m/s
    current_peak: float  # A
    current_rms: float  # A
    current_rms_time: float  # s, time constant of the mean square
    force_slew: float  # N/s
    encoder_age_stop: float  # s
    encoder_jump_stop: float  # m, between the measured and the estimated position
    drive_age_stop: float  # s
    current_difference_stop: float  # A, between the measured and the commanded current
    current_ticks_stop: int  # ticks for which the difference may last
    newtons_per_ampere: float  # Kt N, from force to drive current


class AxisState(NamedTuple):
    """Memory of the limiter."""

    force: float  # N, granted in the previous tick
    mean_square: float  # A^2
    not_finite: int  # 1: the last demand was not a finite number


def start() -> AxisState:
    """Return the state at switch-on: no force."""
    return AxisState(0.0, 0.0, 0)


def check_axis(
    limits: AxisLimits,
    state: AxisState,
    mismatch: int,
    sense: AxisSense,
    measured: float,
    motion: Estimate,
    mode: int,
) -> int:
    """Return the first trip reason of this axis, the most severe first, or Reason.NONE.

    ``mismatch``: count of `mismatch_ticks`; ``measured``: position (m) by the encoder counts;
    ``motion``: the estimate from them. To the estimator a jump of the counts looks like a velocity,
    and damping would push against it; a drive that does not supply the commanded current supplies
    no damping either. So both checks precede those that allow a controlled stop.
    """
    _, encoder_age, current, enabled, fault, drive_age = sense
    position, velocity, acceleration = motion
    # One sum replaces many tests: it is finite only if every term is.
    total = current + encoder_age + drive_age + position + velocity + acceleration
    if state.not_finite == 1 or not finite(total):
        return Reason.NOT_FINITE.value
    if fault == DriveFault.FIELDBUS_LOST.value:  # the cause of old values comes before them
        return Reason.FIELDBUS_LOST.value
    # A negative age means that a clock is wrong, and then the true age is unknown.
    if not 0.0 <= encoder_age <= limits.encoder_age_stop:
        return Reason.STALE_ENCODER.value
    if not 0.0 <= drive_age <= limits.drive_age_stop:
        return Reason.STALE_DRIVE.value
    if fault != 0:
        return Reason.DRIVE_FAULT.value
    if enabled == 0 and RUN <= mode <= STOP_1:
        return Reason.DRIVE_DROPPED.value
    bound = limits.encoder_jump_stop
    if not -bound <= measured - position <= bound:
        return Reason.ENCODER_JUMP.value
    if mismatch >= limits.current_ticks_stop:
        return Reason.CURRENT_DISAGREES.value
    bound = limits.position_stop
    if not -bound <= position <= bound:
        return Reason.POSITION.value
    bound = limits.velocity_stop
    if not -bound <= velocity <= bound:
        return Reason.VELOCITY.value
    return NO_REASON


def mismatch_ticks(
    limits: AxisLimits, state: AxisState, count: int, sense: AxisSense, saturated: int, mode: int
) -> int:
    """Return the count of ticks in which the drive's current disagrees with its command.

    Each disagreeing tick adds one to ``count`` (the previous result), each agreeing tick subtracts
    one, down to 0: so the passage of both currents through zero hides no fault. The command is that
    of the tick before (``state``). A drive that disagrees in at most half of the ticks, or by less
    than the limit, is not detected. With ``saturated`` 1 (the bus voltage does not suffice) a
    current between zero and the command agrees. Without power the count is 0.
    """
    if sense.enabled == 0 or not RUN <= mode <= STOP_1:
        return 0
    current, commanded = sense.current, state.force / limits.newtons_per_ampere
    if saturated == 1:
        commanded = clamp(current, min(commanded, 0.0), max(commanded, 0.0))
    return count_mismatch(count, current - commanded, limits.current_difference_stop)


def count_mismatch(count: int, difference: float, tolerance: float) -> int:
    """Return ``count`` + 1 for a difference beyond +-``tolerance``, else ``count`` - 1, >= 0."""
    if -tolerance <= difference <= tolerance:
        return max(count - 1, 0)
    return count + 1


def warn_axis(limits: AxisLimits, motion: Estimate) -> int:
    """Return the set of `WarningFlag` values of this axis."""
    bound = limits.position_warn
    if -bound <= motion.position <= bound:
        return 0
    return WarningFlag.POSITION.value


def grant(
    limits: AxisLimits, state: AxisState, demand: float, conducting: int, mode: int, dt: float
) -> tuple[AxisState, AxisCommand]:
    """Return the command for a demanded force (N): by mode, then current limits, then slew.

    Only RUN, STOP_2 and STOP_1 grant a force; ENABLING requests power with zero force; OFF and
    STOP_0 remove force and power in the same tick. With ``conducting`` 0 the drive stays on and
    gives no force. A demand that is not finite is granted as zero, and trips in the next tick.
    """
    granted, mean_square, _ = state
    _, _, _, peak, continuous, rms_time, slew, _, _, _, _, _, scale = limits
    decay = dt / rms_time
    if conducting == 0 or not RUN <= mode <= STOP_1 or not finite(demand):
        decayed = mean_square - decay * mean_square
        return _no_force(decayed, demand, mode)
    force, limited = demand, 0
    rms_exceeded = mean_square >= continuous * continuous
    ceiling = scale * (continuous if rms_exceeded else peak)
    if not -ceiling <= force <= ceiling:
        force = ceiling if force > 0.0 else -ceiling
        limited = (LimitFlag.CURRENT_RMS if rms_exceeded else LimitFlag.CURRENT_PEAK).value
    # The slew limit comes last: the force must not jump when the current folds back to continuous.
    change = slew * dt
    if force > granted + change:
        force = granted + change
        limited = limited | LimitFlag.SLEW.value
    elif force < granted - change:
        force = granted - change
        limited = limited | LimitFlag.SLEW.value
    current = force / scale
    mean_square = mean_square + decay * (current * current - mean_square)
    return AxisState(force, mean_square, 0), AxisCommand(force, current, 1, limited)


def _no_force(mean_square: float, demand: float, mode: int) -> tuple[AxisState, AxisCommand]:
    """Return zero force with the reason: mode, demand not finite, or power stage at rest."""
    if not RUN <= mode <= STOP_1:
        limited = 0 if demand == 0.0 else LimitFlag.MODE.value
        enable = 1 if mode == ENABLING else 0
        return AxisState(0.0, mean_square, 0), AxisCommand(0.0, 0.0, enable, limited)
    if not finite(demand):
        return AxisState(0.0, mean_square, 1), AxisCommand(0.0, 0.0, 1, LimitFlag.NOT_FINITE.value)
    return AxisState(0.0, mean_square, 0), AxisCommand(0.0, 0.0, 1, LimitFlag.GATED.value)
