"""The noise table in the order in which a simulation reads it.

Every channel of a plant's sensors walks through one megabyte of normals with a stride of its own:
nine places of memory a tick. Here the numbers that the channels read in one tick stand beside each
other, tick after tick; they are the same numbers.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.sweep.column import Column
from sim_plant.sensors import Channel, SensorParams

WIDE = 16  # numbers kept for a tick: a power of two, as the table's length has to be one


def interleaved(sensors: SensorParams, normals: Sequence[float]) -> tuple[SensorParams, Column]:
    """The sensors with channels that read the table given beside them, and that table.

    `sim_plant.sensors.measure` gives the same bits with either: the walk of a channel repeats after
    as many ticks as the table is long, whatever its stride.
    """
    names = [name for name, each in sensors._asdict().items() if isinstance(each, Channel)]
    numbers, ticks = np.array(normals), np.arange(len(normals))
    table = np.zeros((len(normals), WIDE))
    told: dict[str, Any] = {}
    for place, name in enumerate(names):
        channel: Channel = getattr(sensors, name)
        walk = (ticks * channel.stride + channel.offset) & (len(normals) - 1)
        table[:, place] = numbers[walk]
        told[name] = channel._replace(stride=WIDE, offset=place)
    return sensors._replace(**told), Column(table.ravel())
