"""The tables of noise and sea in the order in which a simulation reads them.

Every channel of a plant's sensors reads one megabyte of normals with its own stride: nine memory
locations per tick. The interleaved table stores the same numbers contiguously, tick after tick.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.compilation.column import Column, prefetch
from sim_plant.sensors import Channel, SensorParams

_PREFETCH_TICKS = 32  # ticks: some microseconds; memory responds in a tenth of one
CHANNELS_PER_TICK = 16  # numbers per tick; a power of two, because the table's length must be one


def interleaved(sensors: SensorParams, normals: Sequence[float]) -> tuple[SensorParams, Column]:
    """Return the sensors with channels that read the interleaved table, and that table.

    `sim_plant.sensors.measure` returns the same bits with either: a channel's sequence repeats
    after as many ticks as the table has entries, for any stride.
    """
    names = [name for name, each in sensors._asdict().items() if isinstance(each, Channel)]
    numbers, ticks = np.array(normals), np.arange(len(normals))
    table = np.zeros((len(normals), CHANNELS_PER_TICK))
    channels: dict[str, Any] = {}
    for place, name in enumerate(names):
        channel: Channel = getattr(sensors, name)
        indices = (ticks * channel.stride + channel.offset) & (len(normals) - 1)
        table[:, place] = numbers[indices]
        channels[name] = channel._replace(stride=CHANNELS_PER_TICK, offset=place)
    return sensors._replace(**channels), Column(table.ravel())


def prefetch_ahead(tables: Any, normals: Any, place: int, tick: int) -> None:
    """Prefetch sea and noise of later ticks into the cache; the hardware does not predict them."""
    index = place + _PREFETCH_TICKS
    prefetch(tables.elevation, index)
    prefetch(tables.heave, index)
    prefetch(tables.surge, index)
    noise = ((tick + _PREFETCH_TICKS) * CHANNELS_PER_TICK) & (len(normals) - 1)
    prefetch(normals, noise)
    prefetch(normals, noise + CHANNELS_PER_TICK // 2)
