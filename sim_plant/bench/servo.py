"""The servo drive: enable and watchdog, velocity set point, current of either loop. Pure.

The velocity loop is modelled by what it does: the motor follows the drive's set point within a
time constant as far as the current allows. Without load, for which it was not tuned (so the OSWEC
thesis supposes, 3.2.2), it falls short in two ways, both choices after its Figs. 3.5 and 3.7:
- it cuts in late: while the command grows the set point keeps behind by a threshold, closing
  slowly; when the command falls it waits for it and goes as told;
- it droops: friction costs speed, most of it at low speed, so small oscillations come out smaller.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.sensors import MASK
from sim_plant.units import (
    Flag,
    NewtonMetre,
    RadianPerSecond,
    RadianPerSecondPerVolt,
    Ratio,
    Second,
    Volt,
)

STRIDE, OFFSET = 37, 70001  # how the reversals walk through the table of normals


class ServoParams(NamedTuple):
    """Constants of the velocity loop."""

    gain: RadianPerSecondPerVolt  # at the gearbox output
    offset: Volt  # of the analog input: what makes positions drift
    range: Volt
    resolution: Volt
    time_constant: Second
    cut_in: RadianPerSecond  # how far the set point keeps behind without load
    cut_in_spread: Ratio  # its standard deviation from reversal to reversal
    cut_in_closing: Second
    droop: RadianPerSecond  # what friction costs at high speed, without load
    droop_speed: RadianPerSecond  # where most of it has come about
    tuned_load: NewtonMetre  # mean torque from which neither is left
    load_window: Second  # over which that mean is taken


class ServoState(NamedTuple):
    """Set point of the velocity loop and what its delay depends on."""

    wanted: RadianPerSecond
    reversals: int
    behind: RadianPerSecond  # the threshold since the last reversal
    load: NewtonMetre  # running mean of the torque without its sign


def at_rest(params: ServoParams) -> ServoState:
    """Give the drive before any command."""
    return ServoState(0.0, 0, params.cut_in, 0.0)


def commanded(params: ServoParams, command: Volt) -> RadianPerSecond:
    """Give the velocity that the analog input asks for; 0 for what is no number."""
    volts = command
    if not abs(volts) < 1.0e6:
        return 0.0
    volts = max(-params.range, min(volts, params.range))
    if params.resolution > 0.0:
        volts = math.floor(volts / params.resolution + 0.5) * params.resolution
    return params.gain * (volts + params.offset)


def step(
    params: ServoParams,
    state: ServoState,
    command: Volt,
    enabled: Flag,
    load: NewtonMetre,
    normals: Sequence[float],
    dt: Second,
) -> ServoState:
    """Advance the set point by dt."""
    last, reversals, behind, mean = state
    mean += (abs(load) - mean) * min(dt / params.load_window, 1.0)
    if enabled == 0:
        return ServoState(0.0, reversals, behind, mean)
    light = max(0.0, 1.0 - mean / params.tuned_load)
    asked = commanded(params, command)
    asked -= light * params.droop * math.tanh(asked / params.droop_speed)
    if asked * last < 0.0 or (last == 0.0 and asked != 0.0):
        reversals += 1
        normal = normals[(reversals * STRIDE + OFFSET) & MASK]
        behind = max(params.cut_in * (1.0 + params.cut_in_spread * normal), 0.0)
        last = 0.0
    if abs(asked) <= abs(last):
        return ServoState(asked, reversals, behind, mean)
    ahead = abs(asked) - abs(last)
    closed = max(ahead * min(dt / params.cut_in_closing, 1.0), ahead - light * behind)
    wanted = abs(last) + closed
    return ServoState(wanted if asked > 0.0 else -wanted, reversals, behind, mean)
