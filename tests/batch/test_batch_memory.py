"""Memory layout of the compiled loop: interleaved noise, pages and columns keep all numbers."""

from __future__ import annotations

import numpy as np

from rig.compilation.column import Column, prefetch
from rig.kinds.wavebot.rehearsal.noise import CHANNELS_PER_TICK, interleaved
from sim_plant.sensors import NOISE_LENGTH, Channel, SensorParams, measure

RNG = np.random.default_rng(3)


def sensors() -> SensorParams:
    """Return sensors whose channels differ in all parameters, as in a plant."""
    names = [name for name in SensorParams._fields if not name.endswith(("metre", "offset"))]
    channels = {
        name: Channel(0.1 * i, 0.5 + i, 0.0 if i % 2 else 0.01, 2 * i + 1, 10007 * i)
        for i, name in enumerate(names)
    }
    return SensorParams(counts_per_metre=4e4, count_offset=5, surge_offset=7, **channels)


def test_every_channel_reads_the_same_noise_in_every_tick() -> None:
    normals = RNG.standard_normal(NOISE_LENGTH).tolist()
    channels_before = sensors()
    channels_after, table = interleaved(channels_before, normals)
    ticks = [
        0,
        1,
        2,
        NOISE_LENGTH - 1,
        NOISE_LENGTH,
        3 * NOISE_LENGTH + 17,
        *RNG.integers(0, 10**8, 200).tolist(),
    ]
    assert len(table) == NOISE_LENGTH * CHANNELS_PER_TICK
    for name, channel in channels_before._asdict().items():
        channel_after = getattr(channels_after, name)
        if not isinstance(channel, Channel):
            assert channel_after == channel
            continue
        assert channel_after[:3] == channel[:3]
        for tick in ticks:
            value = measure(channel_after, 1.25, tick, table)  # type: ignore[arg-type]
            assert value == measure(channel, 1.25, tick, normals)


def test_column_of_an_array_shares_its_memory() -> None:
    array = np.zeros(4)
    column = Column(array)
    column[2] = 1.5
    prefetch(column, 10**9)
    assert array.tolist() == [0.0, 0.0, 1.5, 0.0]
    assert column.address == array.ctypes.data
