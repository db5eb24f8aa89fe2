"""Helpers to start Python processes that share file descriptors with a test."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


def start(code: str, *fds: int) -> subprocess.Popen[str]:
    """Run ``code`` (this folder and the one above on its path); the process inherits ``fds``."""
    return subprocess.Popen(
        [sys.executable, "-c", code, *(str(fd) for fd in fds)],
        pass_fds=fds,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": f"{HERE}{os.pathsep}{HERE.parent}"},
    )


def output(code: str, *fds: int) -> str:
    """Return the output of a process that must succeed."""
    process = start(code, *fds)
    text, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    return text
