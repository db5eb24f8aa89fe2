"""Limits: what trips the rig, what is only warned of, and what force is granted.

Checks run every tick on levels, never on events, and in the same tick as the safety machine.
Finiteness comes first: a NaN compares false with every bound.
"""

from enum import IntFlag
from typing import NamedTuple

from controllers.blocks import clamp, finite
from controllers.signals import AxisCommand, AxisSense, Estimate
from rig.realtime.safety import ENABLING, FINE, RUN, STOP_1, Reason


class Limited(IntFlag):
    """Why a demand was not granted in full."""

    CURRENT_PEAK = 1
    CURRENT_RMS = 2  # the mean square is used up: held at the continuous current
    SLEW = 4
    MODE = 8  # the safety machine grants no force
    NOT_FINITE = 16  # the demand was NaN or infinite
    GATED = 32  # the drive's power stage rests below its thresholds
    VELOCITY = 64  # the greatest velocity that may be commanded


class Warned(IntFlag):
    """What the operator should look at; nothing stops."""

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
    encoder_jump_stop: float  # m, between what was measured and what the estimate says
    drive_age_stop: float  # s
    current_difference_stop: float  # A, between the measured and the commanded current
    current_ticks_stop: int  # ticks that the difference may last
    newtons_per_ampere: float  # Kt N, from force to drive current


class AxisState(NamedTuple):
    """Memory of the limiter."""

    force: float  # N, granted in the tick before
    mean_square: float  # A^2
    absurd: int  # 1: the last demand was not a finite number


def start() -> AxisState:
    """State at switch-on: no force."""
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
    """The first reason to trip on this axis, worst first, or Reason.NONE.

    ``mismatch`` as `mismatch_ticks` counts; ``measured`` is the position (m) that the counts say,
    ``motion`` what was made of it. A jump of the counts looks like a velocity to the estimator, and
    damping would push against it; a drive that does not give the commanded current gives no damping
    either: so both come before what allows a controlled stop.
    """
    _, encoder_age, current, enabled, fault, drive_age = sense
    position, velocity, acceleration = motion
    # One sum instead of many tests: it is finite only if every term is.
    total = current + encoder_age + drive_age + position + velocity + acceleration
    if state.absurd == 1 or not finite(total):
        return Reason.NOT_FINITE.value
    # An age below zero comes of a clock that is wrong: how old the value is, nobody knows.
    if not 0.0 <= encoder_age <= limits.encoder_age_stop:
        return Reason.STALE_ENCODER.value
    if not 0.0 <= drive_age <= limits.drive_age_stop:
        return Reason.STALE_DRIVE.value
    if fault != 0:
        return Reason.DRIVE_FAULT.value
    if enabled == 0 and RUN <= mode <= STOP_1:
        return Reason.DRIVE_DROPPED.value
    most = limits.encoder_jump_stop
    if not -most <= measured - position <= most:
        return Reason.ENCODER_JUMP.value
    if mismatch >= limits.current_ticks_stop:
        return Reason.CURRENT_DISAGREES.value
    most = limits.position_stop
    if not -most <= position <= most:
        return Reason.POSITION.value
    most = limits.velocity_stop
    if not -most <= velocity <= most:
        return Reason.VELOCITY.value
    return FINE


def mismatch_ticks(
    limits: AxisLimits, state: AxisState, before: int, sense: AxisSense, saturated: int, mode: int
) -> int:
    """Ticks in which the drive's current disagreed with its command, less those in which not.

    The command is that of the tick before (``state``), ``before`` this count until now. Ticks that
    agree count down to 0, so the passage of both currents through zero hides nothing. A drive that
    disagrees in no more than half of the ticks, or by less than the limit, is not found. Under
    ``saturated`` 1, a bus voltage that does not suffice, a current between zero and the command
    agrees. Without power there is nothing to count.
    """
    if sense.enabled == 0 or not RUN <= mode <= STOP_1:
        return 0
    current, commanded = sense.current, state.force / limits.newtons_per_ampere
    if saturated == 1:
        commanded = clamp(current, min(commanded, 0.0), max(commanded, 0.0))
    return counted(before, current - commanded, limits.current_difference_stop)


def counted(before: int, difference: float, most: float) -> int:
    """``before`` and one more for a difference beyond ``most`` either way, else one less, to 0."""
    if -most <= difference <= most:
        return max(before - 1, 0)
    return before + 1


def warn_axis(limits: AxisLimits, motion: Estimate) -> int:
    """The set of `Warned` flags of this axis."""
    bound = limits.position_warn
    if -bound <= motion.position <= bound:
        return 0
    return Warned.POSITION.value


def grant(
    limits: AxisLimits, state: AxisState, demand: float, conducting: int, mode: int, dt: float
) -> tuple[AxisState, AxisCommand]:
    """The command for a demanded force (N): by mode, then peak or continuous current, then slew.

    Only RUN, STOP_2 and STOP_1 grant a force; ENABLING asks the drive on with zero force; OFF and
    STOP_0 remove force and power in this very tick. With ``conducting`` 0 the drive stays on and
    gives no force. A demand that is not finite is granted as nothing, and trips in the next tick.
    """
    granted, mean_square, _ = state
    _, _, _, peak, continuous, rms_time, slew, _, _, _, _, _, scale = limits
    decay = dt / rms_time
    if conducting == 0 or not RUN <= mode <= STOP_1 or not finite(demand):
        cooled = mean_square - decay * mean_square
        return _nothing(cooled, demand, mode)
    force, limited = demand, 0
    spent = mean_square >= continuous * continuous
    ceiling = scale * (continuous if spent else peak)
    if not -ceiling <= force <= ceiling:
        force = ceiling if force > 0.0 else -ceiling
        limited = (Limited.CURRENT_RMS if spent else Limited.CURRENT_PEAK).value
    # Last, so that the force does not jump when the current folds back from peak to continuous.
    change = slew * dt
    if force > granted + change:
        force = granted + change
        limited = limited | Limited.SLEW.value
    elif force < granted - change:
        force = granted - change
        limited = limited | Limited.SLEW.value
    current = force / scale
    mean_square = mean_square + decay * (current * current - mean_square)
    return AxisState(force, mean_square, 0), AxisCommand(force, current, 1, limited)


def _nothing(mean_square: float, demand: float, mode: int) -> tuple[AxisState, AxisCommand]:
    """No force, and why: by the mode, or the demand is no number, or the power stage rests."""
    if not RUN <= mode <= STOP_1:
        limited = 0 if demand == 0.0 else Limited.MODE.value
        enable = 1 if mode == ENABLING else 0
        return AxisState(0.0, mean_square, 0), AxisCommand(0.0, 0.0, enable, limited)
    if not finite(demand):
        return AxisState(0.0, mean_square, 1), AxisCommand(0.0, 0.0, 1, Limited.NOT_FINITE.value)
    return AxisState(0.0, mean_square, 0), AxisCommand(0.0, 0.0, 1, Limited.GATED.value)
