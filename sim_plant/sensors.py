"""Sensor errors: bias, white noise from a fixed table, resolution, lag of the forces. Pure.

The World's delay line models the rig's fieldbus delay; analyser.py models the power analyser's
window.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.units import Count, CountPerMetre, Newton, Second

NOISE_LENGTH = 131072  # length of the noise table, a power of two: odd strides visit every entry
NOISE_MASK = NOISE_LENGTH - 1
MAX_READING = 1.0e9  # a larger value of any channel means that the run has diverged


class Channel(NamedTuple):
    """Errors of one analog channel in its own unit; resolution 0 means no quantisation."""

    bias: float
    noise: float  # standard deviation of one sample
    resolution: float
    stride: int  # odd, different per channel: step through the noise table per tick
    offset: int


class SensorParams(NamedTuple):
    """Scale of the encoders and errors of the analog channels."""

    counts_per_metre: CountPerMetre
    count_offset: Count
    surge_offset: Count
    current: Channel
    surge_current: Channel
    string_pot: Channel
    force_lcb: Channel
    force_trs: Channel
    force_slew: Channel
    force_stator_a: Channel
    force_stator_b: Channel
    rotor_angle: Channel
    heave_force_lag: Second  # time constant of the amplifiers of column load cell and torque sensor


class HeaveForces(NamedTuple):
    """Forces on the body as their amplifiers pass them on."""

    lcb: Newton
    trs: Newton


def amplify(
    lag: Second, last: HeaveForces, column: Newton, shaft: Newton, dt: Second
) -> HeaveForces:
    """Return the forces behind amplifiers of first order, one step later; lag 0 changes no bit.

    The lag is in no reading's age, as a filter in a strain amplifier is not.
    """
    if not lag > 0.0:
        return HeaveForces(column, shaft)
    kept = lag / (lag + dt)
    return HeaveForces(column + kept * (last.lcb - column), shaft + kept * (last.trs - shaft))


def measure(channel: Channel, value: float, tick: int, normals: Sequence[float]) -> float:
    """Return the reading of a channel at a tick; a value that is not finite is returned unchanged.

    The length of `normals` is a power of two, so that a mask wraps the index.
    """
    if not abs(value) < MAX_READING:
        return value
    bias, noise, resolution, stride, offset = channel
    reading = value + bias + noise * normals[(tick * stride + offset) & (len(normals) - 1)]
    if resolution > 0.0:
        return math.floor(reading / resolution + 0.5) * resolution
    return reading


def encoder_count(scale: float, offset: int, value: float) -> Count:
    """Return the encoder count at a position, rounded to nearest; 0 for a diverged value."""
    scaled = scale * value + 0.5
    if not abs(scaled) < MAX_READING:
        return 0
    return math.floor(scaled) + offset
