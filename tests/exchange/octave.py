"""Run a script in GNU Octave, which reads exported files independently of this project."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest


def run_octave(script: Path, *arguments: object) -> np.ndarray:
    """Return the numbers that a script prints, one row a line; skip the test without Octave."""
    octave = shutil.which("octave-cli") or shutil.which("octave")
    if octave is None:
        pytest.skip(
            "GNU OCTAVE IS NOT INSTALLED (Debian: apt-get install octave): whether it reads an "
            f"exported .mat and {script.name} computes the same numbers was NOT checked"
        )
    process = subprocess.run(
        [octave, "--no-gui", "--no-init-file", "--quiet", script, *map(str, arguments)],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    return np.array(
        [[float(cell) for cell in line.split()] for line in process.stdout.splitlines()]
    )
