"""`rig.open` and `rig.rehearse`: values as other readers find them in the files, names as declared.

The runs are rehearsals of all three kinds of rig, a trip, and records that were cut off.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import threading
from html import escape
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas
import pytest
import xarray
from killed_runs import kill
from mcap.reader import make_reader

import rig
from rig.campaign.check import check_campaign as check_any_campaign
from rig.kinds.oswec_bench.tick.signals import DriveMode
from rig.realtime.reasons import Reason
from rig.realtime.safety import Mode
from rig.realtime.sequence import Phase
from rig.recording.runs import open_run

CAMPAIGN: dict[str, Any] = {
    "name": "grid",
    "rig": "wavebot",
    "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
    "timing": {"settle_s": 4, "interval_s": 10},
    "start": {"lead_in_s": 20},
    "matrix": {
        "grid": [
            {
                "spring_n_per_m": 490.9,
                "kp_n_s_per_m": [-1500, -2500],
                "ki_n_per_m": [2000, 4000, 6000],
            }
        ]
    },
}


# The drive has no supply: the second row consumes the energy that the first has captured.
STARVING = {
    "name": "trips",
    "rig": "wavebot_custom",
    "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.3},
    "drive": {"supply": "disconnected"},
    "tare": {"duration_s": 1},
    "start": {"lead_in_s": 20},
    "timing": {"settle_s": 5, "periods": 2},
    "matrix": {
        "list": [
            {"spring_n_per_m": -8508, "kp_n_s_per_m": -2500, "ki_n_per_m": 3000},
            {"spring_n_per_m": -8508, "kp_n_s_per_m": -100, "ki_n_per_m": -8000},
        ]
    },
}


def write(folder: Path, name: str, content: dict[str, Any]) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(json.dumps(content))  # JSON is YAML
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> rig.Run:
    folder = tmp_path_factory.mktemp("api")
    return rig.rehearse(write(folder, "grid", CAMPAIGN), out=folder / "runs", progress=False)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> rig.Run:
    folder = tmp_path_factory.mktemp("bench")
    return rig.rehearse("driveline_short", out=folder, progress=False)


def test_rows_are_those_of_the_files(run: rig.Run) -> None:
    written = pandas.read_csv(run.path / "rows.csv", keep_default_na=False, index_col="row")
    units = {name.split(" [")[0]: name.split("[")[1][:-1] for name in written if "[" in name}
    written.columns = [name.split(" [")[0] for name in written.columns]
    assert list(run.rows.columns) == list(written.columns)
    assert run.rows.attrs["units"] == units
    assert len(run.rows) == 6
    for name in written.columns:
        ours, theirs = run.rows[name].tolist(), written[name].tolist()
        if name.endswith("_alarm"):
            assert run.rows[name].dtype == bool
        assert ours == theirs, name


def test_the_table_is_that_of_hdf5_and_is_computed_alike_without_it(
    run: rig.Run, tmp_path: Path
) -> None:
    with h5py.File(run.path / "rows.nc") as file:
        assert run.table["power_dc"].values.tolist() == file["power_dc"][:].tolist()
        assert run.table["power_dc"].attrs["units"] == file["power_dc"].attrs["units"] == "W"
    bare = tmp_path / run.path.name
    shutil.copytree(run.path, bare)
    (bare / "rows.nc").unlink()
    pandas.testing.assert_frame_equal(rig.open(bare).rows, run.rows)


def test_log_of_a_row_has_names_for_integers(run: rig.Run) -> None:
    tree = run.sel(row=3)
    raw = open_run(run.path, rows=[3])
    assert tree.time.attrs["units"] == "s"
    assert tree.time.values.tolist() == raw["time"].values.tolist()
    for field, names in (("safety.mode", Mode), ("plan.phase", Phase)):
        group, _, leaf = field.rpartition(".")
        expected = [names(number).name for number in raw[field].values.tolist()]
        assert tree[group][leaf].values.tolist() == expected
    assert set(tree.safety.reason.values) == {Reason.NONE.name}
    assert set(tree.drive_command.settings.scheme.values) == {"SVPWM"}
    assert set(tree.heave.sense.fault.values) == {"NONE"}
    assert tree.heave.command.enable.dtype == bool
    force = tree.heave.command.force
    assert force.attrs == {"long_name": "heave force", "units": "N"}
    assert tree["heave/command/force"].values.tolist() == raw["heave.command.force"].values.tolist()
    assert tree.plan.row.values.tolist() == [3] * tree.sizes["time"]


def test_a_reader_of_mcap_finds_the_same_first_and_last_tick(run: rig.Run) -> None:
    with (run.path / "run.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert run.log.sizes["time"] == summary.statistics.message_count == run.record.ticks


def test_power_of_a_row_is_the_mean_of_its_measured_ticks(run: rig.Run) -> None:
    for row in (0, 5):
        log = run.sel(row=row, phase="measure", fields=["power.dc", "power.ac"])
        assert set(log.power.data_vars) == {"dc", "ac"}
        assert float(log.power.dc.mean()) == run.rows.power_dc[row]
        assert log.sizes["time"] == run.rows.samples[row]
    several = run.sel(row=[0, 5], fields="plan.row")
    assert set(several.plan.row.values.tolist()) == {0, 5}


def test_the_whole_log_is_read_field_by_field(run: rig.Run) -> None:
    raw = open_run(run.path, ["heave.estimate.position", "safety.mode"])
    position = run.log.heave.estimate.position
    assert position.values.tolist() == raw["heave.estimate.position"].values.tolist()
    part = run.log["heave/estimate/position"].sel(time=slice(30.0, 31.0))
    assert (
        part.values.tolist()
        == raw["heave.estimate.position"].sel(time=slice(30.0, 31.0)).values.tolist()
    )
    assert run.log.safety.mode.isel(time=[0, -1]).values.tolist() == [
        Mode(int(raw["safety.mode"].values[place])).name for place in (0, -1)
    ]


def test_surfaces_have_the_powers_of_the_rows(run: rig.Run) -> None:
    assert dict(run.surfaces.sizes) == {"kp": 2, "ki": 3}
    for _, row in run.rows.iterrows():
        at = run.surfaces.sel(kp=row.kp, ki=row.ki)
        assert float(at.power_mechanical_1) == row.power_mechanical_1
        assert float(at.power_mechanical_1_se) == row.power_mechanical_1_se
    assert run.surfaces.ki.attrs["units"] == "N/m"


def test_best_points_and_effects_are_those_of_the_files(run: rig.Run) -> None:
    stored = json.loads((run.path / "summary.json").read_text())
    for optimum in stored["optima"]:
        ours = run.best.loc[optimum["power"]]
        assert (ours.power, ours.rows) == (optimum["mean_w"], optimum["rows"])
        assert run.rows[f"power_{optimum['power']}"].min() == ours.power
    effects = pandas.read_csv(run.path / "effects.csv")
    pandas.testing.assert_frame_equal(run.effects, effects, check_dtype=False)
    assert run.summary.optima[0].mean_w == stored["optima"][0]["mean_w"]
    assert str(run.summary).startswith(Path(run.path / "summary.txt").read_text()[:60])


def test_files_of_the_run_are_nested_values(run: rig.Run) -> None:
    stored = json.loads((run.path / "config.json").read_text())
    assert run.config.as_dict() == stored
    assert run.campaign.sea.frequency_hz == 0.5
    assert run.campaign.matrix.grid[0].kp_n_s_per_m == (-1500, -2500)
    assert run.config.rig.rate_hz == stored["rig"]["rate_hz"]
    with pytest.raises(AttributeError, match=r"config\.rig has no rate; near: rate_hz"):
        _ = run.config.rig.rate
    assert run.certificate is not None
    assert run.certificate.as_dict()["run"] == run.name
    assert run.pictures.surfaces._repr_png_()[:4] == b"\x89PNG"
    assert set(run.pictures) == {path.stem for path in run.path.glob("*.png")}


def test_events_are_the_changes_in_the_log(run: rig.Run) -> None:
    raw = open_run(run.path, ["safety.mode", "plan.row"])
    modes = raw["safety.mode"].values
    states = run.events[run.events.event == "state"]
    assert len(states) == 1 + np.count_nonzero(np.diff(modes))
    begins = run.events[run.events.event == "row"]
    for row, time in zip(range(6), begins.time, strict=True):
        assert time == float(raw["time"].values[raw["plan.row"].values == row][0])
    (stop,) = run.events[run.events.event == "stop"].text
    assert stop == f"PLAN_END: {run.info.reasons.text('PLAN_END')}"
    assert run.journal.empty


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda run: run.sel(row=99), r"no row 99 in this run \(rows: 0 to 5\)"),
        (lambda run: run.sel(row=1.5), "whole numbers|not iterable"),
        (lambda run: run.sel(row=[]), "empty list"),
        (lambda run: run.sel(row=1, phase="measured"), "phase 'measured': allowed TARE, LEAD_IN"),
        (lambda run: run.sel(row=1, fields="power.dd"), "no field 'power.dd'.*near: power.d"),
        (lambda run: run.export("xlsx"), "form 'xlsx': allowed mat, netcdf, csv"),
        (lambda run: run.export("csv", rate=333.0), "333 Hz does not divide its 1000 Hz"),
    ],
)
def test_errors_name_path_value_and_range(run: rig.Run, ask: Any, message: str) -> None:
    with pytest.raises(rig.RigError, match=message) as raised:
        ask(run)
    if "row 99" in message:
        assert str(run.path) in str(raised.value)


def test_an_export_is_read_by_xarray(run: rig.Run, tmp_path: Path) -> None:
    path = run.export("netcdf", tmp_path / "log.nc", fields=["power.dc"], rows=[2])
    with xarray.open_dataset(path, engine="h5netcdf") as exported:
        ours = run.sel(row=2, fields="power.dc").power.dc
        assert exported["power.dc"].values.tolist() == ours.values.tolist()


def test_paths_that_are_no_run(tmp_path: Path, run: rig.Run) -> None:
    with pytest.raises(rig.RigError, match=r"no run.mcap") as empty:
        rig.open(tmp_path)
    assert str(tmp_path) in str(empty.value)
    with pytest.raises(rig.RigError, match="no such run or campaign") as unknown:
        rig.open("nothing", runs=run.path.parent)
    assert run.name in str(unknown.value)
    assert rig.open("last", runs=run.path.parent).name == run.name
    with pytest.raises(rig.RigError, match="no such folder"):
        rig.runs(tmp_path / "absent")
    assert rig.runs(run.path.parent).loc[run.name].rows_done == 6


def test_session_rows_constants_and_tables(session: rig.Run) -> None:
    assert session.rows.state.tolist() == ["complete"] * 4
    planned = json.loads((session.path / "plan.json").read_text())["rows"]
    assert session.rows.amplitude_deg.tolist() == [row["amplitude_deg"] for row in planned]
    stored = json.loads((session.path / "session.json").read_text())["constants"]
    assert {name: row.value for name, row in session.constants.iterrows()} == {
        name: each["value"] for name, each in stored.items()
    }
    built = float(session.config.plant.transmission.half_gap.value)
    gap = session.constants.loc["half_gap"]
    assert abs(gap.value - built) < 2.0 * gap.uncertainty
    with h5py.File(session.path / "deflection_map.nc") as file:
        assert session.tables["deflection_map"].torque.tolist() == file["torque"][:].tolist()
    assert set(session.sel(row=1).command.mode.values) == {DriveMode.VELOCITY.name}
    with pytest.raises(rig.RigError, match=r"a session has no row table; see run\.tables"):
        _ = session.surfaces
    assert "stiffness" in repr(session)


def test_a_record_that_was_cut_off(run: rig.Run, tmp_path: Path) -> None:
    killed = tmp_path / run.path.name
    shutil.copytree(run.path, killed)
    kill(killed, 1 / 2)
    cut = rig.open(killed)
    assert cut.outcome.status == "abandoned"
    states = cut.rows.state.tolist()
    measured = states.count("complete")
    assert 0 < measured < 6
    assert cut.rows.power_dc[:measured].tolist() == run.rows.power_dc[:measured].tolist()
    assert cut.record.state == "unfinished"
    assert "rig recover" in repr(cut)
    assert cut.certificate is not None  # the file of the whole run is still there


def test_a_trip_is_an_outcome_and_no_exception(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The prediction, which would refuse the second row, is disabled."""
    from rig.kinds.wavebot import tasks
    from rig.kinds.wavebot.campaign import CAMPAIGNS

    def examine(path: Path, rig: Path | None, day: Any) -> Any:
        return check_any_campaign(CAMPAIGNS, path, rig=rig)

    monkeypatch.setattr(tasks, "examine", examine)
    path = write(tmp_path, "trips", STARVING)
    run = rig.rehearse(path, out=tmp_path / "runs", progress=False)
    status = json.loads((run.path / "run.json").read_text())
    assert status["reason"] == "BUS_UNDERVOLTAGE"
    assert (run.outcome.status, run.outcome.reason) == ("fault", status["reason"])
    assert not run.outcome.complete
    assert run.rows.state.tolist()[0] == "complete"
    assert run.certificate is None
    assert str(run.outcome) in repr(run)
    assert "#d64545" in run._repr_html_()
    stop = run.events[run.events.event == "stop"].iloc[0]
    assert stop.text.startswith(status["reason"])


def test_a_failed_check_raises_with_all_problems(tmp_path: Path) -> None:
    bad = CAMPAIGN | {"sea": {"kind": "regular", "amplitude_m": 12.7, "frequency_hz": 50}}
    path = write(tmp_path, "bad", bad)
    with pytest.raises(rig.RigError) as raised:
        rig.rehearse(path, out=tmp_path / "runs", progress=False)
    assert {each.key for each in raised.value.problems} == {"sea.amplitude_m", "sea.frequency_hz"}
    assert "allowed 0.001 .. 0.5 m" in str(raised.value)
    assert not (tmp_path / "runs").exists()
    checked = rig.check(path)
    assert not checked
    assert checked.problems == raised.value.problems


def test_a_rehearsal_in_a_thread_reports_and_equals_that_of_the_command(
    tmp_path: Path, run: rig.Run
) -> None:
    path = write(tmp_path, "grid", CAMPAIGN)
    found: list[Any] = []
    reports: list[rig.Progress] = []

    def rehearse() -> None:
        found.append(rig.rehearse(path, out=tmp_path / "runs", progress=reports.append))

    thread = threading.Thread(target=rehearse)
    thread.start()
    thread.join()
    command = (sys.executable, "-m", "rig", "run", str(path), "--runs", str(tmp_path / "by"))
    subprocess.run([*command, "--json"], check=True, capture_output=True)
    (by_command,) = (tmp_path / "by").iterdir()
    with xarray.open_dataset(by_command / "rows.nc", engine="h5netcdf") as theirs:
        assert theirs.equals(found[0].table)
        assert theirs.equals(run.table)
    assert {path.name for path in by_command.iterdir()} == {
        path.name for path in found[0].path.iterdir()
    }
    assert reports[-1].total == 6
    assert [each.done for each in reports] == sorted(each.done for each in reports)


def test_the_card_needs_nothing_from_elsewhere(run: rig.Run) -> None:
    html = run._repr_html_()
    assert len(html) < 6000
    assert not any(term in html for term in ("http", "src=", "@import", "<script"))
    best = run.best.loc["dc"]
    assert escape(best.text) in html
    assert best.text in repr(run)
    assert "6 of 6 complete" in html
