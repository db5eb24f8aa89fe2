"""Runs with failures: killed processes, a full disk, Ctrl-C, two runs at once.

Each in both executions of the ticks. On the virtual clock the compiled ticks are coupled with the
plant; on the real clock, of `test_ctrl_c` and of a stalled host, the tick is compiled alone.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import Execution, compile_wavebot, rehearse, write_repeated_row

from rig.cli.output import LOST
from rig.cli.run import exit_code
from rig.processes import supervisor
from rig.processes.run_types import Snapshot
from rig.processes.wire_locks import REALTIME_WIRE, acquire
from rig.realtime.reasons import Reason
from rig.realtime.safety import STOP_0, STOP_1
from rig.recording.runs import attachments, open_run
from rig.recording.runs.create import BusyError
from rig.recording.runs.folder import MCAP
from rig.recording.runs.mcap_file import scan

pytestmark = pytest.mark.sampled(pool="failures of a rehearsal")

FIELDS = ["tick", "safety.mode", "safety.reason", "heave.command.enable", "heave.command.force"]


@pytest.fixture
def campaign(execution: Execution, tmp_path: Path) -> Path:
    """Write a campaign of some seconds of real time: a minute of rig time, or 16 compiled."""
    return execution.write_repeated_row(tmp_path, 8)


@pytest.fixture
def brief(execution: Execution, tmp_path: Path) -> Path:
    """Write a short campaign, for tests that do not interfere with the run."""
    if not execution.interpreted:
        compile_wavebot()
    return write_repeated_row(tmp_path, 1)


def processes(module: str, parent: int | None = None) -> Iterator[int]:
    """Yield the children of a process (by default this one) that run a module."""
    parent_pid = parent if parent is not None else os.getpid()
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            its_parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            arguments = (entry / "cmdline").read_bytes().split(b"\0")
        except (OSError, IndexError):
            continue
        if its_parent == parent_pid and module.encode() in arguments:
            yield int(entry.name)


class Once:
    """Runs an action once, at a rig time (s)."""

    def __init__(self, at: float, action: Any) -> None:
        self._at, self._action = at, action
        self.done = False

    def __call__(self, snapshot: Snapshot) -> None:
        if not self.done and snapshot.row.get("time", -1.0) >= self._at:
            self.done = True
            self._action()


def kill(module: str) -> None:
    for process in processes(module):
        os.kill(process, signal.SIGKILL)


def ticks(folder: Path) -> Any:
    return open_run(folder, fields=FIELDS)


def test_killed_logger_is_restarted_and_loses_nothing(
    execution: Execution, campaign: Path, tmp_path: Path
) -> None:
    once = Once(20.0 * execution.pace, lambda: kill("rig.processes.logger"))
    result = execution.rehearse(campaign, tmp_path / "runs", once)
    assert once.done
    assert result.outcome.status == "complete"
    assert result.outcome.logger_restarts == 1
    found = ticks(result.folder)["tick"].values
    assert np.array_equal(found, np.arange(result.outcome.ticks))
    assert sorted(p.name for p in result.folder.glob("*.mcap*")) == ["run.mcap"]


def test_rows_that_the_join_cannot_read_are_counted_and_the_parts_stay(
    execution: Execution, campaign: Path, tmp_path: Path
) -> None:
    """The part of a killed logger has a bad sector."""

    def kill_and_damage() -> None:
        kill("rig.processes.logger")
        (part,) = (tmp_path / "runs").glob(f"*/{MCAP}.part0")
        chunk = scan(part).chunks[1]
        with part.open("r+b") as file:
            file.seek(chunk.offset + chunk.length // 2)
            file.write(bytes(100))

    result = execution.rehearse(
        campaign, tmp_path / "runs", Once(20.0 * execution.pace, kill_and_damage)
    )
    lost = result.outcome.ticks - ticks(result.folder).sizes["time"]
    assert result.outcome.unsaved == lost > 0
    status = json.loads((result.folder / "run.json").read_text())
    assert (status["status"], status["unsaved_rows"]) == ("complete", lost)
    assert status["record"] == f"incomplete: {lost} of {result.outcome.ticks} ticks missing"
    assert f"{MCAP} lacks {lost} rows" in result.save_error
    assert f"{MCAP}.part0: chunk at byte" in result.save_error
    assert exit_code(result.outcome, result.save_error) == LOST
    kept = {f"{MCAP}.part{number}" for number in (0, 1)}
    assert {path.name for path in result.folder.glob("*.mcap*")} == {MCAP, *kept}


def test_logger_killed_twice(execution: Execution, campaign: Path, tmp_path: Path) -> None:
    first, second = (
        Once(10.0 * execution.pace, lambda: kill("rig.processes.logger")),
        Once(25.0 * execution.pace, lambda: kill("rig.processes.logger")),
    )

    def on_snapshot(snapshot: Snapshot) -> None:
        first(snapshot)
        second(snapshot)

    result = execution.rehearse(campaign, tmp_path / "runs", on_snapshot)
    assert result.outcome.logger_restarts == 2
    inside = attachments(result.folder)
    timing = json.loads(inside["timing.json"])
    assert timing["ticks"] == result.outcome.ticks
    assert timing["loop_waited_s"] >= 0.0
    assert timing["logger_cpu_s"] > 0.0
    assert json.loads(inside["status.json"])["status"] == "complete"
    assert np.array_equal(ticks(result.folder)["tick"].values, np.arange(result.outcome.ticks))


def test_killed_loop_leaves_all_its_rows(
    execution: Execution, campaign: Path, tmp_path: Path
) -> None:
    last = []

    def on_snapshot(snapshot: Snapshot) -> None:
        once(snapshot)
        last.append(snapshot)

    once = Once(20.0 * execution.pace, lambda: kill("rig.processes.loop_process"))
    result = execution.rehearse(campaign, tmp_path / "runs", on_snapshot)
    assert result.outcome.status == "crashed"
    assert result.outcome.reason == "loop: killed by SIGKILL"
    assert result.outcome.unsaved == 0
    found = ticks(result.folder)["tick"].values
    assert np.array_equal(found, np.arange(len(found)))
    assert found[-1] >= last[-1].row["tick"]
    assert found[-1] == result.outcome.ticks - 1


def suspend(module: str) -> None:
    """Suspend the processes of a module, as if they hung."""
    for process in processes(module):
        os.kill(process, signal.SIGSTOP)


def test_hung_logger_is_replaced(
    execution: Execution, campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "STALL_TIMEOUT_S", 3.0)
    once = Once(20.0 * execution.pace, lambda: suspend("rig.processes.logger"))
    result = execution.rehearse(campaign, tmp_path / "runs", once)
    assert once.done
    assert (result.outcome.status, result.outcome.logger_restarts) == ("complete", 1)
    assert np.array_equal(ticks(result.folder)["tick"].values, np.arange(result.outcome.ticks))


def test_hung_loop_is_ended_and_its_rows_are_kept(
    execution: Execution, campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "HANG_TIMEOUT_S", 3.0)
    result = execution.rehearse(
        campaign,
        tmp_path / "runs",
        Once(20.0 * execution.pace, lambda: suspend("rig.processes.loop_process")),
    )
    assert (result.outcome.status, result.outcome.reason) == ("crashed", "the loop hung")
    assert result.outcome.unsaved == 0
    found = ticks(result.folder)["tick"].values
    assert np.array_equal(found, np.arange(result.outcome.ticks))


def test_a_view_that_breaks_does_not_end_the_run(
    execution: Execution, brief: Path, tmp_path: Path
) -> None:
    def broken(snapshot: Snapshot) -> None:
        raise BrokenPipeError

    result = execution.rehearse(brief, tmp_path / "runs", broken)
    assert result.outcome.status == "complete"


def start_process(*arguments: object) -> subprocess.Popen[str]:
    """Start a process in a group of its own.

    A session of its own would have its own share of the processor, also at the idle priority
    (sched(7), autogroup).
    """
    return subprocess.Popen(
        [sys.executable, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
    )


def start_rig_run(campaign: Path, runs: Path, *options: str) -> subprocess.Popen[str]:
    """Start `rig run` as a person does."""
    return start_process("-m", "rig", "run", campaign, "--runs", runs, *options)


def start_supervisor(campaign: Path, runs: Path, execution: Execution) -> subprocess.Popen[str]:
    """Start a supervisor process, without the steps of `rig run` before and after the run."""
    program = Path(__file__).with_name("rehearsing.py")
    return start_process(program, campaign, runs, execution.name)


def wait_for_rows(runs: Path, size: int = 100_000) -> Path:
    """Wait until the part on disk has more than ``size`` bytes; return the run's folder."""
    for _ in range(600):
        for part in runs.glob("*/run.mcap.part0"):
            if part.stat().st_size > size:
                return part.parent
        time.sleep(0.05)
    raise AssertionError("no rows came")


def wait_for_logger(folder: Path) -> None:
    """Wait until the logger, without a supervisor, has ended its file."""
    part = folder / "run.mcap.part0"
    for _ in range(400):
        if part.read_bytes()[-8:] == b"\x89MCAP0\r\n":
            return
        time.sleep(0.05)
    raise AssertionError("the logger does not end its file")


def test_killed_supervisor_stops_the_rig_and_saves_the_rows(
    execution: Execution, campaign: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "runs"
    process = start_rig_run(campaign, runs, *execution.options)
    folder = wait_for_rows(runs, 100_000 * execution.pace)
    process.kill()
    process.communicate()
    wait_for_logger(folder)
    found = ticks(folder)
    assert found["safety.reason"].values[-1] == Reason.SUPERVISOR_LOST
    assert found["safety.mode"].values[-1] == STOP_0
    assert found["heave.command.enable"].values[-1] == 0
    assert STOP_1 in found["safety.mode"].values  # damping first: category 1


def test_supervisor_and_loop_killed_together_leave_a_finished_record(
    execution: Execution, campaign: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "runs"
    process = start_supervisor(campaign, runs, execution)
    folder = wait_for_rows(runs, 100_000 * execution.pace)
    loops = list(processes("rig.processes.loop_process", parent=process.pid))
    assert loops
    process.kill()
    for loop in loops:
        os.kill(loop, signal.SIGKILL)
    process.communicate()
    wait_for_logger(folder)
    found = ticks(folder)["tick"].values
    assert np.array_equal(found, np.arange(len(found)))


@pytest.mark.realtime
@pytest.mark.paired
def test_a_stalled_host_is_reported_as_the_cause(
    execution: Execution, campaign: Path, tmp_path: Path
) -> None:
    """SIGSTOP for 0.3 s loses more than the 100 ticks that configs/limits/wavebot.yaml allows."""
    process = start_rig_run(campaign, tmp_path / "runs", "--realtime", "--json", *execution.options)
    wait_for_rows(tmp_path / "runs", size=20_000)
    time.sleep(4.0)  # past the tare
    (loop,) = processes("rig.processes.loop_process", process.pid)
    os.kill(loop, signal.SIGSTOP)
    time.sleep(0.3)
    os.kill(loop, signal.SIGCONT)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 4, err
    printed = json.loads(out.splitlines()[-1])
    assert (printed["status"], printed["reason"]) == ("fault", "LOST_TICKS")
    assert printed["lost_ticks"]["lost"] > 100
    assert 0.1 < printed["lost_ticks"]["longest_gap_s"] < 2.0
    text = (Path(printed["folder"]) / "summary.txt").read_text()
    assert "Stopped by a fault: the host lost " in text
    assert "too many ticks were lost in one gap (LOST_TICKS); see `rig doctor`" in text


@pytest.mark.realtime
@pytest.mark.paired
@pytest.mark.parametrize("presses", [1, 2])
def test_ctrl_c(execution: Execution, presses: int, campaign: Path, tmp_path: Path) -> None:
    """Once: damping for 2 s, then off. Twice: off at once. The data is kept either way."""
    runs = tmp_path / "runs"
    process = start_rig_run(campaign, runs, "--realtime", *execution.options)
    folder = wait_for_rows(runs, size=20_000)
    time.sleep(4.0)  # past the tare: the drive is on
    for _ in range(presses):
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the whole group
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


def test_a_closed_terminal_is_a_controlled_stop(
    execution: Execution, campaign: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "runs"
    process = start_rig_run(campaign, runs, *execution.options)
    folder = wait_for_rows(runs, 100_000 * execution.pace)
    process.send_signal(signal.SIGHUP)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 3, err
    status = json.loads((folder / "run.json").read_text())
    assert (status["status"], status["reason"]) == ("stopped", "OPERATOR_STOP")
    assert (folder / "run.mcap").exists()


def test_ctrl_z_stops_instead_of_suspending(
    execution: Execution, campaign: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "runs"
    process = start_rig_run(campaign, runs, *execution.options)
    folder = wait_for_rows(runs, 100_000 * execution.pace)
    process.send_signal(signal.SIGTSTP)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 3, err
    assert "Ctrl-Z does not suspend a run: stopping: damping, then power off" in err
    status = json.loads((folder / "run.json").read_text())
    assert (status["status"], status["reason"]) == ("stopped", "OPERATOR_STOP")


@pytest.mark.realtime
@pytest.mark.paired
def test_a_blocked_terminal_neither_stops_the_rig_nor_keeps_it_from_stopping(
    execution: Execution, brief: Path, tmp_path: Path
) -> None:
    """As after Ctrl-S, or on a connection that hangs, the terminal reads no output."""
    runs = tmp_path / "runs"
    ours, terminal = os.openpty()
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "rig",
            "run",
            brief,
            "--runs",
            runs,
            "--realtime",
            *execution.options,
        ],
        stdout=subprocess.DEVNULL,
        stderr=terminal,
        env={**os.environ, "TERM": "xterm"},
        start_new_session=True,
    )
    os.close(terminal)
    folder = wait_for_rows(runs)
    time.sleep(6.0)  # the terminal's 4 kB are full after some drawings
    process.send_signal(signal.SIGINT)
    for _ in range(600):
        if json.loads((folder / "run.json").read_text())["status"] != "running":
            break
        time.sleep(0.05)
    status = json.loads((folder / "run.json").read_text())
    assert process.poll() is None  # it still waits for its terminal
    with suppress(OSError):  # until the writers have ended
        while os.read(ours, 65536):
            pass
    os.close(ours)
    assert process.wait(timeout=60) == 3
    assert (status["status"], status["reason"]) == ("stopped", "OPERATOR_STOP")
    assert ticks(folder)["time"].values[-1] > 6.0  # the blocked display did not stop it


def test_two_rehearsals_at_once_get_their_own_folders(
    execution: Execution, brief: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "runs"
    both = [start_supervisor(brief, runs, execution) for _ in range(2)]
    for process in both:
        out, err = process.communicate(timeout=300)
        assert (process.returncode, out) == (0, "complete\n"), err
    assert len(list(runs.glob("*/run.mcap"))) == 2


@pytest.mark.realtime
@pytest.mark.paired
def test_only_one_run_may_use_the_real_clock(tmp_path: Path) -> None:
    campaign = write_repeated_row(tmp_path, 1)
    with acquire((REALTIME_WIRE,), "campaign another"):
        with pytest.raises(BusyError, match=rf"campaign another \(process {os.getpid()}, user "):
            rehearse(campaign, tmp_path / "runs", real_clock=True)
        command = [sys.executable, "-m", "rig", "run", str(campaign), "--realtime", "--json"]
        done = subprocess.run(
            [*command, "--runs", str(tmp_path / "runs")],
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert "another" in json.loads(done.stdout)["message"]


def test_full_disk_stops_the_rig_and_saves_the_record_elsewhere(
    execution: Execution,
    campaign: Path,
    small_disk: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cache, home = Path.home() / ".cache", tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", os.environ.get("XDG_CACHE_HOME", str(cache)))
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setattr(supervisor, "DISK_TIMEOUT_S", 2.0)
    result = execution.rehearse(campaign, small_disk)
    assert (result.outcome.status, result.outcome.reason) == ("fault", "LOGGER_LOST")
    assert result.folder.parent == home
    assert "No space left on device" in result.outcome.moved
    found = ticks(result.folder)["tick"].values
    # A compiled run may fill the ring before it stops; the record states the rows that it lacks.
    missing = np.setdiff1d(np.arange(result.outcome.ticks), found)
    assert len(missing) == result.outcome.dropped
    assert np.all(np.diff(missing) == 1)
    assert result.outcome.dropped == 0 or result.outcome.compiled_from == 1


def test_full_disk_without_a_rescue_folder_keeps_the_written_rows(
    execution: Execution, campaign: Path, small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = Path.home() / ".cache"
    monkeypatch.setenv("XDG_CACHE_HOME", os.environ.get("XDG_CACHE_HOME", str(cache)))
    for name in ("HOME", "TMPDIR"):
        monkeypatch.setenv(name, str(small_disk))
    monkeypatch.setattr(supervisor, "DISK_TIMEOUT_S", 2.0)
    result = execution.rehearse(campaign, small_disk)
    assert result.outcome.status == "fault"
    assert result.outcome.reason == "LOGGER_LOST"
    assert result.outcome.unsaved > 0
    assert result.save_error
    found = ticks(result.folder)["tick"].values
    assert len(found) > 1000
    assert np.array_equal(found, np.arange(len(found)))
