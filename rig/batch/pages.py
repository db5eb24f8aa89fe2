"""What a tick leaves behind, gathered on a small page before it is filed away field by field.

The analysis wants all ticks of a field beside each other; a tick that wrote each of its fields
where it belongs would touch as many places of memory, more than the processor's caches look up at
a time. A page of a few ticks stays in the nearest of them.
"""

from typing import Any

TICKS = 32  # on a page; fifty fields of them are 13 kB


def file_away(page: Any, kept: Any, first: int, end: int) -> None:
    """Copy the ticks of a page to their places, ``first`` to ``end``, in ``kept`` (fields, ticks).

    On the page all ticks of a field stand beside each other, those of the next one `TICKS` on.
    """
    for field in range(kept.shape[0]):
        for tick in range(first, end):
            kept[field, tick] = page[field * TICKS + tick - first]
