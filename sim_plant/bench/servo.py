"""Velocity set point of the servo drive. Pure.

The model describes the velocity loop by its behaviour: the motor follows the drive's set point
within a time constant as far as the current allows. Without load, for which the loop was not tuned
(an assumption of the OSWEC thesis, 3.2.2), it deviates in two ways, both chosen after the thesis'
Figs. 3.5 and 3.7:
- late cut-in: while the command grows, the set point lags by a threshold that closes slowly; when
  the command falls, the set point waits until the command reaches it and then follows it;
- droop: friction reduces the speed, mostly at low speed, so small oscillations come out smaller.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.sensors import NOISE_MASK
from sim_plant.units import (
    Flag,
    NewtonMetre,
    RadianPerSecond,
    RadianPerSecondPerVolt,
    Ratio,
    Second,
    Volt,
)

STRIDE, OFFSET = 37, 70001  # step of the reversals through the noise table


class ServoParams(NamedTuple):
    """Parameters of the velocity loop."""

    gain: RadianPerSecondPerVolt  # at the gearbox output
    offset: Volt  # of the analog input: causes position drift
    range: Volt
    resolution: Volt
    time_constant: Second
    cut_in: RadianPerSecond  # lag of the set point without load
    cut_in_spread: Ratio  # standard deviation of the lag from reversal to reversal
    cut_in_closing: Second
    droop: RadianPerSecond  # speed loss by friction at high speed, without load
    droop_speed: RadianPerSecond  # speed at which most of the droop is reached
    tuned_load: NewtonMetre  # mean torque above which neither effect remains
    load_window: Second  # averaging time of that mean


class ServoState(NamedTuple):
    """Set point of the velocity loop, and the state of its lag."""

    set_point: RadianPerSecond
    reversals: int
    lag: RadianPerSecond  # threshold since the last reversal
    load: NewtonMetre  # running mean of the torque magnitude


def initial(params: ServoParams) -> ServoState:
    """Return the state before any command."""
    return ServoState(0.0, 0, params.cut_in, 0.0)


def commanded_velocity(params: ServoParams, command: Volt) -> RadianPerSecond:
    """Return the velocity that the analog input commands; 0 for an invalid voltage."""
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
    last, reversals, lag, mean = state
    mean += (abs(load) - mean) * min(dt / params.load_window, 1.0)
    if enabled == 0:
        return ServoState(0.0, reversals, lag, mean)
    light_load = max(0.0, 1.0 - mean / params.tuned_load)
    commanded = commanded_velocity(params, command)
    commanded -= light_load * params.droop * math.tanh(commanded / params.droop_speed)
    if commanded * last < 0.0 or (last == 0.0 and commanded != 0.0):
        reversals += 1
        normal = normals[(reversals * STRIDE + OFFSET) & NOISE_MASK]
        lag = max(params.cut_in * (1.0 + params.cut_in_spread * normal), 0.0)
        last = 0.0
    if abs(commanded) <= abs(last):
        return ServoState(commanded, reversals, lag, mean)
    increment = abs(commanded) - abs(last)
    followed = max(increment * min(dt / params.cut_in_closing, 1.0), increment - light_load * lag)
    magnitude = abs(last) + followed
    return ServoState(magnitude if commanded > 0.0 else -magnitude, reversals, lag, mean)
