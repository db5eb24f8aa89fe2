"""The object code of a compiled tick: its files, and the function that it becomes."""

import os
import zlib
from collections.abc import Callable, Generator
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from rig.realtime.object_code import ObjectCode, ObjectCodeError
from rig.realtime.tick_memory import FlatMemory

T = TypeVar("T")

FILES = ("tick.o", "entry.o")
"""Object code in a folder of the cache: the tick, and its entry for Python."""
ENTRY = "tick_entry"
_CHECKSUM_BYTES = 4
_BYTES_PER_STEP = 32_768  # 25 us
EXCEPTION_TEXT = "the compiled tick raised an exception"
"""The message of a compiled tick that raised: its own is not known."""


def exists(folder: Path) -> bool:
    """Return whether a folder holds the files of a tick, which may be damaged."""
    return all((folder / name).exists() for name in FILES)


def is_complete(folder: Path) -> bool:
    """Return whether a folder holds the whole code of a tick.

    Damaged files are removed, so that the code is compiled anew.
    """
    if not exists(folder):
        return False
    try:
        read_objects(folder)
    except (OSError, ObjectCodeError):
        with suppress(OSError):
            for name in FILES:
                (folder / name).unlink(missing_ok=True)
        return False
    return True


def with_checksum(code: bytes) -> bytes:
    """Return the content of a file of object code: a power cut may damage it."""
    return code + zlib.crc32(code).to_bytes(_CHECKSUM_BYTES, "little")


def read_objects(folder: Path) -> list[bytes]:
    """Return the object code of a folder, for `rig.realtime.object_code`.

    Raises OSError, or ObjectCodeError for damaged files.
    """
    return _at_once(_read(folder))


def _read(folder: Path) -> Generator[None, None, list[bytes]]:
    """Read the object code of a folder in steps of less than a tick each."""
    with suppress(OSError):
        os.utime(folder)  # `rig.compilation.cache_folder` removes code that is not used
    objects = []
    for name in FILES:
        content = (folder / name).read_bytes()
        yield
        code, checksum = content[:-_CHECKSUM_BYTES], content[-_CHECKSUM_BYTES:]
        found = 0
        for start in range(0, len(code), _BYTES_PER_STEP):
            found = zlib.crc32(code[start : start + _BYTES_PER_STEP], found)
            yield
        if found.to_bytes(_CHECKSUM_BYTES, "little") != checksum:
            raise ObjectCodeError(f"{folder / name} is damaged; rig compile compiles it anew")
        objects.append(code)
    return objects


def load(folder: Path, memory: FlatMemory) -> Generator[None, None, Callable[[], int]]:
    """Load the code in steps of less than a tick each.

    Return the function that runs one tick on a memory and returns the mode after it. Raises OSError
    or ObjectCodeError if the code cannot be loaded here.
    """
    code = ObjectCode((yield from _read(folder)))
    yield from code.load()
    run: Callable[[], int] = code.function(ENTRY, memory.own())
    return run


def load_at_once(folder: Path, memory: FlatMemory) -> Callable[[], int]:
    """Load the code as `load` does, in one step."""
    return _at_once(load(folder, memory))


def _at_once(steps: Generator[None, None, T]) -> T:
    """Return the result of all steps."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            result: T = end.value
            return result
