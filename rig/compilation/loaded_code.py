"""Code of ticks for processes that may wait for the compiler, such as sweeps.

The code is loaded once in a process, however many memories it works on. The compiler is imported
only if the cache does not have the code.
"""

from collections.abc import Callable
from pathlib import Path
from threading import Lock
from typing import Any

from rig.compilation.tick_source import TickSource
from rig.realtime import object_code
from rig.realtime.compiled_tick import ENTRY, is_complete, read_objects
from rig.realtime.tick_memory import FlatMemory

Bind = Callable[[FlatMemory], Callable[[], int]]
"""Returns the code of a tick that works on a memory."""

_loaded: dict[Path, Any] = {}
_loading = Lock()


def load_code(source: TickSource) -> Bind:
    """Return the code of a tick as a function of its memory; compile it if the cache lacks it.

    Raises `rig.compilation.tick_code.CompilationError` with the compiler's reason.
    """
    folder = source.folder
    with _loading:
        if folder not in _loaded:
            _loaded[folder] = _load(_objects(source, folder))
        function = _loaded[folder].function
    return lambda memory: function(ENTRY, memory.own())


def _objects(source: TickSource, folder: Path) -> list[bytes]:
    if is_complete(folder):
        return read_objects(folder)
    from rig.compilation.tick_code import objects_of  # noqa: PLC0415  (it imports the compiler)

    return objects_of(source)


def _load(objects: list[bytes]) -> Any:
    if object_code.is_supported():
        return object_code.load_at_once(objects)
    from rig.compilation.tick_code import LinkedByCompiler  # noqa: PLC0415

    return LinkedByCompiler(objects)
