"""Sensor errors: bias, white noise from a fixed table, resolution. Pure.

The rig's fieldbus delay is the World's delay line; the power analyser's own window is in drive.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.units import Count, CountPerMetre

NORMALS = 131072  # length of the noise table, a power of two: odd strides visit every entry
MASK = NORMALS - 1
FINITE = 1.0e9  # larger values of any channel mean a diverged run


class Channel(NamedTuple):
    """Errors of one analog channel in its own unit; resolution 0 means none."""

    bias: float
    noise: float  # standard deviation of one sample
    resolution: float
    stride: int  # odd, different per channel: how it walks through the noise table
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


def measure(channel: Channel, value: float, tick: int, normals: Sequence[float]) -> float:
    """Give what the channel reads at a tick; a value that is not finite passes as it is.

    `normals` is as long as a power of two, so that a mask wraps the walk through it.
    """
    if not abs(value) < FINITE:
        return value
    bias, noise, resolution, stride, offset = channel
    read = value + bias + noise * normals[(tick * stride + offset) & (len(normals) - 1)]
    if resolution > 0.0:
        return math.floor(read / resolution + 0.5) * resolution
    return read


def count(scale: float, offset: int, value: float) -> Count:
    """Give the encoder count at a position, rounded to nearest; 0 for a diverged value."""
    turned = scale * value + 0.5
    if not abs(turned) < FINITE:
        return 0
    return math.floor(turned) + offset
