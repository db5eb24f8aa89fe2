"""Run the command `rig` like a person or a script."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from typer.testing import CliRunner

from rig.cli.app import app


def rig(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run `rig ARGUMENTS` in a new process."""
    return subprocess.run(
        [sys.executable, "-m", "rig", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )


def rig_here(*arguments: str | Path) -> tuple[int, str, str]:
    """Run `rig ARGUMENTS` in this process; return exit code, standard output and error."""
    result = CliRunner().invoke(app, [*map(str, arguments)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout, result.stderr
