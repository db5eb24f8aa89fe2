"""Processes with raw sockets in user and network namespaces of their own."""

from __future__ import annotations

import functools
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).parent
ROOT = Path(__file__).resolve().parents[3]
PROBE = ("ip", "link", "add", "ecprobe", "type", "veth", "peer", "name", "ecprobe2")


@functools.cache
def isolation() -> tuple[str, ...]:
    """Return the command that isolates a process, or skip the test with the reason."""
    for program in ("unshare", "ip"):
        if shutil.which(program) is None:
            pytest.skip(f"the program {program} is not installed")
    reasons = []
    for command in (("unshare", "-Urn"), ("unshare", "-n")):
        if command[1] == "-n" and os.geteuid() != 0:
            continue
        done = subprocess.run([*command, *PROBE], capture_output=True, text=True, check=False)
        if done.returncode == 0:
            return command
        reasons.append(f"{' '.join(command)}: {done.stderr.strip()}")
    pytest.skip("no network namespace on this host: " + "; ".join(reasons))


def isolated(script: str, *arguments: str, seconds: float) -> dict[str, Any]:
    """Run a script of this folder in namespaces of its own and return the JSON that it prints."""
    command = [*isolation(), sys.executable, str(FOLDER / script), *arguments]
    paths = os.pathsep.join(map(str, (ROOT, FOLDER, FOLDER.parent)))
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=ROOT, timeout=seconds,
        env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    seen: dict[str, Any] = json.loads(done.stdout)
    return seen


def scenario(name: str, seconds: float = 0.0, *more: str) -> dict[str, Any]:
    """Run a scenario of `pysoem_master` and return what the master saw."""
    if importlib.util.find_spec("pysoem") is None:
        pytest.skip("pysoem is not installed (extra `ethercat`)")
    return isolated("pysoem_master.py", name, str(seconds), *more, seconds=seconds + 120.0)
