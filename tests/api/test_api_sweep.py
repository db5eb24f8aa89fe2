"""`rig.sweep`: the table is that of the command, the best row is the least power in it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray

import rig

OVER = {"sea.amplitude_m": [0.1, 0.127]}


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> rig.SweepResult:
    return rig.sweep("quick", OVER, out=tmp_path_factory.mktemp("sweeps"), progress=False)


def test_the_table_is_that_of_the_command(result: rig.SweepResult, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "rig", "sweep", "quick", "--over", "sea.amplitude_m=0.1,0.127"]
    done = subprocess.run(
        [*command, "--sweeps", str(tmp_path), "--json"], capture_output=True, text=True, check=True
    )
    printed = json.loads(done.stdout)
    with xarray.open_dataset(printed["result"], engine="h5netcdf") as theirs:
        assert theirs.equals(result.table)
    assert printed["best"] == result.summary.as_dict()["best"]
    assert Path(printed["folder"]).name == result.folder.name


def test_best_is_the_least_power_of_the_table(result: rig.SweepResult) -> None:
    power = result.table.power_dc.where(result.table.state == "complete")
    assert result.best.loc["dc", "power_w"] == float(power.min())
    assert dict(result.table.sizes) == {"sea.amplitude_m": 2, "row": 4}
    assert "8 complete" in repr(result)
    assert "http" not in result._repr_html_()
    assert result.failed == ()


def test_finished_cases_are_kept(result: rig.SweepResult) -> None:
    reports: list[rig.Progress] = []
    same = rig.sweep("quick", OVER, out=result.folder.parent, progress=reports.append)
    assert reports == []
    assert same.table.equals(result.table)
    assert {name: picture.path for name, picture in same.pictures.items()}.keys() == (
        result.pictures.keys()
    )


def test_numbers_of_numpy_are_values(tmp_path: Path) -> None:
    swept = rig.sweep(
        "quick", {"sea.amplitude_m": np.linspace(0.05, 0.06, 2)}, out=tmp_path, progress=False
    )
    assert swept.table["sea.amplitude_m"].values.tolist() == [0.05, 0.06]


def test_all_problems_come_at_once(tmp_path: Path) -> None:
    with pytest.raises(rig.RigError) as raised:
        rig.sweep("quick", {"sea.amplitude_m": [9.0], "sea.depth": 1}, out=tmp_path)
    assert {each.key for each in raised.value.problems} == {"sea.amplitude_m", "sea.depth"}
