"""What a tick leaves behind, gathered on a small page before it is filed away field by field.

The analysis wants all ticks of a field beside each other; a tick that wrote each of its fields
where it belongs would touch as many places of memory, more than the processor's caches look up at
a time. A page of a few ticks stays in the nearest of them.
"""

from typing import Any

from rig.sweep.column import read_soon
from rig.sweep.noise import WIDE

TICKS = 64  # on a page; fifty fields of them are 26 kB
_AHEAD = 32  # ticks: some microseconds, while memory answers in a tenth of one


def file_away(page: Any, kept: Any, fields: int, first: int, end: int) -> None:
    """Copy the ticks of a page to their places, ``first`` to ``end``, in ``kept``.

    On the page all ticks of a field stand beside each other, those of the next one `TICKS` on;
    in ``kept`` they do, too, with room for as many ticks as it has by its length.
    """
    room = len(kept) // fields
    for field in range(fields):
        for tick in range(first, end):
            kept[field * room + tick] = page[field * TICKS + tick - first]


def look_ahead(tables: Any, normals: Any, place: int, tick: int) -> None:
    """Have what sea and noise are some ticks on brought near; nothing else finds it in time."""
    soon = place + _AHEAD
    read_soon(tables.elevation, soon)
    read_soon(tables.heave, soon)
    read_soon(tables.surge, soon)
    noise = ((tick + _AHEAD) * WIDE) & (len(normals) - 1)
    read_soon(normals, noise)
    read_soon(normals, noise + WIDE // 2)
