"""Which code on which host made a run."""

import os
import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).resolve().parents[2]
_PACKAGES = ("numpy", "scipy", "filterpy", "mcap", "pydantic", "ruamel.yaml", "xarray")


def code() -> dict[str, Any]:
    """Version, git commit (empty outside a checkout), whether it has uncommitted changes."""
    commit = _git("rev-parse", "HEAD")
    return {
        "version": metadata.version("wec-rig"),
        "git": commit,
        "dirty": bool(commit and _git("status", "--porcelain", "--untracked-files=no")),
        "python": platform.python_version(),
        "packages": {name: metadata.version(name) for name in _PACKAGES},
    }


def host() -> dict[str, Any]:
    """Name, kernel, processor, cores and memory of this machine, and the command that ran."""
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return {
        "name": platform.node(),
        "kernel": platform.release(),
        "kernel_build": platform.version(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_bytes": pages,
        "command": [Path(sys.argv[0]).name, *sys.argv[1:]],
    }


def _git(*words: str) -> str:
    try:
        done = subprocess.run(
            ["git", "-C", str(_ROOT), *words], capture_output=True, text=True, timeout=5, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
