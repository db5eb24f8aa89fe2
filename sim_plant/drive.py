"""The commercial motor drive: enable, watchdog, current loop, losses, power analyser. Pure.

Power absorbed from the waves is negative at every station.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.units import (
    Ampere,
    Flag,
    Ohm,
    Second,
    Volt,
    Watt,
    WattPerAmpere,
    WattPerAmpereSquared,
)

ABSURD = 1.0e6  # A: no command, whatever sent it


class DriveParams(NamedTuple):
    """Drive constants."""

    current_limit: Ampere
    time_constant: Second  # closed current loop, first order
    enable_delay: Second
    watchdog: Second
    fixed_loss: Watt  # logic and fans: drawn with the power stage on or off
    linear_loss: WattPerAmpere
    square_loss: WattPerAmpereSquared
    bus_voltage: Volt
    bus_resistance: Ohm
    analyser_window: Second


class DriveState(NamedTuple):
    """What the drive remembers."""

    current: Ampere  # at the end of the step
    mean_current: Ampere  # over the step
    enabled: Flag
    fault: Flag
    waited: Second  # since enable was asked for
    age: Second  # of the last command


class AnalyserState(NamedTuple):
    """Power analyser: running sums of the open window and the last published means."""

    sum_ac: Watt
    sum_dc: Watt
    samples: int
    power_ac: Watt
    power_dc: Watt
    age: Second


def drive_step(
    params: DriveParams, state: DriveState, command: Ampere, enable: int, fresh: int, dt: Second
) -> DriveState:
    """Advance enable logic, watchdog and current loop by one step.

    `fresh` says that a command came since the last step. A command older than the watchdog, or not
    finite, drops the drive out: fault, no torque; taking `enable` away clears the fault.
    """
    limit, time_constant, enable_delay, watchdog, _, _, _, _, _, _ = params
    current, _, was_enabled, fault, waited_before, age = state
    if fresh == 1:
        age = 0.0
    enabled = 0
    waited = 0.0
    if enable == 0:
        fault = 0
    elif age > watchdog or not abs(command) < ABSURD:
        fault = 1
    elif fault == 0:
        waited = waited_before + dt
        if was_enabled == 1 or waited > enable_delay:
            enabled = 1
    goal = 0.0
    if enabled == 1:
        goal = command
        if goal > limit:
            goal = limit
        elif goal < -limit:
            goal = -limit
    # Exact solution of tau di/dt = goal - i, and its mean: the body gets the exact impulse.
    gap = current - goal
    decay = math.exp(-dt / time_constant)
    mean = goal + gap * (1.0 - decay) * time_constant / dt
    return DriveState(goal + gap * decay, mean, enabled, fault, waited, age + dt)


def drive_loss(params: DriveParams, current: Ampere) -> Watt:
    """Give the loss between the drive's DC and AC terminals, W: 30 + 3.6 |i| + 0.02 i²."""
    size = abs(current)
    return params.fixed_loss + (params.linear_loss + params.square_loss * size) * size


def bus_voltage(params: DriveParams, power_dc: Watt) -> Volt:
    """Give the DC bus voltage: supply voltage less the drop of its source resistance."""
    return params.bus_voltage - params.bus_resistance * power_dc / params.bus_voltage


def analyser_step(
    params: DriveParams, state: AnalyserState, power_ac: Watt, power_dc: Watt, dt: Second
) -> AnalyserState:
    """Add one step to the analyser's window; publish the means when the window is full."""
    sum_ac, sum_dc, samples, last_ac, last_dc, age = state
    sum_ac = sum_ac + power_ac
    sum_dc = sum_dc + power_dc
    samples = samples + 1
    if (samples + 0.5) * dt > params.analyser_window:
        return AnalyserState(0.0, 0.0, 0, sum_ac / samples, sum_dc / samples, 0.0)
    return AnalyserState(sum_ac, sum_dc, samples, last_ac, last_dc, age + dt)
