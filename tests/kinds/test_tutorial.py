"""The tutorial's commands, run as they are written, in an empty folder."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray

TUTORIAL = Path(__file__).resolve().parents[2] / "docs" / "tutorials" / "your_body.md"


def commands() -> list[str]:
    """Return the lines of the tutorial's shell blocks."""
    blocks = re.findall(r"^```sh\n(.*?)^```", TUTORIAL.read_text(), re.DOTALL | re.MULTILINE)
    return [line for block in blocks for line in block.splitlines()]


@pytest.mark.slow
def test_a_body_without_python_from_its_bem_file_to_power_surfaces(tmp_path: Path) -> None:
    lines = commands()
    assert len(lines) == 12
    for line in lines:
        program, *arguments = line.split()
        assert program == "rig"
        done = subprocess.run(
            [sys.executable, "-m", "rig", *arguments],
            cwd=tmp_path, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    one_body, two_bodies = sorted((tmp_path / "runs").iterdir())
    for run in (one_body, two_bodies):
        assert {"surfaces.png", "summary.pdf", "rows.csv"} <= {each.name for each in run.iterdir()}
        with xarray.open_dataset(run / "rows.nc", engine="h5netcdf") as rows:
            power = rows["power_mechanical"].values
            assert power.shape == (12,)
            assert np.all(power < -100.0)
    assert (tmp_path / "plants" / "heave.png").stat().st_size > 20_000
    for name in ("buoy", "pair"):
        assert "# Written by rig optimum" in (tmp_path / f"{name}-first_optimum.yaml").read_text()
    (sweep,) = (tmp_path / "sweeps").iterdir()
    assert (sweep / "sweep.nc").exists()
