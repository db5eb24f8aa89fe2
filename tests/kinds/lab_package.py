"""The package that `rig new kind lift` writes, as an installer would leave it, and its commands.

The metadata is written by hand: an installer builds the package with hatchling, which `make setup`
does not install, and would have to fetch it for each test. `tests/cli/test_cli_installed.py`
installs the package with an installer.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from rig.kinds.new_kind import write_kind

ROOT = Path(__file__).resolve().parents[2]


def write_project(folder: Path) -> None:
    """Write the package, and the entry points of its distribution."""
    write_kind("lift", folder)
    info = folder / "site" / "wec_lift-1.2.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Name: wec-lift\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text(
        "[wec_rig.kinds]\nlift = wec_lift\n[wec_rig.laws]\nlift = wec_lift.law\n"
    )


def in_lab(lab: Path, *command: object) -> subprocess.CompletedProcess[str]:
    """Run a Python program that finds the distribution."""
    paths = os.pathsep.join(map(str, (ROOT, lab / "site", lab / "wec_lift")))
    return subprocess.run(
        [sys.executable, "-P", "-m", *map(str, command)],
        capture_output=True, text=True, check=False, cwd=lab, timeout=600,
        env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip


def rig(lab: Path, *arguments: object) -> tuple[int, str, str]:
    """Run the command line in a process that finds the distribution."""
    done = in_lab(lab, "rig", *arguments)
    return done.returncode, done.stdout, done.stderr
