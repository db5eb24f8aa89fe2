"""Buffering of logged fields: a small page collects ticks before they are written column by column.

The analysis needs all ticks of a field contiguous in memory. A tick that wrote each field directly
to its column would touch as many cache lines as fields, more than the processor's caches handle at
a time. A page of a few ticks stays in the first-level cache.
"""

from typing import Any

PAGE_TICKS = 64  # ticks on a page; with fifty fields a page has 26 kB


def flush_page(page: Any, columns: Any, fields: int, first: int, end: int) -> None:
    """Copy the ticks of a page to ticks ``first`` to ``end`` of ``columns``.

    The page holds the ticks of a field contiguously, at a stride of `PAGE_TICKS` from field to
    field. ``columns`` has the same layout; its stride is its length divided by ``fields``.
    """
    capacity = len(columns) // fields
    for field in range(fields):
        for tick in range(first, end):
            columns[field * capacity + tick] = page[field * PAGE_TICKS + tick - first]
