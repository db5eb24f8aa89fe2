"""Cache folder of results that can be computed again, and the processor they are valid for."""

import json
import os
import platform
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any


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


def processor_description() -> str:
    """Return the processor's model and flags: results may differ in the last bit between models."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return "".join(line for line in lines[:30] if line.startswith(("model name", "flags")))
