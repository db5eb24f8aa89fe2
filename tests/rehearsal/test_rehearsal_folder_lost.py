"""Run folders that are deleted, moved or replaced during a run: every row is kept and found.

Each in both executions of the ticks where that can be; compiled, they are coupled with the plant.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import Execution, compile_wavebot, write_repeated_row

from rig.cli.run import exit_code
from rig.execution.task import RunResult
from rig.processes import supervisor
from rig.processes.run_types import Snapshot
from rig.recording.runs import list_runs, open_run
from rig.recording.runs.folder import MCAP
from rig.recording.runs.reader import check_record

pytestmark = pytest.mark.sampled(pool="folders lost")


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Create a home folder, in which a run is saved if its runs folder is lost."""
    cache, home_folder = Path.home() / ".cache", tmp_path / "home"
    home_folder.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", os.environ.get("XDG_CACHE_HOME", str(cache)))
    monkeypatch.setenv("HOME", str(home_folder))
    return home_folder


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "parent" / "runs"


@pytest.fixture
def campaign(execution: Execution, tmp_path: Path) -> Path:
    """Write a campaign that is too long to reach its end in these tests."""
    return execution.write_repeated_row(tmp_path, 50)


def at_time(seconds: float, action: Callable[[], Any]) -> Callable[[Snapshot], None]:
    """Return a callback that runs the action once, at this rig time (s)."""
    done = []

    def on_snapshot(snapshot: Snapshot) -> None:
        if not done and snapshot.row.get("time", -1.0) >= seconds:
            done.append(action())

    return on_snapshot


def assert_complete(result: RunResult) -> None:
    """Assert that every executed tick is in the record, and that the folder is a normal one."""
    outcome, folder = result.outcome, result.folder
    assert (outcome.unsaved, outcome.dropped, result.save_error) == (0, 0, "")
    ticks = open_run(folder, ["tick"])["tick"].values
    assert np.array_equal(ticks, np.arange(outcome.ticks))
    assert [path.name for path in folder.glob("*.mcap*")] == [MCAP]
    assert check_record(folder).state == "complete"
    status = json.loads((folder / "run.json").read_text())
    assert (status["status"], status["moved"]) == (outcome.status, outcome.moved)
    assert json.loads((folder / "config.json").read_text())
    listed = {run.path: run for run in list_runs(folder.parent)}
    assert (listed[folder].status, listed[folder].problem) == (outcome.status, "")


def assert_stopped(result: RunResult, at: Path, reason: str) -> None:
    """Assert that the rig was stopped, and that the outcome states why and where the record is."""
    assert (result.outcome.status, result.outcome.reason) == ("fault", "LOGGER_LOST")
    assert result.folder == at
    assert reason in result.outcome.moved
    assert str(at) in result.outcome.moved
    assert exit_code(result.outcome, result.save_error) == 4
    assert_complete(result)


def find_run(runs: Path) -> Path:
    """Return the run's folder."""
    return next(path for path in runs.iterdir() if "Z_test" in path.name)


def test_a_deleted_folder(execution: Execution, campaign: Path, runs: Path) -> None:
    found: list[Path] = []
    moments: list[float] = []

    def delete() -> None:
        found.append(find_run(runs))
        shutil.rmtree(found[0])
        moments.append(time.monotonic())

    delete_once = at_time(20.0, delete)

    def on_snapshot(snapshot: Snapshot) -> None:
        delete_once(snapshot)
        if snapshot.row.get("safety.reason"):
            moments.append(time.monotonic())

    result = execution.rehearse(campaign, runs, on_snapshot)
    assert moments[1] - moments[0] < 2.0  # 0.6 s on a quiet host: one flush and one poll
    assert_stopped(result, runs / f"{found[0].name}.rescued", "the run's folder was deleted")
    assert not found[0].exists()


def test_a_moved_folder(execution: Execution, campaign: Path, runs: Path, tmp_path: Path) -> None:
    result = execution.rehearse(
        campaign, runs, at_time(20.0, lambda: find_run(runs).rename(tmp_path / "elsewhere"))
    )
    assert_stopped(result, tmp_path / "elsewhere", "the run's folder was moved")
    assert list(runs.iterdir()) == []


def test_a_moved_parent(execution: Execution, campaign: Path, runs: Path, tmp_path: Path) -> None:
    new = tmp_path / "other"
    result = execution.rehearse(campaign, runs, at_time(20.0, lambda: runs.parent.rename(new)))
    assert_stopped(result, find_run(new / "runs"), "the run's folder was moved")
    assert not runs.exists()


def test_all_runs_deleted(execution: Execution, campaign: Path, runs: Path, home: Path) -> None:
    result = execution.rehearse(campaign, runs, at_time(20.0, lambda: shutil.rmtree(runs)))
    assert_stopped(result, next(home.glob("*.rescued")), "the run's folder was deleted")


def test_a_folder_replaced_by_another_of_its_name(
    execution: Execution, campaign: Path, runs: Path
) -> None:
    def replace() -> None:
        folder = find_run(runs)
        folder.rename(folder.with_name("moved"))
        folder.mkdir()
        (folder / "mine.txt").write_text("not the rig's")

    result = execution.rehearse(campaign, runs, at_time(20.0, replace))
    assert_stopped(result, runs / "moved", "the run's folder was moved")
    assert [path.name for path in find_run(runs).iterdir()] == ["mine.txt"]


def test_a_folder_deleted_and_made_again(execution: Execution, campaign: Path, runs: Path) -> None:
    def recreate() -> None:
        folder = find_run(runs)
        shutil.rmtree(folder)
        folder.mkdir()

    result = execution.rehearse(campaign, runs, at_time(20.0, recreate))
    assert_stopped(result, Path(f"{result.folder}"), "the run's folder was deleted")
    assert result.folder.name.endswith(".rescued")


def test_only_the_record_deleted(execution: Execution, campaign: Path, runs: Path) -> None:
    found: list[Path] = []

    def delete() -> None:
        found.append(find_run(runs))
        (found[0] / f"{MCAP}.part0").unlink()

    result = execution.rehearse(campaign, runs, at_time(20.0, delete))
    assert_stopped(result, runs / f"{found[0].name}.rescued", f"{MCAP}.part0 was taken away")
    status = json.loads((found[0] / "run.json").read_text())  # refers to the other folder
    assert (status["status"], status["record_in"]) == ("fault", str(result.folder))


def test_a_logger_killed_after_the_deletion(
    execution: Execution, campaign: Path, runs: Path
) -> None:
    """The next logger writes to the rescue folder; the dead logger's part is held open."""
    from test_rehearsal_unhappy import kill

    def kill_and_delete() -> None:
        kill("rig.processes.logger")
        shutil.rmtree(find_run(runs))

    result = execution.rehearse(campaign, runs, at_time(20.0, kill_and_delete))
    assert result.folder.name.endswith(".rescued")
    assert result.outcome.logger_restarts == 1
    assert "the run's folder was deleted" in result.outcome.moved
    assert_complete(result)


def test_rows_missing_after_a_move_are_counted(
    execution: Execution, campaign: Path, runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first logger's part is deleted, and no process had it open when the logger was killed."""
    from test_rehearsal_unhappy import kill

    monkeypatch.setattr(
        "rig.recording.folder_watch.FolderTracker.open_part", lambda self, part: None
    )

    def kill_and_delete(snapshot: Snapshot) -> None:
        saved = snapshot.row.get("tick", -1) + 1 - snapshot.unsaved_rows
        # On a busy host the logger comes late; the row may be somewhat newer than the count.
        if saved > 10_000 and not killed:
            killed.append(saved)
            kill("rig.processes.logger")
            shutil.rmtree(find_run(runs))

    killed: list[float] = []
    result = execution.rehearse(campaign, runs, kill_and_delete)
    found = open_run(result.folder, ["tick"])["tick"].values
    assert result.outcome.unsaved == result.outcome.ticks - len(found) > 0
    assert exit_code(result.outcome, result.save_error) == 5
    status = json.loads((result.folder / "run.json").read_text())
    assert status["record"].startswith(f"incomplete: {result.outcome.unsaved} of ")
    assert check_record(result.folder).lost == result.outcome.unsaved


@pytest.fixture
def short(execution: Execution, tmp_path: Path) -> Path:
    if not execution.interpreted:
        compile_wavebot()
    return write_repeated_row(tmp_path, 1)


@pytest.mark.parametrize("action", ["delete", "move"])
def test_after_the_logger_has_ended(
    execution: Execution,
    action: str,
    short: Path,
    runs: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The logger has ended, and the supervisor has not closed the folder yet."""
    end = supervisor.Child.end

    def end_and_lose_folder(child: supervisor.Child, timeout_s: float) -> None:
        end(child, timeout_s)
        if timeout_s == supervisor.STALL_TIMEOUT_S:
            folder = find_run(runs)
            shutil.rmtree(folder) if action == "delete" else folder.rename(tmp_path / "there")

    monkeypatch.setattr(supervisor.Child, "end", end_and_lose_folder)
    result = execution.rehearse(short, runs)
    assert result.outcome.status == "complete"
    assert str(result.folder) in result.outcome.moved
    assert exit_code(result.outcome, result.save_error) == 1
    assert_complete(result)


@pytest.mark.parametrize("execution", ["interpreted"], indirect=True)
def test_a_full_disk_and_a_deleted_folder(
    execution: Execution,
    campaign: Path,
    small_disk: Path,
    home: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The disk has no room for a rescue folder: it is created in the user's home.

    Compiled ticks fill what this leaves of the disk within two milliseconds, before the folder is
    deleted.
    """

    def fill_and_delete() -> None:
        part = next(small_disk.glob(f"*/{MCAP}.part0"))
        with (small_disk / "filling").open("wb") as file:
            free = os.statvfs(small_disk).f_bavail * os.statvfs(small_disk).f_frsize
            file.write(bytes(free - 100_000))
        assert part.stat().st_size > 100_000
        shutil.rmtree(part.parent)

    result = execution.rehearse(campaign, small_disk, at_time(8.0, fill_and_delete))
    assert_stopped(result, next(home.glob("*.rescued")), "the run's folder was deleted")
