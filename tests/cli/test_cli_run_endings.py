"""Output of `rig run` without a terminal, and of flags, a killed process and a full disk."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections import namedtuple
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rig_command import rig

from rig.analysis import summary
from rig.analysis.report import PROGRESS
from rig.analysis.run_products import RunProducts
from rig.api.campaign_run import analyse
from rig.cli.output import FAILED, FAULT, LOST, OK, STOPPED
from rig.cli.run import exit_code, row_as_json
from rig.cli.run_panel import RunPanel
from rig.cli.stop_signals import repeated_interrupts
from rig.config.problems import error_text
from rig.execution.task import _requests_from_signals
from rig.host import disk
from rig.kinds.wavebot import display
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.processes.child import Child
from rig.processes.run_types import Outcome, Snapshot
from rig.realtime import safety
from rig.realtime.limits import LimitFlag, WarningFlag
from rig.realtime.reasons import reason_table
from rig.realtime.sequence import Phase
from rig.recording.runs.folder import STATUS


def ended(**changes: Any) -> Outcome:
    """Return the end of a run without losses."""
    none_lost = {"dropped": 0, "unsaved": 0, "logger_restarts": 0, "last_row": {}}
    return Outcome(**{"reason": "", "ticks": 9, "skipped": 0, **none_lost, **changes})


def test_flags_of_every_axis_are_named() -> None:
    row: dict[str, float | int] = {
        "heave.command.limited": int(LimitFlag.SLEW),
        "surge.command.limited": int(LimitFlag.MODE | LimitFlag.SLEW),
        "command.limited": int(LimitFlag.CURRENT_RMS),
        "heave.warned": 0,
        "surge.warned": int(WarningFlag.POSITION),
        "unlimited": 3,
    }
    assert row_as_json(row, reason_table()) == {
        "heave.command.limited": ["SLEW"],
        "surge.command.limited": ["SLEW", "MODE"],
        "command.limited": ["CURRENT_RMS"],
        "heave.warned": [],
        "surge.warned": ["POSITION"],
        "unlimited": 3,
    }


@pytest.mark.parametrize(
    ("status", "trouble", "code"),
    [
        ("complete", "", STOPPED),
        ("complete", "the disk is full", FAILED),
        ("stopped", "", STOPPED),
        ("fault", "", FAULT),
        ("crashed", "", LOST),
    ],
)
def test_the_exit_code_of_a_run_whose_drawing_was_interrupted(
    status: str, trouble: str, code: int
) -> None:
    assert exit_code(ended(status=status), trouble, interrupted=True) == code


@pytest.mark.parametrize("point", ["import", "room", "products"])
def test_ctrl_c_at_the_end_of_a_run_says_how_to_draw_later(point: str, tmp_path: Path) -> None:
    """The import of the products may be interrupted, and their drawing."""

    class Importing:
        ident = 1

        def join(self) -> None:
            if point == "import":
                raise KeyboardInterrupt

    class Kind:
        PROGRESS, NO_PRODUCTS = "drawing", RunProducts((), {"optima": []})

        def room(self, name: str) -> Any:
            if point == "room":
                raise KeyboardInterrupt
            return self

        def after_run(self, folder: Path, outcome: Outcome) -> RunProducts:
            raise KeyboardInterrupt

    (tmp_path / STATUS).write_text("{}")
    result: Any = SimpleNamespace(folder=tmp_path, outcome=ended(status="complete"))
    kind, importing = Kind(), Importing()
    products = analyse(kind, result, 4, importing, lambda text: None)  # type: ignore[arg-type]
    left_out = f"pictures are not complete: draw them with `rig plot {tmp_path}`"
    assert (products.interrupted, products.trouble) == (left_out, "")
    assert json.loads((tmp_path / STATUS).read_text())["rows_done"] == 4


def test_ctrl_c_while_pictures_are_drawn(tmp_path: Path) -> None:
    """As a terminal sends it: to all processes of the command."""
    command = [sys.executable, "-m", "rig", "run", "quick", "--runs", str(tmp_path)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith(PROGRESS):
                break
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    (run,) = tmp_path.iterdir()
    assert process.returncode == STOPPED, errors
    assert f"pictures are not complete: draw them with `rig plot {run}`" in errors
    assert "Traceback" not in errors
    assert json.loads((run / STATUS).read_text())["rows_done"] == 4
    assert not (run / "surfaces.png").exists()
    drawn = rig("plot", run)
    assert drawn.returncode == OK, drawn.stderr
    assert (run / "surfaces.png").exists()
    # Ctrl-C as early as a process that draws can get it: at its first instruction.
    script = f"""
import os, signal
from pathlib import Path
from rig.analysis.report import write_products
os.register_at_fork(after_in_child=lambda: os.kill(os.getpid(), signal.SIGINT))
write_products(Path({str(run)!r}))
"""
    found = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert (found.returncode, found.stderr) == (0, "")


def test_two_signals_at_once_are_one_request(monkeypatch: pytest.MonkeyPatch) -> None:
    """As `timeout` sends them: to the process, and then to its group."""
    now = [100.0]
    monkeypatch.setattr("rig.execution.task.time.monotonic", lambda: now[0])
    view: Any = SimpleNamespace(notice="")
    with _requests_from_signals(view) as get_request:
        assert get_request() == safety.REQUEST_NONE
        for _ in range(2):
            signal.raise_signal(signal.SIGINT)
        assert get_request() == safety.REQUEST_STOP
        assert view.notice.startswith("stopping")
        now[0] += 0.15  # a hasty person
        signal.raise_signal(signal.SIGINT)
        assert get_request() == safety.REQUEST_ABORT
        assert view.notice.startswith("power off")


def test_ctrl_c_within_a_destructor_is_repeated() -> None:
    class Victim:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    def work() -> None:
        Victim()
        time.sleep(10.0)

    with pytest.raises(KeyboardInterrupt), repeated_interrupts():
        work()


@pytest.mark.parametrize(
    ("changes", "trouble", "code"),
    [
        ({"status": "complete"}, "", OK),
        ({"status": "complete"}, "a picture failed", FAILED),
        ({"status": "complete", "moved": "the folder was moved"}, "", FAILED),
        ({"status": "refused"}, "", FAILED),
        ({"status": "stopped"}, "", STOPPED),
        ({"status": "fault"}, "", FAULT),
        ({"status": "fault", "moved": "the folder was moved"}, "", FAULT),
        ({"status": "fault", "died": "line analyser ended: killed by SIGKILL"}, "", LOST),
        ({"status": "complete", "died": "line analyser ended: killed by SIGKILL"}, "", LOST),
        ({"status": "fault", "unsaved": 1}, "a picture failed", LOST),
        ({"status": "stopped", "dropped": 1}, "", LOST),
        ({"status": "crashed"}, "", LOST),
    ],
)
def test_the_exit_code_of_a_run(changes: dict[str, Any], trouble: str, code: int) -> None:
    assert exit_code(ended(**changes), trouble) == code


def snapshot_of(row: int, phase: Phase, samples: int, watts: float) -> Snapshot:
    """Return a snapshot in a row of the plan, with mechanical power ``watts``."""
    fields: dict[str, Any] = {
        "time": 1.0,
        "plan.row": row,
        "plan.phase": int(phase),
        "plan.wave_clock": 1.0,
        "safety.reason": 0,
        "timing.skipped": 0,
        "power.samples": samples,
        "power.mean_mechanical_1": watts,
        "power.mean_ac": watts / 2.0,
        "power.mean_dc": watts / 4.0,
    }
    return Snapshot(fields, 0, 0, "")


def test_a_line_shows_the_power_of_the_row_that_ended(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line comes when a row is finished, and shows its power, seen last in its measurement."""
    now = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    setting = namedtuple("Setting", "kp ki spring_rate")(-2000.0, 0.0, 490.9)
    rows = (SimpleNamespace(setting=setting, measure=8.0, periods=4),) * 2
    plan = SimpleNamespace(
        rows=rows, duration=60.0, wave_seconds=50.0, dt=1e-3, axis_laws=CampaignFile.axis_laws
    )
    view = RunPanel("title", "rehearsal", plan, display, quiet=False)
    view._live_display, view.part = False, " in sea 2 of 3"
    lines = []
    for snapshot in (
        snapshot_of(0, Phase.SETTLE, 0, 0.0),
        snapshot_of(0, Phase.MEASURE, 4000, -84.0),
        snapshot_of(1, Phase.SETTLE, 0, 0.0),
        snapshot_of(1, Phase.MEASURE, 10, -60.0),
    ):
        now[0] += 15.0
        view(snapshot)
        lines.append(capsys.readouterr().err)
    assert lines[0] == lines[1] == lines[3] == ""
    assert "row 0 (1 of 2)   measure" in lines[2]
    powers = "-84.00 W mechanical     -42.00 W electrical AC     -21.00 W electrical DC"
    assert f"so far   {powers}" in lines[2]
    assert " rig time in sea 2 of 3, " in lines[2]


@pytest.mark.parametrize(("periods", "samples", "shown"), [
    (4, 1999, False), (4, 2000, True), (1, 10, True), (0, 10, True),
])  # fmt: skip
def test_the_power_of_a_row_is_shown_from_a_whole_period_on(
    periods: int, samples: int, shown: bool
) -> None:
    plan = SimpleNamespace(rows=[SimpleNamespace(measure=8.0, periods=periods)], dt=1e-3)
    row = snapshot_of(0, Phase.MEASURE, samples, 31.4).row
    text = display.short_text(plan, row, {})
    assert text.startswith("so far") == shown
    assert ("31.40 W" in text) == shown


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSEGV])
def test_the_last_message_names_the_signal_that_ended_a_child(
    tmp_path: Path, number: signal.Signals
) -> None:
    (tmp_path / "asleep.py").write_text("import time\ntime.sleep(60.0)\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(tmp_path))
        child = Child("asleep", "", (), tmp_path / "asleep.stderr")
    child.process.send_signal(number)
    child.end(10.0)
    assert child.last_message() == f"killed by {number.name}"


def test_the_last_message_of_a_silent_child_is_its_exit_code(tmp_path: Path) -> None:
    (tmp_path / "failing.py").write_text("raise SystemExit(7)\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(tmp_path))
        child = Child("failing", "", (), tmp_path / "failing.stderr")
    child.end(30.0)
    assert child.last_message() == "exit code 7"


def test_a_full_disk_leaves_no_half_of_a_summary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_text = Path.write_text

    def write_to_full_disk(path: Path, text: str, **options: Any) -> int:
        if "summary.json" not in path.name:
            return write_text(path, text, **options)
        write_text(path, text[: len(text) // 2], **options)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", write_to_full_disk)
    monkeypatch.setattr(summary, "as_text", lambda result: "a summary\n")
    monkeypatch.setattr(summary, "as_json", lambda result: {"status": "complete"})
    (tmp_path / "summary.json").write_bytes(b'{"status": "before"}')
    with pytest.raises(OSError, match="No space left"):
        summary.write_texts(None, tmp_path)  # type: ignore[arg-type]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["summary.json", "summary.txt"]
    assert json.loads((tmp_path / "summary.json").read_bytes()) == {"status": "before"}


def test_the_text_of_a_full_disk_has_no_error_number() -> None:
    """The error of a write names no file, unlike that of opening one."""
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert error_text(full) == "No space left on device"


def test_a_too_small_disk_gives_a_warning_before_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The estimate assumes that rows cannot be compressed."""
    need = 1000 * disk.row_bytes()  # 10 s at 100 Hz
    monkeypatch.setattr("os.statvfs", lambda place: SimpleNamespace(f_bavail=need, f_frsize=1))
    assert disk.space_shortage(tmp_path / "not" / "yet", 10.0, 100.0) == ""
    warning = disk.space_shortage(tmp_path / "not" / "yet", 10.01, 100.0)
    assert warning.startswith(f"{1e-6 * need:.1f} MB free in {tmp_path}; this run may write up to")
