"""The object code of a compiled tick: its files, and the function that it becomes."""

import os
from collections.abc import Callable, Generator
from contextlib import suppress
from pathlib import Path

from rig.realtime import object_code
from rig.realtime.object_code import ObjectCode
from rig.realtime.tick_memory import FlatMemory

FILES = ("tick.o", "entry.o")
"""Object code in a folder of the cache: the tick, and its entry for Python."""
ENTRY = "tick_entry"
EXCEPTION_TEXT = "the compiled tick raised an exception"
"""The message of a compiled tick that raised: its own is not known."""


def is_complete(folder: Path) -> bool:
    """Return whether a folder holds the whole code of a tick."""
    return all((folder / name).exists() for name in FILES)


def read_objects(folder: Path) -> list[bytes]:
    """Return the object code of a folder, for `rig.realtime.object_code`."""
    with suppress(OSError):
        os.utime(folder)  # `rig.compilation.cache_folder` removes code that is not used
    return [(folder / name).read_bytes() for name in FILES]


def load(folder: Path, memory: FlatMemory) -> Generator[None, None, Callable[[], int]]:
    """Load the code in steps of less than a tick each.

    Return the function that runs one tick on a memory and returns the mode after it. Raises OSError
    or ObjectCodeError if the code cannot be loaded here.
    """
    code = ObjectCode(read_objects(folder))
    yield from code.load()
    run: Callable[[], int] = code.function(ENTRY, memory.own())
    return run


def load_at_once(folder: Path, memory: FlatMemory) -> Callable[[], int]:
    """Load the code as `load` does, in one step."""
    code = object_code.load_at_once(read_objects(folder))
    run: Callable[[], int] = code.function(ENTRY, memory.own())
    return run
