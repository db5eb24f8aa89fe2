"""A motor drive's command side: enable, watchdog, faults, current limit, current loop. Pure.

The same for both kinds of heave drive and for surge; what a drive loses is in cots_drive.py and
custom_drive.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.units import Ampere, Code, Flag, Second

ABSURD = 1.0e6  # A: no command, whatever sent it
NO_CEILING = 1.0e9  # A: a bus voltage that limits nothing

NO_FAULT, GENERAL, UNDERVOLTAGE, OVERVOLTAGE = 0, 1, 2, 3


class DriveParams(NamedTuple):
    """Constants of one drive's command side."""

    current_limit: Ampere
    time_constant: Second  # closed current loop, first order
    enable_delay: Second
    watchdog: Second


class DriveState(NamedTuple):
    """What the drive remembers."""

    current: Ampere  # at the end of the step
    mean_current: Ampere  # over the step
    enabled: Flag
    fault: Code  # 0 none, 1 general (silence, absurd command), 2 undervoltage, 3 overvoltage
    waited: Second  # since enable was asked for
    age: Second  # of the last command
    saturated: Flag  # 1: asked for more current than it can give


def at_rest() -> DriveState:
    """Give the state of a drive that is off."""
    return DriveState(0.0, 0.0, 0, 0, 0.0, 0.0, 0)


def drive_step(
    params: DriveParams,
    state: DriveState,
    command: Ampere,
    enable: int,
    fresh: int,
    gate: int,
    trip: int,
    ceiling: Ampere,
    dt: Second,
) -> DriveState:
    """Advance enable logic, watchdog and current loop by one step.

    `fresh` says that a command came since the last step. A command older than the watchdog, or not
    finite, drops the drive out, and so does a `trip` of its bus: fault, no torque; the first fault
    stays until `enable` is taken away. `gate` 0 keeps the power stage off without a fault;
    `ceiling` (A, not negative) is what the bus voltage allows beside the drive's own limit.
    """
    limit, time_constant, enable_delay, watchdog = params
    current, _, was_enabled, fault, waited_before, age, _ = state
    if fresh == 1:
        age = 0.0
    enabled = 0
    waited = 0.0
    if enable == 0:
        fault = 0
    elif fault == 0:
        if age > watchdog or not abs(command) < ABSURD:
            fault = 1
        elif trip != 0:
            fault = trip
        else:
            waited = waited_before + dt
            if was_enabled == 1 or waited > enable_delay:
                enabled = 1
    goal = 0.0
    saturated = 0
    if enabled == 1 and gate == 1:
        limit = min(limit, ceiling)
        goal = command
        if goal > limit:
            goal = limit
            saturated = 1
        elif goal < -limit:
            goal = -limit
            saturated = 1
    # Exact solution of tau di/dt = goal - i, and its mean: the body gets the exact impulse.
    gap = current - goal
    decay = math.exp(-dt / time_constant)
    mean = goal + gap * (1.0 - decay) * time_constant / dt
    return DriveState(goal + gap * decay, mean, enabled, fault, waited, age + dt, saturated)
