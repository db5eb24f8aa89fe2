"""Sweeps of sessions: rows and results of a rehearsal, mistakes, trips, resuming, pictures."""

from __future__ import annotations

import json
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from rehearsing import CONFIGS, write_yaml
from rig_command import rig, rig_here
from test_sweep_rows import Counting, interrupt_after, problem_lines, run_test_sweep

from rig.config.yaml_source import load_mapping
from rig.kinds.oswec_bench import simulation
from rig.kinds.oswec_bench.products.points import FIELDS
from rig.recording.runs import reader, run_info
from rig.recording.runs.windows import REQUIRED_FIELDS, read_windows
from rig.sweeps import cluster, sweep
from rig.sweeps.result_cache import JOURNAL_FILE

GAP = "plant.transmission.half_gap.value"
SHORT = {"tare": {"duration_s": 0.5}, "timing": {"rise_s": 0.5, "settle_periods": 0, "periods": 2}}
GRIDS: dict[str, dict[str, Any]] = {
    "driveline": {"amplitude_deg": [5, 15], "damping_n_m_s_per_rad": [42, 104], "period_s": 1},
    "torque_constant": {"current_amplitude_a": [1.12, 2.23, 4.47], "period_s": 4},
    "brake_map": {"amplitude_deg": 5, "brake_current_a": [0.1, 0.3, 0.2], "period_s": 1},
    "torque_tracking": {"torque_amplitude_n_m": [20, 40], "period_s": 1},
    "flap_free_decay": {"release_deg": [8, -12, 6, -10], "period_s": 3},
    "flap_pto_sweep": {
        "wave_amplitude_m": 0.03,
        "period_s": 1,
        "pto_damping_n_m_s_per_rad": [35, 70, 95, 130, 180],
    },
}
RIGS = {"flap_free_decay": "oswec_flap_free", "flap_pto_sweep": "oswec_flap"}


def write_session(folder: Path, session: str = "driveline", **keys: Any) -> Path:
    """Write a short session of a kind on the shipped bench or flap."""
    content = {
        "name": session,
        "session": session,
        "rig": str(CONFIGS / "rigs" / f"{RIGS.get(session, 'oswec_bench')}.yaml"),
        "grid": [GRIDS[session]],
        **SHORT,
        **({"shaft": "clamped"} if session.startswith("torque") else {}),
        **keys,
    }
    return write_yaml(folder / f"{session}.yaml", content)


def rehearse(path: Path, *options: str) -> Path:
    """Rehearse a session and return the run's folder."""
    runs = path.parent / "runs"
    result = rig("run", path, "--runs", runs, "--json", *options)
    assert result.returncode == 0, result.stderr
    (folder,) = runs.iterdir()
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("session", GRIDS)
def test_rows_and_results_are_those_of_a_rehearsal(session: str, tmp_path: Path) -> None:
    """Every kept number of every measured tick is compared with an interpreted rehearsal."""
    path = write_session(tmp_path, session)
    run = rehearse(path, "--interpreted")
    source = reader.open_files(run)
    logged = read_windows(source, list(FIELDS), run_info(run, source.contents).plan)
    opened = simulation.open_session(path, load_mapping)
    simulator = simulation.open_simulator(opened)
    simulated = simulator.simulate(simulator._plan)
    rows = 0
    for window, own in zip(logged, simulated, strict=True):
        assert window[:2] + window[3:] == own[:2] + own[3:]
        for name in dict.fromkeys((*REQUIRED_FIELDS, *FIELDS)):
            kept = np.ascontiguousarray(own.data[name])
            assert np.ascontiguousarray(window.data[name]).tobytes() == kept.tobytes(), name
        rows += 1
    assert rows == json.loads((run / "plan.json").read_text())["rows"][-1]["row"] + 1 > 1

    recorded = json.loads((run / "session.json").read_text())
    table = run_test_sweep(path)[1]
    assert table["state"].item() == "complete"
    found = 0
    for name, constant in recorded["constants"].items():
        number = {"value": table[name], "uncertainty": table[f"{name}_uncertainty"]}
        for key, each in number.items():
            unknown = constant[key] is None  # NaN in JSON
            assert np.isnan(each.item()) if unknown else each.item() == constant[key]
            assert each.attrs["units"] == constant["unit"]
        found += 1
    assert found >= {"torque_tracking": 0}.get(session, 1)
    missed = [each["quantity"] for each in recorded["comparisons"] if each["target_met"] is False]
    assert table["targets_missed"].item() == "; ".join(missed)


@pytest.mark.slow
def test_the_gap_of_the_plant_is_found_again(tmp_path: Path) -> None:
    values = (0.01, 0.0228, 0.06)
    options = ("--over", f"{GAP}={','.join(map(str, values))}", "--over", "seed=1,2")
    path, folder = write_session(tmp_path), tmp_path / "s"
    code, out, error = rig_here("sweep", path, *options, "--sweeps", folder, "--json")
    assert code == 0, error
    report = json.loads(out)
    assert report["cases"] == {"complete": 6}
    assert report["results"]["half_gap"]["unit"] == "deg"
    assert [Path(name).name for name in report["pictures"]] == [
        f"results_{GAP}.png", "results_seed.png",
    ]  # fmt: skip
    table = xarray.load_dataset(report["result"], engine="h5netcdf")
    assert table["half_gap"].dims == (GAP, "seed")
    assert (table[GAP].attrs["units"], table["half_gap"].attrs["units"]) == ("deg", "deg")
    assert table["grid.0.amplitude_deg.1"].item() == 15.0
    assert table["grid.0.amplitude_deg.1"].attrs["units"] == "deg"
    error_of_gap = abs(table["half_gap"] - table[GAP])
    assert float(error_of_gap.max()) < 5e-4  # deg; the smallest gap is 0.01
    assert float(table["half_gap_uncertainty"].max()) > 0.0
    assert (
        table["half_gap"].sel(seed=1).values.tolist()
        != table["half_gap"].sel(seed=2).values.tolist()
    )
    # Nothing is left to run: the report and its files are those of the first time.
    stamps = [Path(name).stat().st_mtime_ns for name in report["pictures"]]
    code, text, _ = rig_here("sweep", path, *options, "--sweeps", folder)
    assert code == 0
    assert "6 complete" in text
    assert "all cases were finished before" in text
    assert re.search(r"\n  half_gap +0\.0\d+ \.\. 0\.0\d+ deg\n", text)
    assert [Path(name).stat().st_mtime_ns for name in report["pictures"]] == stamps


def test_all_mistakes_are_reported_at_once(tmp_path: Path) -> None:
    lines = problem_lines(
        write_session(tmp_path),
        "sea.hs_m=1", "session=losses", "timing.periods=0,3", "plant.transmission.half_gap=1",
        "grid.0.damping_n_m_s_per_rad=2000", "rig.servo.gear_rato=1", "control=fast",
    )  # fmt: skip
    assert lines[0].startswith("--over:1: sea.hs_m: not a parameter of a session; allowed calib")
    text = "\n".join(lines)
    assert "--over:2: session: not a parameter of a session" in text
    assert "--over:3: timing.periods: 0 is out of range; allowed 1 .. 10000" in text
    assert f"not a mapping; its number is {GAP}" in text
    assert "--over:5: grid[0].damping_n_m_s_per_rad: 2000 is out of range; allowed 0" in text
    assert "rig.servo.gear_rato: unknown key; did you mean gear_ratio?" in text
    assert "control: 'fast' is not known; allowed open loop, closed loop" in text
    code, out, _ = rig_here(
        "sweep", tmp_path / "driveline.yaml", "--sequential", "--lead-in", "9", "--over", "x=1",
        "--sweeps", tmp_path / "s", "--json",
    )  # fmt: skip
    assert code == 2
    problems = {each["file"]: each["message"] for each in json.loads(out)["problems"]}
    assert problems.keys() == {"--sequential", "--lead-in", "--over"}
    assert "a session runs all its rows in sequence" in problems["--lead-in"]
    assert not (tmp_path / "s").exists()


def test_a_scale_of_the_plant_sets_that_of_the_rig(tmp_path: Path) -> None:
    """Without it, counts would mean other angles, and the session would be refused."""
    table = run_test_sweep(write_session(tmp_path), "plant.motor.gear_ratio.value=14,15")[1]
    assert table["state"].values.tolist() == ["complete"] * 2
    lines = problem_lines(tmp_path / "driveline.yaml", "rig.servo.gear_ratio=14")
    assert "is not the simulated bench's 15" in lines[0]


def swept_table(path: Path, *options: str) -> tuple[int, dict[str, Any], xarray.Dataset]:
    """Run the command; return its exit code, its report and the dataset."""
    sweeps = path.parent / "s"
    code, out, _ = rig_here("sweep", path, "--sweeps", sweeps, "--json", *options)
    report = json.loads(out)
    return code, report, xarray.load_dataset(report["result"], engine="h5netcdf")


def test_a_trip_cuts_a_case_short(tmp_path: Path) -> None:
    """Results of a tripped case are those of its complete rows, as far as they are enough."""
    limit = "limits.load_cell.twisting_stop_n_m"
    code, report, table = swept_table(write_session(tmp_path), "--over", f"{limit}=5,60,120")
    assert (code, report["cases"]) == (0, {"complete": 1, "cut short": 2})
    assert table["state"].values.tolist() == ["cut short", "cut short", "complete"]
    reasons = table["incomplete_reason"].values.tolist()
    assert reasons[0] == "run stopped: LOAD_CELL_OVERLOAD, 0 of 4 rows complete"
    assert re.fullmatch(r"run stopped: LOAD_CELL_OVERLOAD, [123] of 4 rows complete", reasons[1])
    assert np.isfinite(table["position_error"].values).tolist() == [False, True, True]
    assert np.isfinite(table["stiffness"].values).tolist() == [False, False, True]
    assert report["results"]["position_error"]["least"] == table["position_error"][2].item()
    assert len(report["pictures"]) == 1


def test_a_session_that_is_too_short_for_its_analysis_is_a_failed_case(tmp_path: Path) -> None:
    path = write_session(tmp_path, "flap_free_decay", grid=[{"release_deg": 9, "period_s": 3}])
    code, report, table = swept_table(path, "--over", "repeat=1,4")
    assert (code, report["status"]) == (1, "failed cases")
    assert report["failed"] == ["1 releases; a decay needs at least 4"]
    assert table["state"].values.tolist() == ["failed", "complete"]
    assert np.isfinite(table["flap_natural_period"].values).tolist() == [False, True]


def test_a_combination_that_makes_no_session_is_a_failed_case(tmp_path: Path) -> None:
    """Each value is valid alone; the smaller limit does not allow the larger release."""
    path = write_session(tmp_path, "flap_free_decay")
    limit, release = "limits.shaft.slip_stop_deg=13,40", "grid.0.release_deg.1=-12,-20"
    code, report, table = swept_table(path, "--over", limit, "--over", release)
    assert (code, report["cases"]) == (1, {"complete": 3, "failed": 1})
    assert table["state"].values.tolist() == [["complete", "failed"], ["complete"] * 2]
    (reason,) = report["failed"]
    assert "--over:2: grid[0].release_deg[1]: -20 is more than limits and rig allow" in reason
    assert "grid.0.release_deg.0" in table.coords
    assert "grid.0.release_deg.1" in table.dims


@pytest.mark.slow
def test_interrupted_sweep_resumes(tmp_path: Path) -> None:
    path, values = write_session(tmp_path), f"{GAP}=0.01,0.02,0.03,0.04"
    with pytest.raises(KeyboardInterrupt):
        run_test_sweep(path, values, executor=interrupt_after(2))
    (folder,) = (tmp_path / "sweeps").iterdir()
    journal = folder / JOURNAL_FILE
    journal.write_bytes(journal.read_bytes()[:-40])  # as if killed within the last line
    counting = Counting()
    opened, table = run_test_sweep(path, values, executor=counting)
    assert (opened.folder, counting.ran) == (folder, [1, 2, 3])
    undisturbed = sweep.open_sweep(
        path, [values], tmp_path / "again", sequential=False, lead_in=5.0
    )
    assert undisturbed.folder.name == folder.name
    same = sweep.run(undisturbed, Counting(), lambda _: None)
    xarray.testing.assert_identical(table, same)


def test_two_sweeps_at_once_are_refused(tmp_path: Path) -> None:
    path, sweeps = write_session(tmp_path), tmp_path / "sweeps"
    opened = sweep.open_sweep(path, ["seed=1,2"], sweeps, sequential=False, lead_in=15.0)
    with sweep.lock_folder(opened):
        code, _, error = rig_here("sweep", path, "--over", "seed=1,2", "--sweeps", sweeps)
    assert code == 1
    assert "another process runs the same sweep" in error


def test_a_worker_of_a_cluster_gives_the_same_outcome(tmp_path: Path) -> None:
    """It opens the session anew from the request, and refuses other files."""
    path = write_session(tmp_path)
    opened, _ = run_test_sweep(path, "seed=3", executor=interrupt_nothing)
    request = pickle.loads(pickle.dumps(opened.cases.request))
    cases = tuple(opened.cases)
    result = cluster.run_chunk(request, opened.digest, cases)
    assert pickle.loads(pickle.dumps(result)).outcomes == (opened.cases.run(cases[0]),)
    path.write_text(path.read_text() + "\n")
    with pytest.raises(ValueError, match="has other files"):
        sweep.reopen_cases(request, opened.digest)


def interrupt_nothing(cases: Any, work: Any) -> Any:
    """Run no case."""
    return iter(())
