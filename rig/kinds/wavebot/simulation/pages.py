"""Buffering of logged fields: a small page collects ticks before they are written column by column.

The analysis needs all ticks of a field contiguous in memory. A tick that wrote each field directly
to its column would touch as many cache lines as fields, more than the processor's caches handle at
a time. A page of a few ticks stays in the first-level cache.
"""

from typing import Any

from rig.compilation.column import prefetch
from rig.kinds.wavebot.simulation.noise import CHANNELS_PER_TICK

PAGE_TICKS = 64  # ticks on a page; with fifty fields a page has 26 kB
_PREFETCH_TICKS = 32  # ticks: some microseconds; memory responds in a tenth of one


def flush_page(page: Any, columns: Any, fields: int, first: int, end: int) -> None:
    """Copy the ticks of a page to ticks ``first`` to ``end`` of ``columns``.

    The page holds the ticks of a field contiguously, at a stride of `PAGE_TICKS` from field to
    field. ``columns`` has the same layout; its stride is its length divided by ``fields``.
    """
    capacity = len(columns) // fields
    for field in range(fields):
        for tick in range(first, end):
            columns[field * capacity + tick] = page[field * PAGE_TICKS + tick - first]


def prefetch_ahead(tables: Any, normals: Any, place: int, tick: int) -> None:
    """Prefetch sea and noise of later ticks into the cache; the hardware does not predict them."""
    index = place + _PREFETCH_TICKS
    prefetch(tables.elevation, index)
    prefetch(tables.heave, index)
    prefetch(tables.surge, index)
    noise = ((tick + _PREFETCH_TICKS) * CHANNELS_PER_TICK) & (len(normals) - 1)
    prefetch(normals, noise)
    prefetch(normals, noise + CHANNELS_PER_TICK // 2)
