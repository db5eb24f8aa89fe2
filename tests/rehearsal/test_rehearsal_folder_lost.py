"""Run folders that are deleted, moved or replaced during a run: every row is kept, and is found."""

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
from rehearsing import rows, run

from rig.cli.run_end import exit_code
from rig.execution.task import Ended
from rig.processes import supervisor
from rig.processes.run_types import Snapshot
from rig.recording.runs import list_runs, open_run
from rig.recording.runs.folder import MCAP
from rig.recording.runs.reader import check_record


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where a run is saved if not beside its folder."""
    cache, place = Path.home() / ".cache", tmp_path / "home"
    place.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", os.environ.get("XDG_CACHE_HOME", str(cache)))
    monkeypatch.setenv("HOME", str(place))
    return place


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "parent" / "runs"


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """So long that it is never walked to its end here."""
    return rows(tmp_path, 400)


def when(seconds: float, deed: Callable[[], Any]) -> Callable[[Snapshot], None]:
    """Do something once, so many seconds of rig time into the run."""
    done = []

    def see(snapshot: Snapshot) -> None:
        if not done and snapshot.row.get("time", -1.0) >= seconds:
            done.append(deed())

    return see


def whole(ended: Ended) -> None:
    """Every tick that was executed is in the record, and the folder is one like any other."""
    outcome, folder = ended.outcome, ended.folder
    assert (outcome.unsaved, outcome.dropped, ended.trouble) == (0, 0, "")
    ticks = open_run(folder, ["tick"])["tick"].values
    assert np.array_equal(ticks, np.arange(outcome.ticks))
    assert [path.name for path in folder.glob("*.mcap*")] == [MCAP]
    assert check_record(folder).state == "complete"
    told = json.loads((folder / "run.json").read_text())
    assert (told["status"], told["moved"]) == (outcome.status, outcome.moved)
    assert json.loads((folder / "config.json").read_text())
    listed = {run.path: run for run in list_runs(folder.parent)}
    assert (listed[folder].status, listed[folder].problem) == (outcome.status, "")


def stopped(ended: Ended, at: Path, said: str) -> None:
    """The rig was stopped for it, and people hear why and where the record is."""
    assert (ended.outcome.status, ended.outcome.reason) == ("fault", "LOGGER_LOST")
    assert ended.folder == at
    assert said in ended.outcome.moved
    assert str(at) in ended.outcome.moved
    assert exit_code(ended.outcome, ended.trouble) == 4
    whole(ended)


def made(runs: Path) -> Path:
    """The run's folder."""
    return next(path for path in runs.iterdir() if "Z_test" in path.name)


def test_a_deleted_folder(campaign: Path, runs: Path) -> None:
    found: list[Path] = []
    moments: list[float] = []

    def delete() -> None:
        found.append(made(runs))
        shutil.rmtree(found[0])
        moments.append(time.monotonic())

    deed = when(20.0, delete)

    def see(snapshot: Snapshot) -> None:
        deed(snapshot)
        if snapshot.row.get("safety.reason"):
            moments.append(time.monotonic())

    ended = run(campaign, runs, see)
    assert moments[1] - moments[0] < 2.0  # 0.6 s on a quiet host: a flush, and a look
    stopped(ended, runs / f"{found[0].name}.rescued", "the run's folder was deleted")
    assert not found[0].exists()


def test_a_moved_folder(campaign: Path, runs: Path, tmp_path: Path) -> None:
    ended = run(campaign, runs, when(20.0, lambda: made(runs).rename(tmp_path / "elsewhere")))
    stopped(ended, tmp_path / "elsewhere", "the run's folder was moved")
    assert list(runs.iterdir()) == []


def test_a_moved_parent(campaign: Path, runs: Path, tmp_path: Path) -> None:
    new = tmp_path / "other"
    ended = run(campaign, runs, when(20.0, lambda: runs.parent.rename(new)))
    stopped(ended, made(new / "runs"), "the run's folder was moved")
    assert not runs.exists()


def test_all_runs_deleted(campaign: Path, runs: Path, home: Path) -> None:
    ended = run(campaign, runs, when(20.0, lambda: shutil.rmtree(runs)))
    stopped(ended, next(home.glob("*.rescued")), "the run's folder was deleted")


def test_a_folder_replaced_by_another_of_its_name(campaign: Path, runs: Path) -> None:
    def replace() -> None:
        folder = made(runs)
        folder.rename(folder.with_name("aside"))
        folder.mkdir()
        (folder / "mine.txt").write_text("not the rig's")

    ended = run(campaign, runs, when(20.0, replace))
    stopped(ended, runs / "aside", "the run's folder was moved")
    assert [path.name for path in made(runs).iterdir()] == ["mine.txt"]


def test_a_folder_deleted_and_made_again(campaign: Path, runs: Path) -> None:
    def again() -> None:
        folder = made(runs)
        shutil.rmtree(folder)
        folder.mkdir()

    ended = run(campaign, runs, when(20.0, again))
    stopped(ended, Path(f"{ended.folder}"), "the run's folder was deleted")
    assert ended.folder.name.endswith(".rescued")


def test_only_the_record_deleted(campaign: Path, runs: Path) -> None:
    found: list[Path] = []

    def delete() -> None:
        found.append(made(runs))
        (found[0] / f"{MCAP}.part0").unlink()

    ended = run(campaign, runs, when(20.0, delete))
    stopped(ended, runs / f"{found[0].name}.rescued", f"{MCAP}.part0 was taken away")
    told = json.loads((found[0] / "run.json").read_text())  # the other one says where it is
    assert (told["status"], told["record_in"]) == ("fault", str(ended.folder))


def test_a_logger_killed_after_the_deletion(campaign: Path, runs: Path) -> None:
    """The next one writes to the rescue folder; the part of the dead one is held open."""
    from test_rehearsal_unhappy import kill

    def both() -> None:
        kill("rig.recording.logger")
        shutil.rmtree(made(runs))

    ended = run(campaign, runs, when(20.0, both))
    assert ended.folder.name.endswith(".rescued")
    assert ended.outcome.logger_restarts == 1
    assert "the run's folder was deleted" in ended.outcome.moved
    whole(ended)


def test_rows_that_did_not_come_along_are_counted(
    campaign: Path, runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first logger's part is deleted, and nobody had it open when its logger was killed."""
    from test_rehearsal_unhappy import kill

    monkeypatch.setattr("rig.recording.folder_watch.Whereabouts.hold", lambda self, part: None)

    def both() -> None:
        kill("rig.recording.logger")
        shutil.rmtree(made(runs))

    ended = run(campaign, runs, when(20.0, both))
    found = open_run(ended.folder, ["tick"])["tick"].values
    assert ended.outcome.unsaved == ended.outcome.ticks - len(found) > 0
    assert exit_code(ended.outcome, ended.trouble) == 5
    told = json.loads((ended.folder / "run.json").read_text())
    assert told["record"].startswith(f"incomplete: {ended.outcome.unsaved} of ")
    assert check_record(ended.folder).lost == ended.outcome.unsaved


@pytest.fixture
def short(tmp_path: Path) -> Path:
    return rows(tmp_path, 1)


@pytest.mark.parametrize("deed", ["delete", "move"])
def test_after_the_logger_has_ended(
    deed: str, short: Path, runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody writes any more, and the supervisor has not closed the folder yet."""
    end = supervisor.Child.end

    def ended_then_lost(child: supervisor.Child, patience: float) -> None:
        end(child, patience)
        if patience == supervisor.STALL:
            folder = made(runs)
            shutil.rmtree(folder) if deed == "delete" else folder.rename(tmp_path / "there")

    monkeypatch.setattr(supervisor.Child, "end", ended_then_lost)
    ended = run(short, runs)
    assert ended.outcome.status == "complete"
    assert str(ended.folder) in ended.outcome.moved
    assert exit_code(ended.outcome, ended.trouble) == 1
    whole(ended)


def test_a_full_disk_and_a_deleted_folder(
    campaign: Path, small_disk: Path, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rescue folder beside it has no room, either: it is made in the user's home."""

    def fill_and_delete() -> None:
        part = next(small_disk.glob(f"*/{MCAP}.part0"))
        with (small_disk / "filling").open("wb") as file:
            room = os.statvfs(small_disk).f_bavail * os.statvfs(small_disk).f_frsize
            file.write(bytes(room - 100_000))
        assert part.stat().st_size > 100_000
        shutil.rmtree(part.parent)

    ended = run(campaign, small_disk, when(8.0, fill_and_delete))
    stopped(ended, next(home.glob("*.rescued")), "the run's folder was deleted")
