"""`rig run --resume`: a campaign that ended early goes on with the rows and periods that it lacks.

The runs are rehearsals. A killed run is made of a whole one: the bytes of its record up to the
moment of the kill, and the status of a run whose supervisor is gone.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import CompletedCommand, rig
from made_once import made_once
from rehearsing import CONFIGS, SilentView, write_yaml

from rig.analysis.rows import COMPLETE, INTERRUPTED, row_table, stations_of
from rig.cli.resume import is_emulated
from rig.execution.replay import replay
from rig.execution.task import run_task
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.tasks import execution_task, rehearsal_mode
from rig.recording.runs import RunError, create, open_run, run_info
from rig.recording.runs.folder import MCAP, STATUS
from rig.recording.runs.reader import check_record

ROWS = 3
PERIODS = 4  # of 2 s in each row
FIRST_ROW_S = 10.0  # start of the settling of row 0
ROW_S = 10.0
NOISE_W = 0.5  # periods soon after the begin of waves differ by that much, in any run


def rig_mapping() -> dict[str, Any]:
    return {"extends": str(CONFIGS / "rigs" / "wavebot.yaml"), "limits": "limits.yaml"}


def write_files(folder: Path) -> Path:
    """Write a campaign with a rig file and a limits file of its own, and return its path."""
    write_yaml(folder / "limits.yaml", {"extends": str(CONFIGS / "limits" / "wavebot.yaml")})
    write_yaml(folder / "rig.yaml", rig_mapping())
    gains = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000}
    return write_yaml(
        folder / "resumed.yaml",
        {
            "name": "resumed",
            "rig": "rig.yaml",
            "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
            "tare": {"duration_s": 1},
            "start": {"lead_in_s": 8},
            "timing": {"settle_s": 2, "interval_s": 10},
            "matrix": {"list": [{**gains, "ki_n_per_m": ki} for ki in (0, 1000, 2000)]},
        },
    )


def make_run(folder: Path) -> None:
    done = rig("run", write_files(folder), "--runs", folder / "runs", "--interpreted")
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the files of a campaign and its undisturbed run in `runs`."""
    return made_once(tmp_path_factory, "undisturbed", make_run)


@pytest.fixture
def place(whole: Path, tmp_path: Path) -> Path:
    """A copy of the campaign's files, without runs."""
    for path in whole.glob("*.yaml"):
        shutil.copy(path, tmp_path)
    return tmp_path


def only_run(folder: Path) -> Path:
    (run,) = (folder / "runs").iterdir()
    return Path(run)


def kill_at(whole: Path, place: Path, seconds: float) -> Path:
    """Return the folder of a run that was killed so many s after its start."""
    run = only_run(whole)
    killed = place / "runs" / run.name
    shutil.copytree(run, killed)
    move_files(killed, place)
    return cut(killed, seconds)


def move_files(run: Path, place: Path) -> None:
    """Let the record name the files in another folder."""
    config = json.loads((run / "config.json").read_text())
    for each in config["files"]:
        if each["path"].endswith(("/resumed.yaml", "/rig.yaml")) and "undisturbed" in each["path"]:
            each["path"] = str(place / Path(each["path"]).name)
    create.write_json(run, "config.json", config)


def cut(run: Path, seconds: float) -> Path:
    """Turn a whole run into one that was killed so many s after its (last) stage's start."""
    record = run / MCAP
    share = seconds / (float(json.loads((run / STATUS).read_text())["ticks"]) * 1e-3)
    data = record.read_bytes()
    record.unlink()
    (run / f"{MCAP}.part0").write_bytes(data[: int(share * len(data))])
    status = json.loads((run / STATUS).read_text())
    for key in ("reason", "reason_text", "ticks", "last_tick", "skipped", "record", "ended_utc"):
        del status[key]
    create.write_json(run, STATUS, status | {"status": "running", "pid_started": 1})
    return run


def resume(place: Path, *options: object) -> CompletedCommand:
    return rig(*("run", "--resume", "last", "--runs", place / "runs", "--interpreted"), *options)


def assert_equals_undisturbed(run: Path, whole: Path) -> None:
    """Each row once, all of its periods, and the powers of the undisturbed run."""
    table, undisturbed = row_table(run), row_table(only_run(whole))
    assert table["row"].values.tolist() == [*range(ROWS)]
    assert table["state"].values.tolist() == [COMPLETE] * ROWS
    assert table["periods"].values.tolist() == [PERIODS] * ROWS
    assert table["samples"].values.tolist() == [2000 * PERIODS] * ROWS
    for station in stations_of(table):
        difference = np.abs(table[f"power_{station.name}"] - undisturbed[f"power_{station.name}"])
        assert float(difference.max()) < NOISE_W, station.name
    record = check_record(run)
    assert (record.lost, record.damage) == (0, ())
    assert replay(run).identical


def test_a_killed_run_goes_on_within_the_row(whole: Path, place: Path) -> None:
    """Killed after two and a half periods of row 1, of which two are kept."""
    run = kill_at(whole, place, FIRST_ROW_S + ROW_S + 2.0 + 5.0)
    before = row_table(run)
    kept = int(before["periods"].values[1])
    assert before["state"].values.tolist()[:2] == [COMPLETE, INTERRUPTED]
    assert kept in (1, 2)  # chunks end each second
    done = resume(place)
    assert done.returncode == 0, done.stderr
    assert "2 of 3 rows are still to be measured" in done.stderr
    assert_equals_undisturbed(run, whole)
    plan = run_info(run).plan["resumed"]
    assert (plan["rows"], plan["periods"], plan["stage"]) == ([0], {"1": kept}, 2)
    measured = open_run(run, ["plan"])
    second_stage = measured["plan.row"].values[measured["time"].values > plan["last_tick"] * 1e-3]
    assert 0 not in second_stage
    in_row = (measured["plan.row"].values == 1) & (measured["plan.phase"].values == 4)
    counted = np.count_nonzero(in_row)
    assert 2000 * PERIODS <= counted < 2000 * (PERIODS + 1)  # the part of a period is measured anew


def test_a_run_may_be_resumed_any_number_of_times(whole: Path, place: Path) -> None:
    run = kill_at(whole, place, FIRST_ROW_S + 2.0 + 5.0)
    assert resume(place).returncode == 0
    cut(run, FIRST_ROW_S + 3.0)
    assert resume(place).returncode == 0
    assert sorted(path.name for path in run.glob("earlier-?.mcap")) == [
        "earlier-1.mcap",
        "earlier-2.mcap",
    ]
    assert_equals_undisturbed(run, whole)
    assert len(json.loads((run / STATUS).read_text())["resumed_utc"]) == 2


def test_the_time_axis_goes_on_over_the_interruption(whole: Path, place: Path) -> None:
    run = kill_at(whole, place, FIRST_ROW_S + 7.0)
    assert resume(place).returncode == 0
    data = open_run(run, ["tick", "timing.skipped"])
    ticks = data["tick"].values
    assert np.all(np.diff(ticks) > 0)
    assert np.allclose(data["time"].values, ticks * 1e-3, rtol=0, atol=1e-9)
    pauses = np.diff(ticks) - 1
    # None if the second stage begins before so much time has passed as the first one simulated.
    assert np.count_nonzero(pauses) <= 1
    assert data["timing.skipped"].values[-1] == pauses.sum()  # nothing was lost in it
    assert data.attrs["record"] == "complete"


def test_exports_have_each_tick_of_all_stages_once(whole: Path, place: Path) -> None:
    run = kill_at(whole, place, FIRST_ROW_S + 7.0)
    assert resume(place).returncode == 0
    done = rig("export", run, "--as", "csv", "--output", place / "all.csv")
    assert done.returncode == 0, done.stderr
    lines = (place / "all.csv").read_text().splitlines()[1:]
    times = np.array([float(line.partition(",")[0]) for line in lines])
    assert np.all(np.diff(times) > 0)
    assert times[-1] - times[0] > ROWS * ROW_S


def test_a_killed_start_of_a_stage_loses_nothing(whole: Path, place: Path) -> None:
    """Killed before the second stage had written a row."""
    run = kill_at(whole, place, FIRST_ROW_S + ROW_S + 2.0)
    assert resume(place).returncode == 0
    cut(run, 0.0)
    assert resume(place).returncode == 0
    assert_equals_undisturbed(run, whole)


def test_a_kill_between_the_steps_of_a_new_stage_loses_nothing(whole: Path, place: Path) -> None:
    run = kill_at(whole, place, FIRST_ROW_S + ROW_S + 2.0)
    rig("recover", run)
    create.begin_stage(run)  # and no further
    assert row_table(run)["state"].values.tolist()[0] == COMPLETE
    assert resume(place).returncode == 0
    assert_equals_undisturbed(run, whole)


def test_changes_of_the_files_are_named(whole: Path, place: Path) -> None:
    run = kill_at(whole, place, FIRST_ROW_S + ROW_S + 2.0)
    changed = {**rig_mapping(), "supervisor_timeout_s": 1.25}
    write_yaml(place / "rig.yaml", changed)
    campaign = ("--rig", place / "rig.yaml", place / "resumed.yaml")
    refused = resume(place, *campaign)
    assert refused.returncode == 2
    assert "rig.supervisor_timeout_s: 1 in the run, now 1.25" in refused.stderr
    assert "--accept-changes" in refused.stderr
    assert resume(place, *campaign, "--accept-changes").returncode == 0
    (change,) = run_info(run).plan["resumed"]["differences"]
    assert change.startswith("rig.supervisor_timeout_s")
    assert_equals_undisturbed(run, whole)


def _refusals(whole: Path, place: Path) -> dict[str, Any]:
    """Return by text of the refusal a function that prepares the run and returns options."""

    def other_rows() -> tuple[object, ...]:
        text = (place / "resumed.yaml").read_text().replace("ki_n_per_m: 2000", "ki_n_per_m: 2500")
        (place / "resumed.yaml").write_text(text)
        return place / "resumed.yaml", "--accept-changes"

    def lost_file() -> tuple[object, ...]:
        (place / "resumed.yaml").unlink()
        return ()

    def finished() -> tuple[object, ...]:
        shutil.rmtree(only_run(place))
        shutil.copytree(only_run(whole), place / "runs" / only_run(whole).name)
        move_files(only_run(place), place)
        return ()

    def nothing_recorded() -> tuple[object, ...]:
        (only_run(place) / f"{MCAP}.part0").write_bytes(b"")
        return ()

    return {
        "row 2 has ki = 2000.0, in the campaign it is 2500.0": other_rows,
        "name it by FILE": lost_file,
        "all of its 3 rows are measured": finished,
        "nothing was measured: run its campaign from the begin": nothing_recorded,
    }


@pytest.mark.parametrize("text", list(_refusals(Path(), Path())))
def test_refused(text: str, whole: Path, place: Path) -> None:
    run = kill_at(whole, place, FIRST_ROW_S + ROW_S + 2.0)
    options = _refusals(whole, place)[text]()
    files = sorted(path.name for path in run.iterdir() if path.suffix != ".json")
    done = resume(place, *options)
    assert done.returncode == 2
    assert text in done.stderr
    assert "earlier-1.mcap" not in [path.name for path in run.iterdir()]
    assert {*files} <= {path.name for path in run.iterdir()}


def test_a_run_that_still_runs_is_left_alone(whole: Path, place: Path) -> None:
    run = kill_at(whole, place, FIRST_ROW_S + 7.0)
    with create.lock_run(run):
        done = resume(place)
    assert done.returncode != 0
    assert "still being written" in done.stderr


def set_mode(run: Path, mode: str) -> None:
    status = json.loads((run / STATUS).read_text())
    create.write_json(run, STATUS, status | {"mode": mode})


def test_a_rehearsal_does_not_go_on_with_the_rigs_devices(whole: Path, place: Path) -> None:
    run = kill_at(whole, place, FIRST_ROW_S + 7.0)
    for option in ((), ("--sim",)):
        done = resume(place, "--rig", "wavebot_hil", *option)
        assert done.returncode == 2
        mode = "hil" if option else "hardware"
        assert (
            f"its stages before ran in the mode rehearsal, this one would run in the mode {mode}"
            in (done.stderr)
        )
    assert resume(place).returncode == 0  # nothing was changed by the refusals
    assert_equals_undisturbed(run, whole)


@pytest.mark.parametrize("mode", ["hil", "hardware"])
def test_a_run_with_wires_does_not_go_on_as_a_rehearsal(
    mode: str, whole: Path, place: Path
) -> None:
    run = kill_at(whole, place, FIRST_ROW_S + 7.0)
    set_mode(run, mode)
    done = resume(place)
    assert done.returncode == 2
    assert f"its stages before ran in the mode {mode}" in done.stderr


def test_the_next_stage_has_emulated_devices_if_the_stages_before_had_them(
    whole: Path, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without --sim, the command would otherwise move the real rig."""
    run = kill_at(whole, place, FIRST_ROW_S + 7.0)
    set_mode(run, "hil")
    assert is_emulated(run, wired=True, sim=False)
    assert "devices are emulated, as in its stages before" in capsys.readouterr().err
    assert is_emulated(run, wired=True, sim=True)
    set_mode(run, "hardware")
    assert not is_emulated(run, wired=True, sim=False)
    with pytest.raises(RunError, match="in the mode hardware, this one would run in the mode hil"):
        is_emulated(run, wired=True, sim=True)


def test_no_program_begins_a_stage_in_another_mode(whole: Path, place: Path) -> None:
    """The last defence, below the command: before anything is sent or changed."""
    run = kill_at(whole, place, FIRST_ROW_S + 7.0)
    files = sorted(path.name for path in run.iterdir())
    report = check_campaign(place / "resumed.yaml")
    assert report.campaign is not None
    assert report.plan is not None
    task = execution_task(report.campaign, report.plan)
    mode = rehearsal_mode(report.campaign, real_clock=False)
    with pytest.raises(RunError, match="rehearsal, this one would run in the mode hardware"):
        run_task(task, run.parent, SilentView(), mode._replace(name="hardware"), resumed=run)
    assert sorted(path.name for path in run.iterdir()) == files


@pytest.mark.parametrize("arguments", [("--accept-changes",), (), ("quick", "--accept-changes")])
def test_a_file_or_a_run_must_be_given(arguments: tuple[str, ...]) -> None:
    done = rig("run", *arguments)
    assert done.returncode == 2
    assert "--resume RUN" in done.stderr


def test_a_session_begins_anew(tmp_path: Path) -> None:
    done = rig("run", "driveline_short", "--runs", tmp_path / "runs")
    assert done.returncode == 0, done.stderr
    done = rig("run", "--resume", "last", "--runs", tmp_path / "runs")
    assert done.returncode == 2
    assert "only campaigns have rows to go on with" in done.stderr
