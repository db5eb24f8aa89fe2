"""Limits: what trips the rig, what is only warned of, and what force is granted.

Checks run every tick on levels, never on events, and in the same tick as the safety machine.
Finiteness comes first: a NaN compares false with every bound.
"""

from enum import IntFlag
from typing import NamedTuple

from controllers.blocks import finite
from controllers.signals import AxisCommand, AxisSense, Estimate
from rig.safety import ENABLING, FINE, RUN, STOP_1, Reason


class Limited(IntFlag):
    """Why a demand was not granted in full."""

    CURRENT_PEAK = 1
    CURRENT_RMS = 2  # the mean square is used up: held at the continuous current
    SLEW = 4
    MODE = 8  # the safety machine grants no force
    NOT_FINITE = 16  # the demand was NaN or infinite


class Warned(IntFlag):
    """What the operator should look at; nothing stops."""

    POSITION = 1
    ANALYSER_AGE = 2


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
    drive_age_stop: float  # s
    newtons_per_ampere: float  # Kt N, from force to drive current


class AxisState(NamedTuple):
    """Memory of the limiter."""

    force: float  # N, granted in the tick before
    mean_square: float  # A^2
    absurd: int  # 1: the last demand was not a finite number


def start() -> AxisState:
    """State at switch-on: no force."""
    return AxisState(0.0, 0.0, 0)


def magnitude(value: float) -> float:
    """|value|."""
    return -value if value < 0.0 else value


def check_axis(
    limits: AxisLimits, state: AxisState, sense: AxisSense, motion: Estimate, mode: int
) -> int:
    """The first reason to trip on this axis, worst first, or Reason.NONE."""
    # One sum instead of many tests: it is finite only if every term is.
    total = sense.current + sense.encoder_age + sense.drive_age
    total = total + motion.position + motion.velocity + motion.acceleration
    if state.absurd == 1 or not finite(total):
        return Reason.NOT_FINITE.value
    if sense.encoder_age > limits.encoder_age_stop:
        return Reason.STALE_ENCODER.value
    if sense.drive_age > limits.drive_age_stop:
        return Reason.STALE_DRIVE.value
    if sense.fault != 0:
        return Reason.DRIVE_FAULT.value
    if sense.enabled == 0 and RUN <= mode <= STOP_1:
        return Reason.DRIVE_DROPPED.value
    if magnitude(motion.position) > limits.position_stop:
        return Reason.POSITION.value
    if magnitude(motion.velocity) > limits.velocity_stop:
        return Reason.VELOCITY.value
    return FINE


def warn_axis(limits: AxisLimits, motion: Estimate) -> int:
    """The set of `Warned` flags of this axis."""
    if magnitude(motion.position) > limits.position_warn:
        return Warned.POSITION.value
    return 0


def grant(
    limits: AxisLimits, state: AxisState, demand: float, mode: int, dt: float
) -> tuple[AxisState, AxisCommand]:
    """The command for a demanded force (N): by mode, then peak or continuous current, then slew.

    Only RUN, STOP_2 and STOP_1 grant a force; ENABLING asks the drive on with zero force; OFF and
    STOP_0 remove force and power in this very tick. A demand that is not finite is granted as
    nothing, and trips in the next tick.
    """
    decay = dt / limits.current_rms_time
    cooled = state.mean_square - decay * state.mean_square
    if not RUN <= mode <= STOP_1:
        enable = 1 if mode == ENABLING else 0
        limited = 0 if demand == 0.0 else Limited.MODE.value
        return AxisState(0.0, cooled, 0), AxisCommand(0.0, 0.0, enable, limited)
    if not finite(demand):
        return AxisState(0.0, cooled, 1), AxisCommand(0.0, 0.0, 1, Limited.NOT_FINITE.value)
    limited = 0
    force = demand
    ceiling = limits.current_peak * limits.newtons_per_ampere
    spent = state.mean_square >= limits.current_rms * limits.current_rms
    if spent:
        ceiling = limits.current_rms * limits.newtons_per_ampere
    if magnitude(force) > ceiling:
        force = ceiling if force > 0.0 else -ceiling
        limited = (Limited.CURRENT_RMS if spent else Limited.CURRENT_PEAK).value
    # Last, so that the force does not jump when the current folds back from peak to continuous.
    step = limits.force_slew * dt
    if force > state.force + step:
        force = state.force + step
        limited = limited | Limited.SLEW.value
    elif force < state.force - step:
        force = state.force - step
        limited = limited | Limited.SLEW.value
    current = force / limits.newtons_per_ampere
    mean_square = state.mean_square + decay * (current * current - state.mean_square)
    return AxisState(force, mean_square, 0), AxisCommand(force, current, 1, limited)
