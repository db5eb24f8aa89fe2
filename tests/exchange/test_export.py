"""Runs for other tools, read back by readers that are not ours: mat4py, GNU Octave, xarray, csv."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import xarray
from command_here import rig
from synthetic_runs import Row, Shape, plan_json, run_rows, write_run

from rig.analysis.rows import POWERS, row_table
from rig.interop.exchange.mask4_export import structure, write_mat
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError, open_run

SCRIPT = Path(__file__).resolve().parents[2] / "docs" / "row_powers.m"
RATE = 100.0  # of the synthetic run: all of its ticks


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five rows with noise; forces have an offset that belongs to no row's power."""
    rows = [
        Row(i, 0, 490.9, -1000.0 - 500.0 * i, 0.0, dict(zip(POWERS, watts, strict=True)))
        for i, watts in enumerate((-60.0 - i, -50.0, -40.0 + i, -20.0 + 3.0 * i) for i in range(5))
    ]
    shape = Shape(noise=5.0)
    folder = tmp_path_factory.mktemp("export") / "run"
    return write_run(folder, run_rows(rows, shape), plan_json(rows, shape))


@pytest.fixture(scope="module")
def mat(run: Path) -> Path:
    return write_mat(structure(run, RATE), run / "run.mat")


def powers(run: Path) -> np.ndarray:
    table = row_table(run)
    names = ("mechanical_1_demeaned", "mechanical_2_demeaned", "ac", "dc")
    return np.stack([table[f"power_{name}"].values for name in names], axis=1)


def test_octave_computes_the_same_row_powers(run: Path, mat: Path) -> None:
    octave = shutil.which("octave-cli") or shutil.which("octave")
    if octave is None:
        pytest.skip(
            "GNU OCTAVE IS NOT INSTALLED (Debian: apt-get install octave): whether it reads an "
            "exported .mat and computes the same row powers was NOT checked"
        )
    done = subprocess.run(
        [octave, "--no-gui", "--no-init-file", "--quiet", SCRIPT, mat],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = np.array([[float(cell) for cell in line.split()] for line in done.stdout.splitlines()])
    assert found[:, 0].tolist() == [0, 1, 2, 3, 4]
    assert np.allclose(found[:, 1:], powers(run), rtol=1e-9, atol=1e-9)


def test_mat4py_reads_every_field_as_it_was_logged(run: Path, mat: Path) -> None:
    """A reader of MATLAB 5 files written apart from scipy, which writes ours."""
    mat4py = pytest.importorskip(
        "mat4py", reason="MAT4PY IS NOT INSTALLED: the independent reader of .mat did NOT run"
    )
    read = mat4py.loadmat(str(mat))
    logged = open_run(run)

    def field(bus: str, name: str) -> np.ndarray:
        return np.array(read[bus][name])[:, 0]

    same = {
        ("heaveSignals", "heaveEncVel_m_s"): logged["heave.estimate.velocity"],
        ("heaveSignals", "heaveForceLCB_N"): logged["load.lcb"],
        ("heaveSignals", "heaveForceI_N"): 76.9750 * logged["heave.sense.current"],
        ("hbmSignals", "heaveDriveOutSumP"): -logged["power.ac"],
        ("hbmSignals", "heaveDriveInP"): logged["power.dc"],
        ("expParamSignals", "heaveKpUsed"): logged["heave.demand.kp"],
        ("magSpringSetpointSignals", "targetSpring_N_m"): logged["spring_command.rate"],
        ("rigSignals", "row"): logged["plan.row"],
    }
    for (bus, name), wanted in same.items():
        assert np.allclose(field(bus, name), wanted.values, rtol=1e-6, atol=0.0), name
    assert np.array_equal(field("heaveSignals", "time"), logged["time"].values)


def test_a_slow_scope_takes_every_second_tick(run: Path) -> None:
    slow = structure(run, 50.0).buses["heaveSignals"]["time"][:, 0]
    assert np.allclose(np.diff(slow), 0.02)
    with pytest.raises(RunError, match="200 Hz does not divide its 100 Hz; allowed 100, 50, 20"):
        structure(run)


def test_a_lead_in_that_is_too_short_for_their_scripts_is_told(run: Path) -> None:
    (said,) = structure(run, RATE).remarks
    assert said.startswith("the first row begins 1 s into the record, not after 120 s")


def test_the_custom_drive_has_its_own_channels(tmp_path: Path) -> None:
    power = {"mechanical_1": -60.0, "mechanical_2": -50.0, "ac": -40.0, "dc": -20.0}
    rows = [Row(0, 0, 490.9, -1000.0, 0.0, power, {"bus_voltage": 75.0, "switching_period": 1e-4})]
    shape, config = Shape(), {"rig": {"name": "w", "drive": {"kind": "custom"}}}
    folder = write_run(
        tmp_path / "run", run_rows(rows, shape), plan_json(rows, shape), config=config
    )
    buses = structure(folder, RATE).buses
    assert "heaveDriveInP" not in buses["hbmSignals"]
    assert buses["hbmSignals"]["expDriveInP"].mean() < 0.0
    assert buses["toDriveSGSignals"]["switchingPeriod_s"].max() == 1e-4


def test_netcdf_and_csv(run: Path, tmp_path: Path) -> None:
    nc, text = tmp_path / "x.nc", tmp_path / "x.csv"
    assert rig("export", run, "--as", "netcdf", "-o", nc).returncode == 0
    wanted = open_run(run)
    with xarray.open_dataset(nc) as read:
        assert set(read.data_vars) == set(wanted.data_vars)
        for name in wanted.data_vars:
            assert np.array_equal(read[name].values, wanted[name].values), name
            assert read[name].attrs["units"] == wanted[name].attrs["units"]
        assert read.attrs["campaign"] == "default"
    done = rig("export", run, "--as", "csv", "-f", "power.*", "-r", "2", "-o", text, "--json")
    assert json.loads(done.stdout)["written"] == str(text)
    with text.open() as file:
        lines = list(csv.reader(file))
    part = open_run(run, ["power.*"], 2)
    assert lines[0] == ["time [s]", *(f"{n} [{part[n].attrs['units']}]" for n in part.data_vars)]
    column = [float(line[lines[0].index("power.ac [W]")]) for line in lines[1:]]
    assert column == part["power.ac"].values.tolist()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--as", "mat"], "200 Hz does not divide its 100 Hz"),
        (["--as", "mat", "--rate", "50", "-r", "1"], "--field and --row are for netcdf and csv"),
        (["--as", "csv", "-f", "power.thermal"], "no field 'power.thermal'"),
        (["--as", "netcdf", "-r", "9"], "no row 9 in this run (rows: 0 to 4)"),
        (["--as", "netcdf", "--rate", "30"], "30 Hz does not divide its 100 Hz"),
    ],
)
def test_what_cannot_be_exported_is_said(run: Path, words: list[str], said: str) -> None:
    done = rig("export", run, *words)
    assert done.returncode == 2
    assert said in done.stderr


def test_windows_that_the_record_lacks_ticks_of_are_marked(run: Path, tmp_path: Path) -> None:
    """20 of the 1000 ticks of row 2 lost; of row 4 the loop skipped some, which it counted."""
    rows = [Row(i, 0, 490.9, -1000.0, 0.0, dict.fromkeys(POWERS, -10.0)) for i in range(5)]
    data = run_rows(rows, Shape())
    measured = data["plan.phase"] == Phase.MEASURE
    two, four = (np.flatnonzero(measured & (data["plan.row"] == row)) for row in (2, 4))
    data["timing.skipped"][four[50] :] = 7
    gone = [*two[100:120], *four[43:50]]
    plan = plan_json(rows, Shape())
    torn = write_run(tmp_path / "torn", np.delete(data, gone), plan, ticks=len(data) - 7)
    said = "row 2: 20 of 1000 ticks missing from the record"
    nc, text = tmp_path / "x.nc", tmp_path / "x.csv"
    done = rig("export", torn, "--as", "netcdf", "-o", nc)
    assert done.stdout.splitlines()[1].strip() == said
    with xarray.open_dataset(nc) as read:
        marked = read["record.incomplete"].values == 1
        inside = (read["plan.row"] == 2) & (read["plan.phase"] == int(Phase.MEASURE))
        assert np.array_equal(marked, inside.values)
        assert marked.sum() == 980
        assert read.attrs["record_incomplete_rows"] == said
    done = rig("export", torn, "--as", "csv", "-f", "power.dc", "-o", text, "--json")
    assert json.loads(done.stdout)["remarks"] == [said]
    with text.open() as file:
        assert sum(int(line["record.incomplete [flag]"]) for line in csv.DictReader(file)) == 980
    exported = structure(torn, RATE)
    assert said in exported.remarks
    assert exported.buses["rigSignals"]["incomplete"].sum() == 980
    assert structure(run, RATE).buses["rigSignals"]["incomplete"].sum() == 0
