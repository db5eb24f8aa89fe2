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
from types import CodeType, FunctionType, ModuleType
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
    try:
        temporary.write_bytes(content)
        temporary.replace(path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise


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
        with suppress(OSError):  # without a source, or an empty one
            parts.append(inspect.getsource(module))
        parts += _loaded_definitions(module)
    parts.append(bounds_check)
    return cache_root() / hashlib.sha256("\0".join(parts).encode()).hexdigest()[:_DIGITS]


def _loaded_definitions(module: ModuleType) -> Iterator[str]:
    """Yield the functions and constants of a module as loaded in this process.

    A process that imported the module before an edit of its source still has the old definitions.
    Processes that import it afterwards must not find the code that the first one compiles.
    """
    for name, value in sorted(vars(module).items()):
        if inspect.isfunction(value) and value.__module__ == module.__name__:
            yield f"{name} {code_text(value.__code__)} {bound_texts(value)}"
        elif isinstance(value, type) and issubclass(value, tuple):
            yield f"{name} {getattr(value, '_fields', ())}"
        elif not name.startswith("__") and (text := value_text(value)):
            yield f"{name} {text}"


def code_text(code: CodeType) -> str:
    """Return the operations of a function as text, without its position in the file."""
    nested = [code_text(each) for each in code.co_consts if isinstance(each, CodeType)]
    constants = list(filter(None, map(value_text, code.co_consts)))
    return f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {constants} {nested}"


def bound_values(function: FunctionType) -> list[Any]:
    """Return the values in a function's closure, and the defaults of its arguments."""
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    return [*cells, *(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()]


def bound_texts(function: FunctionType) -> list[str]:
    """Return the constants among the `bound_values` of a function as texts."""
    return list(filter(None, map(value_text, bound_values(function))))


def value_text(value: Any) -> str:
    """Return a constant of compiled code as text; empty for functions, modules and other objects.

    A constant is a number, a text, None, an array, or a tuple of such.
    """
    if isinstance(value, tuple):
        texts = [*map(value_text, value)]
        return f"({', '.join(texts)})" if all(texts) else ""
    if value is None or isinstance(value, int | float | complex | str):
        return repr(value)
    if hasattr(value, "dtype") and hasattr(value, "tobytes"):
        digest = hashlib.sha256(value.tobytes()).hexdigest()
        return f"{value.dtype} {value.shape} {digest}"
    return ""
