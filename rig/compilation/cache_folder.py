"""Cache folder of results that can be computed again, and the processor they are valid for."""

import hashlib
import inspect
import json
import os
import platform
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

_DIGITS = 24  # of the name of a folder of code
_KEPT_SECONDS = 90 * 86_400
# Compiled code depends on these modules.
_COMPILERS = ("lifting.py", "column.py", "column_type.py", "memory_access.py", "tick_code.py")


def cache_root() -> Path:
    """Return the folder of all caches; it may be removed at any time."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "wec-rig"


def write_atomically(path: Path, text: str) -> None:
    """Write a file atomically, and create its folder; raise OSError if that fails.

    Two processes may write the same file at the same time.
    """
    write_bytes_atomically(path, text.encode())


def write_bytes_atomically(path: Path, content: bytes) -> None:
    """Write a file of bytes as `write_atomically` does."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}")
    temporary.write_bytes(content)
    temporary.replace(path)


def cached_json(path: Path, compute: Callable[[], Any], is_valid: Callable[[Any], bool]) -> Any:
    """Return the valid JSON value of a cache file, or else compute and store it.

    If the file cannot be written, the next process computes the value again.
    """
    try:
        value = json.loads(path.read_text())
        if is_valid(value):
            return value
    except (OSError, ValueError, TypeError, KeyError):
        pass
    value = compute()
    with suppress(OSError):
        write_atomically(path, json.dumps(value))
    return value


def remove_unused_code() -> int:
    """Remove folders of compiled code that were not used for 90 days; return their number."""
    limit = time.time() - _KEPT_SECONDS
    removed = 0
    for folder in cache_root().glob("[0-9a-f]" * _DIGITS):
        with suppress(OSError):
            if folder.stat().st_mtime < limit:
                shutil.rmtree(folder)
                removed += 1
    return removed


def processor_description() -> str:
    """Return the processor's model and flags: results may differ in the last bit between models."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return "".join(line for line in lines[:30] if line.startswith(("model name", "flags")))


def code_folder(source: str, modules: Iterable[ModuleType]) -> Path:
    """Return the folder of code compiled from a source and these modules on this host.

    Its name is a hash of all that the code depends on, numba and the processor included.
    """
    # It changes the compiled code, but not numba's own cache key.
    bounds_check = os.environ.get("NUMBA_BOUNDSCHECK", "")
    parts = [
        source,
        version("numba"),
        version("llvmlite"),
        version("numpy"),
        sys.version,
        platform.machine(),
        processor_description(),
        *(Path(__file__).with_name(name).read_text() for name in _COMPILERS),
    ]
    for module in modules:
        parts += [inspect.getsource(module), *_loaded_definitions(module)]
    parts.append(bounds_check)
    return cache_root() / hashlib.sha256("\0".join(parts).encode()).hexdigest()[:_DIGITS]


def _loaded_definitions(module: ModuleType) -> Iterator[str]:
    """Yield the functions and constants of a module as loaded in this process.

    A process that imported the module before an edit of its source still has the old definitions.
    Processes that import it afterwards must not find the code that the first one compiles.
    """
    for name, value in sorted(vars(module).items()):
        if inspect.isfunction(value) and value.__module__ == module.__name__:
            yield f"{name} {code_text(value.__code__)}"
        elif isinstance(value, type) and issubclass(value, tuple):
            yield f"{name} {getattr(value, '_fields', ())}"
        elif not name.startswith("__") and is_plain(value):
            yield f"{name} {value!r}"


def code_text(code: CodeType) -> str:
    """Return the operations of a function as text, without its position in the file."""
    nested = [code_text(each) for each in code.co_consts if isinstance(each, CodeType)]
    constants = [repr(each) for each in code.co_consts if is_plain(each)]
    return f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {constants} {nested}"


def is_plain(value: Any) -> bool:
    """Return whether a value is a number, a text, None, or a tuple of such."""
    if isinstance(value, tuple):
        return all(map(is_plain, value))
    return value is None or isinstance(value, int | float | str)
