"""Where results that can be made anew are kept from start to start, and for whom they hold."""

import os
import platform
from pathlib import Path


def cache_root() -> Path:
    """Folder of everything that is kept; it may be removed at any time."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "wec-rig"


def write(path: Path, text: str) -> None:
    """Put a file there whole or not at all, its folder too; raises OSError.

    Two processes that write the same one at once do not meet.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.stem}.{os.getpid()}")
    part.write_text(text)
    part.replace(path)


def processor() -> str:
    """The processor in words: arithmetic kept for one may differ in the last bit on another."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return "".join(line for line in lines[:30] if line.startswith(("model name", "flags")))
