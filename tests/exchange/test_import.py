"""Import of MASK4 files as runs that the whole analysis accepts."""

from __future__ import annotations

import json
from pathlib import Path

import mask4_file
import numpy as np
import pytest
from command_here import rig
from synthetic_runs import (
    POWERS,
    Row,
    Shape,
    measured,
    phase_block,
    plan_json,
    run_rows,
    stamped,
    write_run,
)

from rig.analysis.rows import row_table
from rig.interop.basin.merge import MergeSource, SyncChannels, merge
from rig.kinds.wavebot.mask4.export import export_structure, write_mat
from rig.realtime.reasons import Reason
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording.runs import list_runs, open_run, run_info
from rig.recording.runs.reader import check_record

NAME = "waveBotCtrlMdl_2023_09_26_12_08_43full.mat"
REGULAR = ("--frequency-hz", "0.5", "--amplitude-m", "0.127")


def import_file(path: Path, runs: Path, *options: str) -> Path:
    process = rig("import", path, *options, "--runs", runs, "--json")
    assert process.returncode == 0, process.stdout + process.stderr
    return Path(json.loads(process.stdout)["run"])


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("import")


@pytest.fixture(scope="module")
def run(runs: Path) -> Path:
    path = mask4_file.write(runs / NAME, mask4_file.buses())
    return import_file(path, runs / "runs", *REGULAR)


def test_rows_signs_and_powers(run: Path) -> None:
    """Six intervals give five rows: one is held while the spring moves. AC power is negative."""
    table = row_table(run)
    measured = [row for i, row in enumerate(mask4_file.ROWS) if i != 3]
    assert table["state"].values.tolist() == ["complete"] * 5
    assert table["kp"].values.tolist() == [row.kp for row in measured]
    assert table["ki"].values.tolist() == [row.ki for row in measured]
    assert table["spring_rate"].values.tolist() == [row.spring for row in measured]
    assert table["stator"].values.tolist() == [-13.0] * 3 + [27.0] * 2
    mechanical = np.array([row.mechanical for row in measured])
    assert np.allclose(table["power_mechanical_1"], mechanical, rtol=1e-6)
    assert np.allclose(table["power_mechanical_2"], 0.8 * mechanical, rtol=1e-6)
    # The analyser has other sample times; linear interpolation changes nothing here.
    assert np.allclose(table["power_ac"], 0.6 * mechanical, rtol=1e-9)
    assert np.allclose(table["power_dc"], 0.2 * mechanical, rtol=1e-9)
    assert np.allclose(table["current_peak"], 3.0, rtol=1e-4)
    assert np.allclose(table["slew_force_mean"], -55.0)
    assert np.allclose(table["stator_force_min"], 1700.0)
    assert (table["samples"] == 14.0 * 200).all()  # 7 waves of 2 s fit into 15 s
    assert table.attrs["mode"] == "imported"
    assert table.attrs["started_utc"].startswith("2023-09-26T12:08:43")


def test_mean_forces_can_be_kept(runs: Path, run: Path) -> None:
    """Over five and a half waves v has a mean, so a bias of 40 N contributes to F v."""
    path = runs / NAME
    without_zeros = import_file(
        path, runs / "none", *REGULAR, "--zeros", "none", "--settle-s", "4.9"
    )
    with_zeros = import_file(path, runs / "one", *REGULAR, "--zeros", "window", "--settle-s", "4.9")
    data = open_run(without_zeros, ["load.lcb", "tare.lcb", "power.mechanical_1", "heave.estimate"])
    assert np.all(data["tare.lcb"] == 0.0)
    assert np.allclose(
        data["power.mechanical_1"], data["load.lcb"] * data["heave.estimate.velocity"]
    )
    zero = open_run(with_zeros, ["tare.lcb"], 0)["tare.lcb"].values
    assert np.median(zero) == pytest.approx(mask4_file.BIAS, abs=0.5)


def test_matlab_7_3_gives_the_same_record(runs: Path, run: Path) -> None:
    path = mask4_file.write_newer(runs / f"newer_{NAME}", mask4_file.buses())
    same = import_file(path, runs / "newer", *REGULAR, "--name", "waveBotCtrlMdl")
    assert same.name == run.name
    assert open_run(same).equals(open_run(run))


def test_show_plot_and_compare_accept_an_imported_run(runs: Path, run: Path) -> None:
    shown = rig("show", run)
    assert shown.returncode == 0, shown.stderr
    assert "IMPORTED: recorded by another system" in shown.stdout
    assert "regular, 0.127 m, 0.5 Hz" in shown.stdout
    assert rig("plot", run).returncode == 0
    assert {"rows.csv", "surfaces.png", "summary.pdf"} <= {path.name for path in run.iterdir()}
    after_rows = import_file(
        mask4_file.write(runs / f"custom_{NAME}", mask4_file.buses(custom=True), alone=False),
        runs / "runs", *REGULAR, "--name", "custom",
    )  # fmt: skip
    compared = rig("compare", run, after_rows, "--json")
    assert compared.returncode == 0, compared.stderr
    report = json.loads(compared.stdout)
    assert not report["warnings"]
    assert [before_rows.mode for before_rows in list_runs(runs / "runs")] == [
        "imported",
        "imported",
    ]


def test_custom_drive_has_its_own_power_channel_and_settings(runs: Path) -> None:
    path = mask4_file.write(runs / f"drive_{NAME}", mask4_file.buses(custom=True))
    table = row_table(import_file(path, runs / "drive", *REGULAR))
    measured = np.array([row.mechanical for i, row in enumerate(mask4_file.ROWS) if i != 3])
    assert np.allclose(table["power_dc"], 0.2 * measured, rtol=1e-9)
    assert np.allclose(table["switching_period"], 1e-4)
    assert np.allclose(table["velocity_threshold"], 0.05)
    both = mask4_file.buses(custom=True)
    both["hbmSignals"]["heaveDriveInP"] = 0.0 * both["hbmSignals"]["time"]
    path = mask4_file.write(runs / f"both_{NAME}", both)
    process = rig("import", path, *REGULAR, "--runs", runs / "drive")
    assert process.returncode == 2
    assert "the file has DC power of both drives; name the drive" in process.stderr


def test_sine_and_trigger_are_imported_for_merging(run: Path, tmp_path: Path) -> None:
    """A basin file of the same time: the common sine has any phase, the trigger is at 10 s."""
    tau = np.arange(0.0, 200.0, 0.02)
    t = tau * (1.0 + 20e-6) + 4.0 + 100.0  # on the time of the MASK4 file, which begins at 100 s
    ttl = np.where(t >= 100.0 + mask4_file.START, 5.0, 0.0)
    columns = (tau, 2.0 * np.sin(2 * np.pi * t + 0.4), ttl, np.sin(np.pi * t))
    lines = [",".join(f"{cell:.6f}" for cell in row) for row in zip(*columns, strict=True)]
    path = tmp_path / "tank.csv"
    path.write_text("\n".join(["time_s,SINESIGNAL,TTLTrigger,BUOY04", *lines]) + "\n")
    merged = merge(run, [MergeSource("tank", path)], SyncChannels())
    (before_rows,) = (record.alignment for record in merged.records)
    assert (before_rows.method, before_rows.alarms) == ("edge and sine", ())
    assert before_rows.clock.to_run(100.0) == pytest.approx(104.002, abs=1e-4)


def test_basin_data_of_a_full_file_are_merged(runs: Path) -> None:
    """Uses `syncTimeTTL` without `syncTimeSine`, which the MASK4 script omits at lag 0."""
    structure = mask4_file.buses()
    t = np.arange(101.0, 250.0, 0.02)
    structure["waveData"] = {
        "ElapsedTime": t - 90.0, "syncTimeTTL": t, "BUOY04": 0.1 * np.sin(np.pi * t),
    }  # fmt: skip
    full = import_file(mask4_file.write(runs / f"full_{NAME}", structure), runs / "full", *REGULAR)
    assert (full / "merged_rows.csv").is_file()
    import xarray

    with xarray.open_dataset(full / "merged.nc") as table:
        time = table["time"].values
        inside = (time > 1.1) & (time < 149.0)
        expected = 0.1 * np.sin(np.pi * (time + 100.0))
        assert np.abs(table["waves.BUOY04"].values - expected)[inside].max() < 1e-6


def test_irregular_rows_are_298_s_as_in_the_scripts(runs: Path) -> None:
    """Intervals of 60 s instead of 300 s, in which gains change every 20 s, are cut short."""
    path = mask4_file.write(runs / f"irregular_{NAME}", mask4_file.buses())
    options = ("--irregular", "--hs-m", "0.254", "--interval-s", "60")
    table = row_table(import_file(path, runs / "irregular", *options))
    assert set(table["state"].values.tolist()) == {"cut short"}
    assert table["samples"].values.tolist() == [18 * 200, 38 * 200]  # rows 4 and 5 are equal
    slow = mask4_file.buses()
    slow["expParamSignals"]["heaveKpUsed"][: -5 * 200] = -1500.0
    slow["expParamSignals"]["heaveKiUsed"][:] = 0.0
    slow["magSpringSetpointSignals"]["targetSpring_N_m"][:] = 490.9
    path = mask4_file.write(runs / f"slow_{NAME}", slow)
    table = row_table(import_file(path, runs / "slow", *options))
    assert table["state"].values.tolist() == ["complete"] * 2
    assert table["samples"].values.tolist() == [58 * 200] * 2
    assert table["start"].values.tolist() == [132.0, 192.0]


def test_export_and_import_round_trip(tmp_path: Path) -> None:
    """An exported run is imported with its own rows, for any timing."""
    power = {"mechanical_1": -60.0, "mechanical_2": -50.0, "ac": -40.0, "dc": -20.0}
    rows = [Row(i, 0, 490.9, -1000.0 * (i + 1), 0.0, power) for i in range(3)]
    shape = Shape(noise=2.0)
    exported_run = write_run(tmp_path / "run", run_rows(rows, shape), plan_json(rows, shape))
    mat = write_mat(export_structure(exported_run, 100.0), tmp_path / "x.mat")
    imported_run = import_file(mat, tmp_path / "runs", *REGULAR)
    assert run_info(imported_run).started_utc == "2026-05-04T09:30:00+00:00"
    before_rows, after_rows = row_table(exported_run), row_table(imported_run)
    for name in ("kp", "ki", "spring_rate", "samples", "state"):
        assert before_rows[name].values.tolist() == after_rows[name].values.tolist(), name
    for name in ("power_ac", "power_dc", "power_ac_se", "power_mechanical_1_demeaned"):
        assert np.allclose(before_rows[name], after_rows[name], rtol=1e-12), name


def test_an_export_for_the_scripts_is_imported_with_the_same_rows(tmp_path: Path) -> None:
    """Run time zero is that of the file's first sample, 120 s before the first row."""
    power = dict.fromkeys(POWERS, -40.0)
    rows = [Row(i, 0, rate, -1000.0 * (i + 1), 0.0, power) for i, rate in enumerate((491.0, -5e3))]
    shape = Shape(dt=0.005, noise=2.0, tail=0)
    data = run_rows(rows, shape)
    exported_run = write_run(tmp_path / "run", data, plan_json(rows, shape))
    exported = export_structure(exported_run, for_scripts=True)
    imported_run = import_file(write_mat(exported, tmp_path / "x.mat"), tmp_path / "runs")
    before_rows, after_rows = row_table(exported_run), row_table(imported_run)
    for name in ("kp", "ki", "spring_rate", "samples", "state"):
        assert before_rows[name].values.tolist() == after_rows[name].values.tolist(), name
    for name in ("power_ac", "power_dc", "power_mechanical_1_demeaned"):
        assert np.allclose(before_rows[name], after_rows[name], rtol=1e-12), name
    # The first row begins 0.5 s into the run.
    assert run_info(imported_run).started_utc == "2026-05-04T09:28:00.500000+00:00"


def test_samples_that_an_export_left_out_do_not_count_as_lost(tmp_path: Path) -> None:
    """The stator moves between two rows without settling or tail around their windows."""
    rows = [Row(i, 0, -300.0 * i, -1000.0, 0.0, dict.fromkeys(POWERS, -9.0)) for i in range(2)]
    shape = Shape(dt=0.005)
    random = np.random.default_rng(0)
    pieces = [
        phase_block(300, NO_ROW, Phase.LEAD_IN),
        measured(0, rows[0], shape, random),
        phase_block(123, 1, Phase.MOVING, rows[1]),
        measured(1, rows[1], shape, random),
        phase_block(20, NO_ROW, Phase.DONE),
    ]
    pieces[-1]["safety.reason"] = Reason.PLAN_END
    data = stamped(np.concatenate(pieces), shape.dt)
    run = write_run(tmp_path / "run", data, plan_json(rows, shape))
    exported = export_structure(run, for_scripts=True)
    assert exported.buses["rigSignals"]["leftOut"].max() == 123.0
    imported_run = import_file(write_mat(exported, tmp_path / "x.mat"), tmp_path / "runs")
    assert row_table(imported_run)["state"].values.tolist() == ["complete"] * 2
    assert check_record(imported_run).lost == 0


@pytest.mark.parametrize(
    ("started", "options", "expected"),
    [
        (1_777_887_000.25, (), "2026-05-04T09:30:00.250000+00:00"),
        (1_777_887_000.25, ("--started", "2020-01-02T03:04:05"), "2020-01-02T03:04:05+00:00"),
        (None, (), "2023-09-26T12:08:43+00:00"),  # of the file's name
    ],
)
def test_the_start_is_that_of_the_option_then_of_the_file_then_of_its_name(
    tmp_path: Path, started: float | None, options: tuple[str, ...], expected: str
) -> None:
    structure = mask4_file.buses()
    if started is not None:  # time of MASK4 files does not begin at 0
        structure["rigSignals"] = {"startedUtc_s": np.array([started - 100.0])}
    path = mask4_file.write(tmp_path / NAME, structure, alone=False)
    assert run_info(import_file(path, tmp_path, *REGULAR, *options)).started_utc == expected


@pytest.mark.parametrize("started", [np.nan, np.inf, 1e300, -1e15])
def test_a_start_that_is_no_time_is_refused(tmp_path: Path, started: float) -> None:
    structure = mask4_file.buses() | {"rigSignals": {"startedUtc_s": np.array([started])}}
    path = mask4_file.write(tmp_path / "x.mat", structure, alone=False)
    process = rig("import", path, *REGULAR, "--runs", tmp_path / "runs")
    assert process.returncode == 2
    assert f"x.mat: rigSignals.startedUtc_s is {started:g}, no time in s since" in process.stderr
    assert not (tmp_path / "runs").exists()


def test_a_file_without_any_start_is_refused(tmp_path: Path) -> None:
    path = mask4_file.write(tmp_path / "x.mat", mask4_file.buses())
    process = rig("import", path, *REGULAR, "--runs", tmp_path / "runs")
    assert process.returncode == 2
    assert "x.mat: no date in the file or its name; give --started" in process.stderr
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("damage", "options", "message"),
    [
        (lambda b: b.pop("heaveSignals"), REGULAR, "no heaveSignals.time: not the MASK4 structure"),
        (lambda b: b.pop("expCtrl"), REGULAR, "no expCtrl.runCounter in the file"),
        (lambda b: None, (), "the file does not hold the length of its rows"),
        (lambda b: None, ("--frequency-hz", "0.5", "--irregular"), "give one of them"),
        (lambda b: None, (*REGULAR, "--periods", "9"), "18 s does not fit into the 15 s"),
        (lambda b: None, (*REGULAR, "--drive", "custom"), "no DC power of the custom drive"),
        (
            lambda b: b["hbmSignals"].update(heaveDriveInP=np.zeros(7)),
            REGULAR,
            "hbmSignals.heaveDriveInP has 7 samples, its time",
        ),
        (
            lambda b: b["expCtrl"]["runCounter"].fill(0.0),
            REGULAR,
            "expCtrl.runCounter is never 1",
        ),
    ],
)
def test_invalid_file_is_refused_with_reason(
    tmp_path: Path, damage: object, options: tuple[str, ...], message: str
) -> None:
    structure = mask4_file.buses()
    damage(structure)  # type: ignore[operator]
    path = mask4_file.write(tmp_path / NAME, structure)
    process = rig("import", path, *options, "--runs", tmp_path / "runs")
    assert process.returncode == 2
    assert message in process.stderr, process.stderr
    assert not (tmp_path / "runs").exists()


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    process = rig("import", tmp_path / NAME, *REGULAR, "--runs", tmp_path / "runs")
    assert (process.returncode, "cannot be read: No such file" in process.stderr) == (2, True)
    (tmp_path / "x.mat").write_text("hello")
    options = ("--started", "2023-09-26", "--runs", str(tmp_path / "runs"))
    process = rig("import", tmp_path / "x.mat", *REGULAR, *options)
    assert (process.returncode, "not readable as a MATLAB file" in process.stderr) == (2, True)
