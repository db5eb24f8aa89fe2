"""To add a power station, touch one row: the table of the WaveBot.

The program of these tests is a copy of the package in which one line more stands in the table. Its
run is read by today's package, which knows nothing of that line: the run itself lists its stations.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure
from matplotlib.image import imread
from rehearsing import write_campaign
from rig_command import rig_here

from rig.analysis.points import gain_matrix
from rig.analysis.report import write_products
from rig.analysis.rows import row_table
from rig.analysis.slices import find_optima
from rig.analysis.surfaces import draw_surfaces
from rig.recording.runs import open_run, run_info
from rig.stations import find

ROOT = Path(__file__).resolve().parents[2]
TABLE = "rig/kinds/wavebot/tick/stations.py"
NEXT = '    Station("ac", '
ROW = (
    '    Station("magnetic_spring", "slew * velocity", "magnetic spring (slew ring)", "spring",'
    ' "spring", alias="spring", running_mean=True, force="load.slew", shown=True),\n'
)
POINTS = [
    {"spring_n_per_m": 490.9, "kp_n_s_per_m": kp, "ki_n_per_m": ki}
    for kp in (-3000, -2000)
    for ki in (0, 2000)
]


class Program:
    """The package with one row more, and a short campaign."""

    def __init__(self, folder: Path) -> None:
        shutil.copytree(ROOT / "rig", folder / "rig", ignore=shutil.ignore_patterns("__pycache__"))
        table = folder / TABLE
        before, after = table.read_text().split(NEXT)
        table.write_text(before + ROW + NEXT + after)
        self.folder = folder
        self.campaign = write_campaign(
            folder / "campaign",
            sea={"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
            tare={"duration_s": 1},
            start={"lead_in_s": 8},
            timing={"settle_s": 2, "interval_s": 6},
            matrix={"list": POINTS},
        )

    def rig(self, *arguments: str | Path) -> str:
        """Run a command and return its standard output."""
        environment = os.environ | {"PYTHONPATH": f"{self.folder}{os.pathsep}{ROOT}"}
        command = [sys.executable, "-m", "rig", *map(str, arguments)]
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env=environment, cwd=self.folder
        )
        assert done.returncode == 0, done.stderr
        return done.stdout


pytestmark = pytest.mark.long(group="adding a station")  # compiles loops for the new table


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Program:
    return Program(tmp_path_factory.mktemp("program"))


@pytest.fixture(scope="module")
def run(program: Program) -> Path:
    program.rig("run", program.campaign, "--runs", program.folder / "runs")
    (folder,) = (program.folder / "runs").iterdir()
    return folder


def test_the_log_has_the_power_and_its_running_mean(run: Path) -> None:
    signals = ("load.slew", "tare.slew", "heave.estimate.velocity")
    log = open_run(run, fields=["power", "plan", *signals])
    force, zero, velocity = (log[name].values for name in signals)
    power = log["power.magnetic_spring"].values
    assert power.tobytes() == ((force - zero) * velocity).tobytes()
    assert np.abs(power).max() > 1.0  # W
    assert log["power.magnetic_spring"].attrs["units"] == "W"
    last = np.flatnonzero(log["plan.row"].values == 0)[-1]
    expected = row_table(run)["power_magnetic_spring"].values[0]
    assert log["power.mean_magnetic_spring"].values[last] == pytest.approx(expected, abs=1e-9)


def test_the_row_table_and_its_csv_have_the_station(run: Path, tmp_path: Path) -> None:
    table = row_table(run)
    names = ["power_magnetic_spring", "power_magnetic_spring_se", "power_magnetic_spring_demeaned"]
    for name in names:
        assert np.isfinite(table[name].values).all()
        assert table[name].attrs["units"] == "W"
    for folder in (run, shutil.copytree(run, tmp_path / "copy")):
        write_products(folder)
        with (folder / "rows.csv").open(newline="") as file:
            (header, *rows) = csv.reader(file)
        assert {f"{name} [W]" for name in names} <= set(header)
        assert len(rows) == len(POINTS)


def test_pictures_and_reports_have_the_station(run: Path, tmp_path: Path) -> None:
    table = row_table(run)
    assert [station.name for station in gain_matrix(table).stations] == [
        "mechanical_1", "mechanical_2", "magnetic_spring", "ac", "dc",
    ]  # fmt: skip
    figure = Figure(layout="constrained")
    draw_surfaces(figure, table, 8.0)
    figure.draw_without_rendering()
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert [text for text in labels if text.endswith(", W")] == [
        "mechanical, W", "mechanical (shaft), W", "spring, W", "electrical AC, W",
        "electrical DC, W",
    ]  # fmt: skip
    assert "magnetic_spring" in {optimum.station.name for optimum in find_optima(table)}
    assert "magnetic spring (slew ring)" in (run / "summary.txt").read_text()
    picture = tmp_path / "spring.png"
    options = ["--surface", "ki", "kp", "--station", "spring", "--output", picture]
    code, _, error = rig_here("plot", run, *options)
    assert code == 0, error
    assert imread(picture).std() > 0.02


def test_the_run_lists_its_stations(run: Path) -> None:
    info = run_info(run)
    station = find(info.stations, "spring")
    assert (station.name, station.formula) == ("magnetic_spring", "slew * velocity")
    assert [each["name"] for each in info.plan["stations"]] == [s.name for s in info.stations]


def test_a_run_from_before_the_row_is_read_without_it(program: Program, tmp_path: Path) -> None:
    old = tmp_path / "run.mcap"
    shutil.copy(ROOT / "tests" / "batch" / "golden" / "cots.mcap", old)
    program.rig("plot", old)
    assert "magnetic" not in (tmp_path / "rows.csv").read_text()
    assert "power_dc [W]" in (tmp_path / "rows.csv").read_text()


@pytest.mark.slow
def test_a_sweep_has_the_bits_of_the_run(program: Program, run: Path) -> None:
    arguments = ("--sequential", "--json", "--sweeps", program.folder / "sweeps")
    report = json.loads(program.rig("sweep", program.campaign, *arguments))
    assert "magnetic_spring" in report["best"]
    swept = xarray.load_dataset(report["result"])
    for name in ("power_magnetic_spring", "power_dc"):
        assert swept[name].values.tobytes() == row_table(run)[name].values.tobytes(), name
