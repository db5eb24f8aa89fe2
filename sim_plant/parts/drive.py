"""A motor drive's command side: enable, watchdog, faults, current limit, current loop. Pure.

Both kinds of heave drive and the surge drive use it. The losses are in cots_drive.py and
custom_drive.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.units import Ampere, Code, Flag, Second

MAX_PLAUSIBLE_CURRENT = 1.0e6  # A: a larger command is invalid, whatever its source
UNLIMITED_CURRENT = 1.0e9  # A: the current limit of a bus voltage that does not limit

NO_FAULT, GENERAL_FAULT, UNDERVOLTAGE, OVERVOLTAGE = 0, 1, 2, 3


class DriveParams(NamedTuple):
    """Parameters of one drive's command side."""

    current_limit: Ampere
    time_constant: Second  # closed current loop, first order
    enable_delay: Second
    watchdog: Second


class DriveState(NamedTuple):
    """State of the drive."""

    current: Ampere  # at the end of the step
    mean_current: Ampere  # over the step
    enabled: Flag
    fault: Code  # 0 none, 1 general (no or no plausible command), 2 undervoltage, 3 overvoltage
    enable_time: Second  # since the enable request
    command_age: Second  # of the last command
    saturated: Flag  # 1: the commanded current exceeds the limit


def initial() -> DriveState:
    """Return the state of a drive that is off."""
    return DriveState(0.0, 0.0, 0, 0, 0.0, 0.0, 0)


def drive_step(
    params: DriveParams,
    state: DriveState,
    command: Ampere,
    enable: int,
    fresh: int,
    gate: int,
    trip: int,
    max_current: Ampere,
    dt: Second,
) -> DriveState:
    """Advance enable logic, watchdog and current loop by one step.

    `fresh` is 1 if a command arrived since the last step. The drive goes into fault, without
    torque, if the command is older than the watchdog time or not finite, or if its bus reports a
    `trip`; the first fault stays until `enable` is 0. `gate` 0 keeps the power stage off without a
    fault. `max_current` (A, not negative) is the current that the bus voltage allows; the drive's
    own limit applies as well.
    """
    limit, time_constant, enable_delay, watchdog = params
    current, _, was_enabled, fault, previous_enable_time, age, _ = state
    if fresh == 1:
        age = 0.0
    enabled = 0
    enable_time = 0.0
    if enable == 0:
        fault = 0
    elif fault == 0:
        if age > watchdog or not abs(command) < MAX_PLAUSIBLE_CURRENT:
            fault = 1
        elif trip != 0:
            fault = trip
        else:
            enable_time = previous_enable_time + dt
            if was_enabled == 1 or enable_time > enable_delay:
                enabled = 1
    target = 0.0
    saturated = 0
    if enabled == 1 and gate == 1:
        limit = min(limit, max_current)
        target = command
        if target > limit:
            target = limit
            saturated = 1
        elif target < -limit:
            target = -limit
            saturated = 1
    # Exact solution of tau di/dt = target - i, and its mean: the body receives the exact impulse.
    error = current - target
    decay = math.exp(-dt / time_constant)
    mean = target + error * (1.0 - decay) * time_constant / dt
    return DriveState(
        target + error * decay, mean, enabled, fault, enable_time, age + dt, saturated
    )
