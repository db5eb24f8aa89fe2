"""Exported runs, read back by independent readers: mat4py, GNU Octave, xarray, csv."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import xarray
from command_here import rig
from octave import run_octave
from synthetic_runs import POWERS, Row, Shape, plan_json, run_rows, write_run

from rig.analysis.rows import row_table
from rig.kinds.wavebot.mask4.export import export_structure, write_mat
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError, open_run

SCRIPT = Path(__file__).resolve().parents[2] / "docs" / "how_to" / "row_powers.m"
RATE = 100.0  # of the synthetic run: all of its ticks


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five rows with noise; the forces have an offset that is not part of any row's power."""
    rows = [
        Row(i, 0, 490.9, -1000.0 - 500.0 * i, 0.0, dict(zip(POWERS, watts, strict=True)))
        for i, watts in enumerate((-60.0 - i, -50.0, -40.0 + i, -20.0 + 3.0 * i) for i in range(5))
    ]
    shape = Shape(noise=5.0)
    folder = tmp_path_factory.mktemp("export") / "run"
    return write_run(folder, run_rows(rows, shape), plan_json(rows, shape))


@pytest.fixture(scope="module")
def mat(run: Path) -> Path:
    return write_mat(export_structure(run, RATE), run / "run.mat")


def powers(run: Path) -> np.ndarray:
    table = row_table(run)
    names = ("mechanical_1_demeaned", "mechanical_2_demeaned", "ac", "dc")
    return np.stack([table[f"power_{name}"].values for name in names], axis=1)


def test_octave_script_computes_the_same_row_powers(run: Path, mat: Path) -> None:
    found = run_octave(SCRIPT, mat)
    assert found[:, 0].tolist() == [0, 1, 2, 3, 4]
    assert np.allclose(found[:, 1:], powers(run), rtol=1e-9, atol=1e-9)


def test_mat4py_reads_every_field_as_logged(run: Path, mat: Path) -> None:
    """mat4py reads MATLAB 5 independently of scipy, which the exporter uses."""
    mat4py = pytest.importorskip(
        "mat4py", reason="MAT4PY IS NOT INSTALLED: the independent reader of .mat did NOT run"
    )
    loaded = mat4py.loadmat(str(mat))
    logged = open_run(run)

    def field(bus: str, name: str) -> np.ndarray:
        return np.array(loaded[bus][name])[:, 0]

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
    for (bus, name), expected in same.items():
        assert np.allclose(field(bus, name), expected.values, rtol=1e-6, atol=0.0), name
    assert np.array_equal(field("heaveSignals", "time"), logged["time"].values)


def test_a_slow_scope_takes_every_second_tick(run: Path) -> None:
    slow = export_structure(run, 50.0).buses["heaveSignals"]["time"][:, 0]
    assert np.allclose(np.diff(slow), 0.02)
    with pytest.raises(RunError, match="200 Hz does not divide its 100 Hz; allowed 100, 50, 20"):
        export_structure(run)


def test_lead_in_too_short_for_the_mask4_scripts_is_reported(run: Path) -> None:
    (message,) = export_structure(run, RATE).remarks
    assert message.startswith("the first row begins 1 s into the record, not after 120 s")


def test_the_custom_drive_has_its_own_channels(tmp_path: Path) -> None:
    power = {"mechanical_1": -60.0, "mechanical_2": -50.0, "ac": -40.0, "dc": -20.0}
    rows = [Row(0, 0, 490.9, -1000.0, 0.0, power, {"bus_voltage": 75.0, "switching_period": 1e-4})]
    shape, config = Shape(), {"rig": {"name": "w", "drive": {"kind": "custom"}}}
    folder = write_run(
        tmp_path / "run", run_rows(rows, shape), plan_json(rows, shape), config=config
    )
    buses = export_structure(folder, RATE).buses
    assert "heaveDriveInP" not in buses["hbmSignals"]
    assert buses["hbmSignals"]["expDriveInP"].mean() < 0.0
    assert buses["toDriveSGSignals"]["switchingPeriod_s"].max() == 1e-4


def test_netcdf_and_csv(run: Path, tmp_path: Path) -> None:
    nc, text = tmp_path / "x.nc", tmp_path / "x.csv"
    assert rig("export", run, "--as", "netcdf", "-o", nc).returncode == 0
    expected = open_run(run)
    with xarray.open_dataset(nc) as loaded:
        assert set(loaded.data_vars) == set(expected.data_vars)
        for name in expected.data_vars:
            assert np.array_equal(loaded[name].values, expected[name].values), name
            assert loaded[name].attrs["units"] == expected[name].attrs["units"]
        assert loaded.attrs["campaign"] == "default"
    process = rig("export", run, "--as", "csv", "-f", "power.*", "-r", "2", "-o", text, "--json")
    assert json.loads(process.stdout)["written"] == str(text)
    with text.open() as file:
        lines = list(csv.reader(file))
    part = open_run(run, ["power.*"], 2)
    assert lines[0] == ["time [s]", *(f"{n} [{part[n].attrs['units']}]" for n in part.data_vars)]
    column = [float(line[lines[0].index("power.ac [W]")]) for line in lines[1:]]
    assert column == part["power.ac"].values.tolist()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--as", "mat"], "200 Hz does not divide its 100 Hz"),
        (
            ["--as", "mat", "--rate", "50", "-r", "1"],
            "fields and rows can be chosen with netcdf and csv only",
        ),
        (["--as", "csv", "-f", "power.thermal"], "no field 'power.thermal'"),
        (["--as", "netcdf", "-r", "9"], "no row 9 in this run (rows: 0 to 4)"),
        (["--as", "netcdf", "--rate", "30"], "30 Hz does not divide its 100 Hz"),
    ],
)
def test_invalid_export_is_refused_with_reason(run: Path, options: list[str], message: str) -> None:
    process = rig("export", run, *options)
    assert process.returncode == 2
    assert message in process.stderr


def test_windows_with_missing_ticks_are_marked(run: Path, tmp_path: Path) -> None:
    """Row 2 lost 20 of 1000 ticks; in row 4 the loop skipped ticks and counted them."""
    rows = [Row(i, 0, 490.9, -1000.0, 0.0, dict.fromkeys(POWERS, -10.0)) for i in range(5)]
    data = run_rows(rows, Shape())
    measured = data["plan.phase"] == Phase.MEASURE
    two, four = (np.flatnonzero(measured & (data["plan.row"] == row)) for row in (2, 4))
    data["timing.skipped"][four[50] :] = 7
    missing = [*two[100:120], *four[43:50]]
    plan = plan_json(rows, Shape())
    incomplete = write_run(tmp_path / "torn", np.delete(data, missing), plan, ticks=len(data) - 7)
    message = "row 2: 20 of 1000 ticks missing from the record"
    nc, text = tmp_path / "x.nc", tmp_path / "x.csv"
    process = rig("export", incomplete, "--as", "netcdf", "-o", nc)
    assert process.stdout.splitlines()[1].strip() == message
    with xarray.open_dataset(nc) as loaded:
        marked = loaded["record.incomplete"].values == 1
        inside = (loaded["plan.row"] == 2) & (loaded["plan.phase"] == int(Phase.MEASURE))
        assert np.array_equal(marked, inside.values)
        assert marked.sum() == 980
        assert loaded.attrs["record_incomplete_rows"] == message
    process = rig("export", incomplete, "--as", "csv", "-f", "power.dc", "-o", text, "--json")
    assert json.loads(process.stdout)["remarks"] == [message]
    with text.open() as file:
        assert sum(int(line["record.incomplete [flag]"]) for line in csv.DictReader(file)) == 980
    exported = export_structure(incomplete, RATE)
    assert message in exported.remarks
    assert exported.buses["rigSignals"]["incomplete"].sum() == 980
    assert export_structure(run, RATE).buses["rigSignals"]["incomplete"].sum() == 0
