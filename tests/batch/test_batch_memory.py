"""Where the compiled loop has its numbers: the same numbers, only elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from rig.sweep.column import Column, read_soon
from rig.sweep.noise import WIDE, interleaved
from rig.sweep.pages import TICKS, file_away
from sim_plant.sensors import NORMALS, Channel, SensorParams, measure

RNG = np.random.default_rng(3)


def sensors() -> SensorParams:
    """Channels that differ in everything, as those of a plant do."""
    names = [name for name in SensorParams._fields if not name.endswith(("metre", "offset"))]
    channels = {
        name: Channel(0.1 * i, 0.5 + i, 0.0 if i % 2 else 0.01, 2 * i + 1, 10007 * i)
        for i, name in enumerate(names)
    }
    return SensorParams(counts_per_metre=4e4, count_offset=5, surge_offset=7, **channels)


def test_every_channel_reads_the_same_noise_in_every_tick() -> None:
    normals = RNG.standard_normal(NORMALS).tolist()
    before = sensors()
    after, table = interleaved(before, normals)
    ticks = [0, 1, 2, NORMALS - 1, NORMALS, 3 * NORMALS + 17, *RNG.integers(0, 10**8, 200).tolist()]
    assert len(table) == NORMALS * WIDE
    for name, channel in before._asdict().items():
        there = getattr(after, name)
        if not isinstance(channel, Channel):
            assert there == channel
            continue
        assert there[:3] == channel[:3]
        for tick in ticks:
            ours = measure(there, 1.25, tick, table)  # type: ignore[arg-type]
            assert ours == measure(channel, 1.25, tick, normals)


@pytest.mark.parametrize(("first", "end"), [(0, TICKS), (5, 5 + TICKS), (90, 91), (7, 7)])
def test_a_page_is_filed_away_where_its_ticks_belong(first: int, end: int) -> None:
    fields, room = 3, 200
    page = RNG.standard_normal(fields * TICKS)
    kept = np.full((fields, room), np.nan)
    file_away(Column(page), Column(kept.ravel()), fields, first, end)
    expected = np.full((fields, room), np.nan)
    expected[:, first:end] = page.reshape(fields, TICKS)[:, : end - first]
    assert np.array_equal(kept, expected, equal_nan=True)


def test_a_column_of_an_array_is_that_array() -> None:
    array = np.zeros(4)
    column = Column(array)
    column[2] = 1.5
    read_soon(column, 10**9)
    assert array.tolist() == [0.0, 0.0, 1.5, 0.0]
    assert column.address == array.ctypes.data
