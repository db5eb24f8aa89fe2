"""Code version and host of a run."""

import json
import os
import platform
import subprocess
import sys
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).resolve().parents[2]  # source tree, or site-packages
_BUILD_SOURCE = Path(__file__).resolve().parents[1] / "source.json"  # by hatch_build.py
_PACKAGES = ("numpy", "scipy", "filterpy", "mcap", "pydantic", "ruamel.yaml", "xarray")


def describe_code() -> dict[str, Any]:
    """Return version, git commit of the code, and whether the code had local changes.

    An installed package knows the commit from which it was built (empty if it was built without
    git); ``installed`` distinguishes it from a checkout, which may have changed since.
    """
    checkout = (_ROOT / ".git").exists() and (_ROOT / "pyproject.toml").is_file()
    commit, dirty = _checked_out_commit() if checkout else _built_commit()
    return {
        "version": metadata.version("wec-rig"),
        "git": commit,
        "dirty": dirty,
        "installed": not checkout,
        "python": platform.python_version(),
        "packages": {name: metadata.version(name) for name in _PACKAGES},
    }


def code_text(code: Mapping[str, Any]) -> str:
    """Return version, commit and Python of `describe_code` or of a recorded run as text."""
    text = str(code.get("version") or "version not recorded")
    if code.get("git"):
        text += f" ({str(code['git'])[:12]}{', with local changes' if code.get('dirty') else ''})"
    if code.get("python"):
        text += f", Python {code['python']}"
    return text


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


def _checked_out_commit() -> tuple[str, bool]:
    """Return the commit of the checkout, and whether tracked files differ from it."""
    commit = _git("rev-parse", "HEAD")
    return commit, bool(commit and _git("status", "--porcelain", "--untracked-files=no"))


def _built_commit() -> tuple[str, bool]:
    """Return the commit from which the package was built, and whether files differed from it."""
    try:
        source = json.loads(_BUILD_SOURCE.read_text(encoding="utf-8"))
        return str(source["git"]), bool(source["dirty"])
    except (OSError, ValueError, KeyError):
        return "", False


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
