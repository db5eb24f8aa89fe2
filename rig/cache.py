"""Where results that can be made anew are kept from start to start, and for whom they hold."""

import os
import platform
from pathlib import Path


def cache_root() -> Path:
    """Folder of everything that is kept; it may be removed at any time."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "wec-rig"


def processor() -> str:
    """The processor in words: arithmetic kept for one may differ in the last bit on another."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return "".join(line for line in lines[:30] if line.startswith(("model name", "flags")))
