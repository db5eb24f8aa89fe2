"""The command `rig` as a person or a script calls it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from typer.testing import CliRunner

from rig.cli import app


def rig(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """In a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "rig", *map(str, words)], capture_output=True, text=True, check=False
    )


def rig_here(*words: str | Path) -> tuple[int, str, str]:
    """In this process: exit code, standard output and error. Any other end is an error."""
    done = CliRunner().invoke(app, [*map(str, words)])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.stdout, done.stderr
