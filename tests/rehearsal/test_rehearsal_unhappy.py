"""Runs that go wrong: killed processes, a full disk, Ctrl-C, two runs at once."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import campaign_file, run

from rig import supervisor
from rig.runs import attachments, open_run
from rig.runs.create import BusyError, hold_realtime
from rig.safety import STOP_0, STOP_1, Reason
from rig.supervisor import Snapshot

FIELDS = ["tick", "safety.mode", "safety.reason", "heave.command.enable", "heave.command.force"]


def rows(folder: Path, repeat: int) -> Path:
    """As many rows of 6 s, after 10 s of rig time."""
    return campaign_file(
        folder,
        sea={"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
        tare={"duration_s": 1},
        start={"lead_in_s": 8},
        timing={"settle_s": 2, "interval_s": 6},
        matrix={
            "list": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}],
        },
        repeat=repeat,
    )


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """About 60 s of rig time: some seconds of the clock on the wall."""
    return rows(tmp_path, 8)


@pytest.fixture
def brief(tmp_path: Path) -> Path:
    """Where nothing is done to the run midway."""
    return rows(tmp_path, 1)


def processes(module: str, parent: int | None = None) -> Iterator[int]:
    """Children of a process (this one if not said) that run a module."""
    wanted = parent if parent is not None else os.getpid()
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            found = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            words = (entry / "cmdline").read_bytes().split(b"\0")
        except (OSError, IndexError):
            continue
        if found == wanted and module.encode() in words:
            yield int(entry.name)


class Once:
    """Do something once, when the run has got to a time (s of rig time)."""

    def __init__(self, at: float, deed: Any) -> None:
        self._at, self._deed = at, deed
        self.done = False

    def __call__(self, snapshot: Snapshot) -> None:
        if not self.done and snapshot.row.get("time", -1.0) >= self._at:
            self.done = True
            self._deed()


def kill(module: str) -> None:
    for process in processes(module):
        os.kill(process, signal.SIGKILL)


def ticks(folder: Path) -> Any:
    return open_run(folder, fields=FIELDS)


def test_killed_logger_is_restarted_and_loses_nothing(campaign: Path, tmp_path: Path) -> None:
    once = Once(20.0, lambda: kill("rig.logger"))
    ended = run(campaign, tmp_path / "runs", once)
    assert once.done
    assert ended.outcome.status == "complete"
    assert ended.outcome.logger_restarts == 1
    found = ticks(ended.folder)["tick"].values
    assert np.array_equal(found, np.arange(ended.outcome.ticks))
    assert sorted(p.name for p in ended.folder.glob("*.mcap*")) == ["run.mcap"]


def test_logger_killed_twice(campaign: Path, tmp_path: Path) -> None:
    first, second = Once(10.0, lambda: kill("rig.logger")), Once(25.0, lambda: kill("rig.logger"))

    def see(snapshot: Snapshot) -> None:
        first(snapshot)
        second(snapshot)

    ended = run(campaign, tmp_path / "runs", see)
    assert ended.outcome.logger_restarts == 2
    inside = attachments(ended.folder)
    assert json.loads(inside["timing.json"])["ticks"] == ended.outcome.ticks
    assert json.loads(inside["status.json"])["status"] == "complete"
    assert np.array_equal(ticks(ended.folder)["tick"].values, np.arange(ended.outcome.ticks))


def test_killed_loop_leaves_all_its_rows(campaign: Path, tmp_path: Path) -> None:
    last = []

    def see(snapshot: Snapshot) -> None:
        once(snapshot)
        last.append(snapshot)

    once = Once(20.0, lambda: kill("rig.rehearsal"))
    ended = run(campaign, tmp_path / "runs", see)
    assert ended.outcome.status == "crashed"
    assert ended.outcome.reason == "loop: killed by SIGKILL"
    assert ended.outcome.unsaved == 0
    found = ticks(ended.folder)["tick"].values
    assert np.array_equal(found, np.arange(len(found)))
    assert found[-1] >= last[-1].row["tick"]
    assert found[-1] == ended.outcome.ticks - 1


def stop(module: str) -> None:
    """Let a process hang: it lives and does nothing."""
    for process in processes(module):
        os.kill(process, signal.SIGSTOP)


def test_hung_logger_is_replaced(
    campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "STALL", 3.0)
    once = Once(20.0, lambda: stop("rig.logger"))
    ended = run(campaign, tmp_path / "runs", once)
    assert once.done
    assert (ended.outcome.status, ended.outcome.logger_restarts) == ("complete", 1)
    assert np.array_equal(ticks(ended.folder)["tick"].values, np.arange(ended.outcome.ticks))


def test_hung_loop_is_ended_and_its_rows_are_kept(
    campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "HANG", 3.0)
    ended = run(campaign, tmp_path / "runs", Once(20.0, lambda: stop("rig.rehearsal")))
    assert (ended.outcome.status, ended.outcome.reason) == ("crashed", "the loop hung")
    assert ended.outcome.unsaved == 0
    found = ticks(ended.folder)["tick"].values
    assert np.array_equal(found, np.arange(ended.outcome.ticks))


def test_a_view_that_breaks_does_not_end_the_run(brief: Path, tmp_path: Path) -> None:
    def broken(snapshot: Snapshot) -> None:
        raise BrokenPipeError

    ended = run(brief, tmp_path / "runs", broken)
    assert ended.outcome.status == "complete"


def started(*words: object) -> subprocess.Popen[str]:
    """A process in a group of its own."""
    return subprocess.Popen(
        [sys.executable, *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def supervised(campaign: Path, runs: Path, *options: str) -> subprocess.Popen[str]:
    """`rig run` as a person starts it."""
    return started("-m", "rig", "run", campaign, "--runs", runs, *options)


def supervisor_alone(campaign: Path, runs: Path) -> subprocess.Popen[str]:
    """The supervisor in another process, without what `rig run` does before and after it."""
    return started(Path(__file__).with_name("rehearsing.py"), campaign, runs)


def wait_for_rows(runs: Path, size: int = 100_000) -> Path:
    """The run's folder, once some rows are on disk."""
    for _ in range(600):
        for part in runs.glob("*/run.mcap.part0"):
            if part.stat().st_size > size:
                return part.parent
        time.sleep(0.05)
    raise AssertionError("no rows came")


def finished(folder: Path) -> None:
    """Wait until the logger, left to itself, has ended its file."""
    part = folder / "run.mcap.part0"
    for _ in range(400):
        if part.read_bytes()[-8:] == b"\x89MCAP0\r\n":
            return
        time.sleep(0.05)
    raise AssertionError("the logger does not end its file")


def test_killed_supervisor_stops_the_rig_and_saves_the_rows(campaign: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    process = supervised(campaign, runs)
    folder = wait_for_rows(runs)
    process.kill()
    process.communicate()
    finished(folder)
    found = ticks(folder)
    assert found["safety.reason"].values[-1] == Reason.SUPERVISOR_LOST
    assert found["safety.mode"].values[-1] == STOP_0
    assert found["heave.command.enable"].values[-1] == 0
    assert STOP_1 in found["safety.mode"].values  # damping first: category 1


def test_supervisor_and_loop_killed_together_leave_a_finished_record(
    campaign: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "runs"
    process = supervisor_alone(campaign, runs)
    folder = wait_for_rows(runs)
    loops = list(processes("rig.rehearsal", parent=process.pid))
    assert loops
    process.kill()
    for loop in loops:
        os.kill(loop, signal.SIGKILL)
    process.communicate()
    finished(folder)
    found = ticks(folder)["tick"].values
    assert np.array_equal(found, np.arange(len(found)))


@pytest.mark.realtime
@pytest.mark.parametrize("presses", [1, 2])
def test_ctrl_c(presses: int, campaign: Path, tmp_path: Path) -> None:
    """Once: damping for 2 s, then off. Again: off at once. The data is kept either way."""
    runs = tmp_path / "runs"
    process = supervised(campaign, runs, "--realtime")
    folder = wait_for_rows(runs, size=20_000)
    time.sleep(4.0)  # past the tare: the drive is on
    for _ in range(presses):
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the whole group gets it
        time.sleep(0.3)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 3, err
    assert "stopped" in out.lower()
    found = ticks(folder)
    modes = found["safety.mode"].values
    assert found["safety.reason"].values[-1] == Reason.OPERATOR_STOP  # the first cause is kept
    assert modes[-1] == STOP_0
    elapsed = found["tick"].values[modes == STOP_1]
    span = elapsed[-1] - elapsed[0]
    assert (1900 < span <= 2001) if presses == 1 else (span < 1500)
    assert (found["heave.command.force"].values[modes == STOP_0] == 0.0).all()
    assert (found["heave.command.enable"].values[modes == STOP_0] == 0).all()
    assert json.loads((folder / "run.json").read_text())["status"] == "stopped"


def test_a_closed_terminal_is_a_controlled_stop(campaign: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    process = supervised(campaign, runs)
    folder = wait_for_rows(runs)
    process.send_signal(signal.SIGHUP)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 3, err
    told = json.loads((folder / "run.json").read_text())
    assert (told["status"], told["reason"]) == ("stopped", "OPERATOR_STOP")
    assert (folder / "run.mcap").exists()


def test_two_rehearsals_at_once_get_their_own_folders(brief: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    both = [supervisor_alone(brief, runs) for _ in range(2)]
    for process in both:
        out, err = process.communicate(timeout=300)
        assert (process.returncode, out) == (0, "complete\n"), err
    assert len(list(runs.glob("*/run.mcap"))) == 2


def test_the_real_clock_is_for_one_run(campaign: Path, tmp_path: Path) -> None:
    with hold_realtime("another"):
        with pytest.raises(BusyError, match=rf"campaign another, process {os.getpid()}"):
            run(campaign, tmp_path / "runs", real_clock=True)
        words = [sys.executable, "-m", "rig", "run", str(campaign), "--realtime", "--json"]
        done = subprocess.run(
            [*words, "--runs", str(tmp_path / "runs")], capture_output=True, text=True, check=False
        )
    assert done.returncode == 1
    assert "another" in json.loads(done.stdout)["message"]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 3 MB; skipped where it may not be mounted."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", str(place)]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("a small file system cannot be mounted here (needs root)")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_full_disk_stops_the_rig_and_keeps_what_was_written(
    campaign: Path, small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "DISK_PATIENCE", 2.0)
    ended = run(campaign, small_disk)
    assert ended.outcome.status == "fault"
    assert ended.outcome.reason == "LOGGER_LOST"
    assert ended.outcome.unsaved > 0
    assert ended.trouble
    found = ticks(ended.folder)["tick"].values
    assert len(found) > 1000
    assert np.array_equal(found, np.arange(len(found)))
