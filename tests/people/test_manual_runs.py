"""Manual runs as people start them: killed processes, full disks, Ctrl-C, replay, skipped rows."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from rig_command import rig

from benchmarks.support.live_run import wait_realtime_free
from rig.cli.output import LOST, OK, STOPPED
from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load
from rig.execution.replay import replay
from rig.kinds.wavebot.config import RigFile
from rig.people.request_client import RequestClient, RequestError
from rig.realtime.safety import OFF, RUN, STOP_2
from rig.realtime.sequence import MANUAL, STANDBY
from rig.recording.journal import JOURNAL
from rig.recording.runs.folder import MCAP, STATUS

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.paired]
RIG = f"""\
extends: {CONFIGS / "rigs" / "wavebot.yaml"}
stop: {{duration_s: 0.5}}
"""
CAMPAIGN = """\
name: short
rig: rig.yaml
sea: {kind: calm}
tare: {duration_s: 0.5}
timing: {settle_s: 1, interval_s: 3}
matrix:
  list:
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0}
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -1500, ki_n_per_m: 0}
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -1000, ki_n_per_m: 0}
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -500, ki_n_per_m: 0}
"""


class Run:
    """A `rig` command that attends a run, and a client of it."""

    def __init__(self, process: subprocess.Popen[str], folder: Path) -> None:
        self.process, self.folder = process, folder
        self.client = RequestClient(folder, session="test")

    def ask(self, name: str, **given: Any) -> dict[str, Any]:
        return self.client.ask(name, **given)

    def must(self, name: str, **given: Any) -> dict[str, Any]:
        found = self.ask(name, **given)
        assert found["accepted"], found
        return found

    def until(self, met: Callable[[dict[str, Any]], bool], seconds: float = 60.0) -> None:
        """Wait until the newest logged row meets a condition."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            row = self.row()
            if row and met(row):
                return
            assert self.process.poll() is None, "the run has ended"
            time.sleep(0.05)
        raise AssertionError(f"{seconds} s have passed; the last row is {self.row()}")

    def row(self) -> dict[str, Any]:
        found: dict[str, Any] = self.must("state").get("row", {})
        return found

    def processes(self, module: str) -> list[int]:
        found = []
        for each in Path("/proc").iterdir():
            if each.name.isdigit():
                try:
                    parent = int((each / "stat").read_text().rpartition(")")[2].split()[1])
                    text = (each / "cmdline").read_bytes().decode().split("\0")
                except OSError:
                    continue
                if parent == self.process.pid and module in text:
                    found.append(int(each.name))
        return found


@contextmanager
def started(
    tmp_path: Path, *arguments: str, campaign: str | Path = CAMPAIGN, rig_text: str = RIG
) -> Iterator[Run]:
    """Start `rig ARGUMENTS` with a campaign, as text or as a file, and wait for its run.

    A campaign as text may use `rig.yaml`, which has ``rig_text``.
    """
    if {"--realtime", "--sim"} & {*arguments}:
        wait_realtime_free()
    path = campaign if isinstance(campaign, Path) else tmp_path / "short.yaml"
    if isinstance(campaign, str):
        path.write_text(campaign)
        (tmp_path / "rig.yaml").write_text(rig_text)
    command = [sys.executable, "-m", "rig", *arguments, "--runs", str(tmp_path / "runs")]
    command[4:4] = [str(path)]
    with (tmp_path / "output.txt").open("w") as output:
        process = subprocess.Popen(
            command, stdout=output, stderr=subprocess.STDOUT, text=True, cwd=tmp_path
        )
    try:
        end, run = time.monotonic() + 60.0, None
        while run is None:
            folders = [*(tmp_path / "runs").glob("*")] if (tmp_path / "runs").exists() else []
            with suppress(RequestError):
                run = Run(process, folders[0]) if folders else None
            text = (tmp_path / "output.txt").read_text()
            assert process.poll() is None, text
            assert time.monotonic() < end, text
            time.sleep(0.05)
        with closing(run.client):
            yield run
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


MANUAL_RUN = ("manual", "--realtime", "--unattended")


def to_manual(run: Run) -> None:
    run.until(lambda row: row["plan.phase"] == STANDBY)
    run.must("arm")
    run.must("confirm")
    run.until(lambda row: row["plan.phase"] == MANUAL and row["safety.mode"] == RUN)
    found = run.must("set", values={"kp_n_s_per_m": -1500.0}, signal={"kind": "none"})
    assert found["facts"]["in_force"]


def assert_replays(folder: Path) -> int:
    report = replay(folder)
    assert report.identical, report.differences
    return report.ticks


@pytest.mark.parametrize("state", ["standby", "manual", "hold"])
@pytest.mark.parametrize("victim", ["supervisor", "loop_process", "logger"])
@pytest.mark.long
def test_a_killed_process(victim: str, state: str, tmp_path: Path) -> None:
    """The rig stops, or goes on with a new logger; the record replays to the bit."""
    with started(tmp_path, *MANUAL_RUN) as run:
        run.until(lambda row: row["plan.phase"] == STANDBY)
        if state != "standby":
            to_manual(run)
        if state == "hold":
            run.must("hold")
            run.until(lambda row: row["safety.mode"] == STOP_2)
        loop, logger = (
            run.processes("rig.processes.loop_process"),
            run.processes("rig.processes.logger"),
        )
        assert (len(loop), len(logger)) == (1, 1)
        pid = {"supervisor": run.process.pid, "loop_process": loop[0], "logger": logger[0]}[victim]
        time.sleep(1.0)
        os.kill(pid, signal.SIGKILL)
        if victim == "logger":
            time.sleep(2.0)
            mode = OFF if state == "standby" else STOP_2 if state == "hold" else RUN
            assert run.row()["safety.mode"] == mode
            run.must("stop")
            assert run.process.wait(30.0) == STOPPED
        elif victim == "loop_process":
            assert run.process.wait(30.0) == LOST
        else:
            run.process.wait(30.0)
            end = time.monotonic() + 40.0
            while any(Path(f"/proc/{each}").exists() for each in (*loop, *logger)):
                assert time.monotonic() < end, "processes outlive the run"
                time.sleep(0.1)
        folder = run.folder
    if victim != "logger":
        recovered = rig("recover", folder)
        assert recovered.returncode == OK, recovered.stderr
    assert assert_replays(folder) > 1000


def test_a_manual_run_with_an_early_set_and_its_record_alone(tmp_path: Path) -> None:
    """A set before the power is on comes into force with it; the MCAP file has the journal."""
    with started(tmp_path, *MANUAL_RUN) as run:
        early = run.must("set", values={"kp_n_s_per_m": -700.0})
        assert not early["facts"]["in_force"]
        run.until(lambda row: row["plan.phase"] == STANDBY)
        run.must("tare")
        time.sleep(1.0)
        run.until(lambda row: row["plan.phase"] == STANDBY)
        run.must("arm")
        run.must("confirm")
        run.until(lambda row: row["plan.live"] == 1)
        sine = {"kind": "sine", "amplitude": 200.0, "frequency_hz": 0.5}
        run.must("set", signal=sine)
        time.sleep(0.5)
        run.must("undo")
        assert "kept_rows" in run.must("keep", comment="good")["reason"]
        run.must("annotate", text="seen \u00e4")
        run.must("acknowledge", alarm="battery")
        run.must("finish")
        assert run.process.wait(40.0) == OK
        folder = run.folder
    entries = [json.loads(line) for line in (folder / JOURNAL).read_text().splitlines()]
    assert [each["request"] for each in entries] == [
        "set", "tare", "arm", "confirm", "set", "undo", "keep", "annotate", "acknowledge", "finish"
    ]  # fmt: skip
    assert all(each["accepted"] for each in entries)
    assert rig("check", tmp_path / "kept_rows.yaml").returncode == OK
    ticks = assert_replays(folder)
    alone = tmp_path / "alone"
    alone.mkdir()
    shutil.copy(folder / MCAP, alone / MCAP)
    assert assert_replays(alone / MCAP) == ticks
    (folder / JOURNAL).unlink()
    assert assert_replays(folder) == ticks


def test_ctrl_c_in_manual_mode(tmp_path: Path) -> None:
    with started(tmp_path, *MANUAL_RUN) as run:
        to_manual(run)
        run.process.send_signal(signal.SIGINT)
        assert run.process.wait(40.0) == STOPPED
        folder = run.folder
    assert_replays(folder)
    entries = [json.loads(line) for line in (folder / JOURNAL).read_text().splitlines()]
    assert (entries[-1]["origin"], entries[-1]["request"]) == ("terminal", "stop")


def test_without_an_operator_the_run_holds_and_stops(tmp_path: Path) -> None:
    soon = f"{RIG}operator: {{dead_man_s: 1}}\n"
    with started(tmp_path, "manual", "--realtime", rig_text=soon) as run:
        run.until(lambda row: row["plan.phase"] == STANDBY)
        run.must("take_seat")
        run.must("arm")
        run.must("confirm")
        run.must("leave_seat")
        assert run.process.wait(60.0) == STOPPED
        folder = run.folder
    assert_replays(folder)
    entries = [json.loads(line) for line in (folder / JOURNAL).read_text().splitlines()]
    own = [each["request"] for each in entries if each["origin"] == "supervisor"]
    assert own == ["hold", "stop"]
    status = json.loads((folder / STATUS).read_text())
    assert (status["status"], status["reason"]) == ("stopped", "NO_OPERATOR")
    shown = rig("show", folder).stdout
    for text in (shown, (tmp_path / "output.txt").read_text()):
        assert "Stopped early: manual mode had no operator for longer than" in text


@pytest.mark.skipif(os.getuid() != 0, reason="only root can mount a small disk")
def test_a_full_disk_refuses_a_set_and_lets_a_stop_pass(tmp_path: Path) -> None:
    """The journal alone is on a full disk: its file is replaced by one on /dev/full."""
    with started(tmp_path, *MANUAL_RUN) as run:
        to_manual(run)
        journal = run.folder / JOURNAL
        journal.rename(run.folder / "saved.jsonl")
        journal.symlink_to("/dev/full")
        refused = run.ask("set", values={"kp_n_s_per_m": -900.0})
        assert not refused["accepted"]
        assert "No space left" in refused["reason"]
        stopped = run.must("stop")
        assert "not in the journal" in stopped["reason"]
        journal.unlink()
        (run.folder / "saved.jsonl").rename(journal)
        assert run.process.wait(40.0) == STOPPED
        folder = run.folder
    assert_replays(folder)


def test_rows_that_were_skipped_and_repeated(tmp_path: Path) -> None:
    """The last attempt counts; a skipped row is incomplete, and the table says why."""
    sea = "sea: {kind: regular, amplitude_m: 0.1, frequency_hz: 0.5}"
    start = "start: {set_point_s: 0.5, lead_in_s: 1}"
    campaign = CAMPAIGN.replace("sea: {kind: calm}", f"{sea}\n{start}")
    with started(tmp_path, "run", "--realtime", campaign=campaign) as run:
        run.until(lambda row: row["plan.row"] == 0 and row["plan.phase"] == 4)
        time.sleep(0.3)
        run.must("repeat")
        run.until(lambda row: row["plan.row"] == 1 and row["plan.phase"] == 4)
        time.sleep(0.3)
        run.must("skip")
        run.until(lambda row: row["plan.row"] == 2)  # settling
        run.must("skip")
        run.until(lambda row: row["plan.row"] == 3)
        assert run.process.wait(60.0) == OK
        folder = run.folder
    assert_replays(folder)
    with (folder / "rows.csv").open() as file:
        lines = (line for line in file if not line.startswith("#"))
        rows = {int(row["row"]): row for row in csv.DictReader(lines)}
    assert [rows[row]["state"] for row in range(4)] == [
        "complete", "cut short", "cut short", "complete"
    ]  # fmt: skip
    assert rows[1]["incomplete_reason"] == rows[2]["incomplete_reason"] == "skipped"
    assert float(rows[0]["attempt"]) == 1


@pytest.mark.parametrize(
    ("value", "expected"), [("none", None), ("7.5", 7.5), ("0.1", "0.5 .. 3600"), ("x", "number")]
)
def test_the_dead_mans_time_of_a_rig_file(value: str, expected: Any, tmp_path: Path) -> None:
    text = (CONFIGS / "rigs" / "wavebot.yaml").read_text()
    path = tmp_path / "rig.yaml"
    path.write_text(f"{text}\noperator: {{dead_man_s: {value}}}\n")
    if isinstance(expected, str):
        with pytest.raises(ConfigError, match=expected):
            load(path, RigFile)
        return
    found = load(path, RigFile)[0]
    assert found.operator.dead_man_s == expected
    assert RigFile.model_validate(found.model_dump()).operator == found.operator
