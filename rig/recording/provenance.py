"""Code version and host of a run."""

import os
import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).resolve().parents[2]
_PACKAGES = ("numpy", "scipy", "filterpy", "mcap", "pydantic", "ruamel.yaml", "xarray")


def describe_code() -> dict[str, Any]:
    """Return version, git commit (empty outside a checkout) and whether it has local changes."""
    commit = _git("rev-parse", "HEAD")
    return {
        "version": metadata.version("wec-rig"),
        "git": commit,
        "dirty": bool(commit and _git("status", "--porcelain", "--untracked-files=no")),
        "python": platform.python_version(),
        "packages": {name: metadata.version(name) for name in _PACKAGES},
    }


def describe_host() -> dict[str, Any]:
    """Return name, kernel, processor, cores and memory of this machine, and the command line."""
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


def _git(*arguments: str) -> str:
    try:
        completed = subprocess.run(
            ["git", "-C", str(_ROOT), *arguments],
            capture_output=True,
            text=True,
            timeout=5,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return completed.stdout.strip()


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
