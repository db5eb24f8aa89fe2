"""Runs read with other calibrations than they were recorded with: rows, products, commands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_runs as synthetic
import xarray
from calibration_files import write
from matplotlib.figure import Figure
from rig_command import rig_here
from synthetic_runs import Row, Shape

from rig.analysis.report import analyse, write_products
from rig.analysis.rows import row_table
from rig.recording.calibration import CalibrationVersion, ValidityError, open_calibration

POWER = {"mechanical_1": -80.0, "mechanical_2": -60.0, "ac": -40.0, "dc": -5.0}
CONFIG = {"name": "default", "rig": {"name": "b", "heave": {"torque_constant_n_m_per_a": 6.0}}}
DATES = "{dates: {from: 2026-05-01, before: 2026-06-01}}"  # synthetic runs are of 2026-05-04
EARLIER = "{dates: {before: 2026-05-04}}"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rows = [
        Row(i, 0, rate, -2000.0, 1000.0 * i, POWER)
        for i, rate in enumerate((490.9, 490.9, -5715.0, -5715.0))
    ]
    shape = Shape(settle=5, tail=2, lead_in=10)
    folder = tmp_path_factory.mktemp("runs") / "20260504T093000Z_default"
    plan = synthetic.plan_json(rows, shape)
    return synthetic.write_run(folder, synthetic.run_rows(rows, shape), plan, config=CONFIG)


def calibration(folder: Path, quantity: str, correction: str, **more: Any) -> CalibrationVersion:
    keys = {"valid": DATES, "outside": "refuse"} | more
    return open_calibration(write(folder, quantity=quantity, correction=correction, **keys))


def read(run: Path, *calibrations: CalibrationVersion) -> xarray.Dataset:
    return row_table(run, calibrations)


def changed(before: xarray.Dataset, after: xarray.Dataset) -> set[str]:
    """Return columns with other values, and new columns."""
    return {
        str(name)
        for name in after.variables
        if name not in before.variables
        or not xarray.Variable.identical(before[name].variable, after[name].variable)
    }


def test_a_corrected_spring_rate_changes_nothing_else(tmp_path: Path, run: Path) -> None:
    plain = row_table(run)
    table = read(run, calibration(tmp_path, "spring_rate", "{kind: scale, factor: 0.769}"))
    assert table["spring_rate"].values.tolist() == [377.5021, 377.5021, -4394.835, -4394.835]
    assert changed(plain, table) == {"spring_rate", "spring_rate_recorded"}
    assert table["spring_rate_recorded"].values.tolist() == plain["spring_rate"].values.tolist()
    assert table["spring_rate_recorded"].attrs["units"] == "N/m"
    assert table.attrs["read_by"] == "one v1"
    assert "sha256" in table.attrs["calibration"]
    assert not {"read_by", "calibration"} & set(plain.attrs)


def test_a_torque_constant_scales_force_and_gains(tmp_path: Path, run: Path) -> None:
    """The drive controlled the current; 6 N*m/A was assumed, 6.6 N*m/A is true."""
    plain = row_table(run)
    table = read(run, calibration(tmp_path, "torque_constant", "{kind: scale, factor: 1.1}"))
    for name in ("kp", "ki", "force_rms", "force_peak"):
        np.testing.assert_allclose(table[name], 1.1 * plain[name], rtol=1e-12)
    assert not {name for name in changed(plain, table) if name.startswith(("power", "current"))}
    offset = read(run, calibration(tmp_path, "torque_constant", "{kind: offset, offset: -3}"))
    np.testing.assert_allclose(offset["kp"], 0.5 * plain["kp"])


def test_a_corrected_position_changes_its_derived_columns(tmp_path: Path, run: Path) -> None:
    plain = row_table(run)
    scaled = read(run, calibration(tmp_path, "heave_position", "{kind: scale, factor: 1.25}"))
    for name in ("stroke", "velocity_rms", "velocity_p98", "position_peak", "power_mechanical_1",
                 "power_mechanical_2", "power_mechanical_1_demeaned"):  # fmt: skip
        np.testing.assert_allclose(scaled[name], 1.25 * plain[name], rtol=1e-12)
    np.testing.assert_allclose(
        scaled["kp"], 0.8 * plain["kp"]
    )  # the gain acted on 0.8 of the velocity
    for name in ("power_ac", "power_dc", "force_rms", "current_rms"):
        np.testing.assert_array_equal(scaled[name], plain[name])
    moved = read(run, calibration(tmp_path, "heave_position", "{kind: offset, offset: 0.01}"))
    np.testing.assert_allclose(moved["position_mean"], plain["position_mean"] + 0.01, atol=1e-12)
    np.testing.assert_allclose(moved["stroke"], plain["stroke"])
    assert (plain["position_alarm"].values == 0).all()
    assert (moved["position_alarm"].values == 1).all()
    table = "{kind: table, recorded: [-1, 0, 1], corrected: [-1, 0, 1.1]}"
    with pytest.raises(ValidityError, match="is a table of positions"):
        read(run, calibration(tmp_path, "heave_position", table))


def test_outside_its_range_a_calibration_changes_nothing_or_refuses(
    tmp_path: Path, run: Path
) -> None:
    half = "{kind: scale, factor: 0.5}"
    with pytest.raises(ValidityError, match="one v1 does not hold for 2026-05-04: valid for dates"):
        read(run, calibration(tmp_path, "spring_rate", half, valid=EARLIER))
    table = read(
        run, calibration(tmp_path, "spring_rate", half, valid=EARLIER, outside="unchanged")
    )
    assert changed(row_table(run), table) == set()
    assert table.attrs["read_by"] == "one v1 (outside its range)"
    numbered = calibration(
        tmp_path, "spring_rate", half, valid="{runs: {series: MASK4, before: 51}}"
    )
    with pytest.raises(
        ValidityError, match="one v1: valid for MASK4 runs before 51; of 2026-05-04"
    ):
        read(run, numbered)
    with pytest.raises(ValueError, match="both correct spring_rate: give one of them"):
        read(run, *[calibration(tmp_path, "spring_rate", half)] * 2)


def test_products_name_their_calibrations(tmp_path: Path, run: Path) -> None:
    plain = {path.name: path.read_bytes() for path in write_products(run)}
    known = calibration(tmp_path, "spring_rate", "{kind: scale, factor: 0.769}")
    created = write_products(run, [known])
    assert {path.parent for path in created} == {run / "read_by_one_v1"}
    assert {path.name for path in created} == set(plain)
    assert all((run / name).read_bytes() == data for name, data in plain.items())
    text = (run / "read_by_one_v1" / "summary.txt").read_text()
    assert "calib.   one v1 (sha256 " in text
    assert "spring +378 N/m" in text
    with xarray.open_dataset(run / "read_by_one_v1" / "rows.nc") as table:
        assert table.attrs["read_by"] == "one v1"
    assert analyse(run).summary.calibration == ""


def test_the_commands_apply_a_calibration_on_request(tmp_path: Path, run: Path) -> None:
    calibration(tmp_path, "spring_rate", "{kind: scale, factor: 0.769}")
    file = str(tmp_path / "one_1.yaml")

    def rig(*arguments: str) -> tuple[int, str, str]:
        return rig_here(*arguments, "--calibration", file)

    code, out, _ = rig("show", str(run), "--json")
    table = json.loads(out)
    assert (code, table["optima"][0]["spring_rate_n_per_m"]) == (0, 377.5021)
    assert table["calibration"].startswith("one v1 (sha256 ")
    code, out, _ = rig("plot", str(run), "--surface", "ki", "kp")
    assert (code, Path(out.strip()).parent.name) == (0, "read_by_one_v1")
    code, _, errors = rig("plot", str(run), "-f", "power.ac")
    assert (code, "show recorded values" in errors) == (2, True)


def test_diff_names_the_command_for_outdated_products(
    tmp_path: Path, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Figure, "savefig", lambda *table, **more: None)  # figures are not needed
    for version, factor, more in ((1, 1, {}), (2, 0.769, {"supersedes": 1})):
        correction = f"{{kind: scale, factor: {factor}}}"
        calibration(tmp_path, "spring_rate", correction, version=version, **more)
    old, new = (str(tmp_path / f"one_{version}.yaml") for version in (1, 2))
    write_products(run)
    _, out, _ = rig_here("calibration", "diff", old, new, "--runs", run.parent)
    assert f"rig plot RUN --calibration {new} makes the new products of a run" in out
    assert "row 2: -5715 -> -4394.835 N/m (recorded -5715)" in out
