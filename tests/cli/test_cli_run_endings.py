"""What `rig run` says without a terminal, of flags, of a killed process and of a full disk."""

import errno
import json
import os
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rig.analysis import summary
from rig.cli import command_error
from rig.cli.progress import Progress
from rig.cli.run_end import in_words
from rig.host import disk
from rig.processes.child import Child
from rig.processes.run_types import Snapshot
from rig.realtime.limits import Limited, Warned
from rig.realtime.sequence import Phase


def test_flags_of_every_axis_are_named() -> None:
    row: dict[str, float | int] = {
        "heave.command.limited": int(Limited.SLEW),
        "surge.command.limited": int(Limited.MODE | Limited.SLEW),
        "command.limited": int(Limited.CURRENT_RMS),
        "heave.warned": 0,
        "surge.warned": int(Warned.POSITION),
        "unlimited": 3,
    }
    assert in_words(row) == {
        "heave.command.limited": ["SLEW"],
        "surge.command.limited": ["SLEW", "MODE"],
        "command.limited": ["CURRENT_RMS"],
        "heave.warned": [],
        "surge.warned": ["POSITION"],
        "unlimited": 3,
    }


def seen(row: int, phase: Phase, samples: int, watts: float) -> Snapshot:
    """A row of the plan as the panel gets it, with so much power at each station."""
    told: dict[str, Any] = {
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
    return Snapshot(told, 0, 0, "")


def test_a_line_tells_the_power_of_the_row_before(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Lines come where a row begins, when nothing is measured yet: they are to tell power too."""
    now = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    setting = SimpleNamespace(kp=-2000.0, ki=0.0, spring_rate=490.9)
    rows = (SimpleNamespace(setting=setting),) * 2
    view = Progress(
        "title",
        "rehearsal",
        SimpleNamespace(rows=rows, duration=60.0, wave_seconds=50.0),
        quiet=False,
    )
    view._drawn = False
    said = []
    for what in (
        seen(0, Phase.SETTLE, 0, 0.0),
        seen(0, Phase.MEASURE, 4000, -84.0),
        seen(1, Phase.SETTLE, 0, 0.0),
        seen(1, Phase.MEASURE, 10, -60.0),
    ):
        now[0] += 15.0
        view(what)
        said.append(capsys.readouterr().err)
    assert "not measuring" in said[0]
    assert "so far   -84.00 W mechanical" in said[1]
    assert "row 0 when last seen   -84.00 W mechanical     -42.00 W AC     -21.00 W DC" in said[2]
    assert "so far   -60.00 W mechanical" in said[3]
    assert "last seen" not in said[3]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSEGV])
def test_a_child_ended_by_a_signal_says_which(tmp_path: Path, number: signal.Signals) -> None:
    (tmp_path / "asleep.py").write_text("import time\ntime.sleep(60.0)\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(tmp_path))
        child = Child("asleep", "", (), tmp_path / "asleep.stderr")
    child.process.send_signal(number)
    child.end(10.0)
    assert child.last_message() == f"killed by {number.name}"


def test_a_child_that_failed_silently_says_its_code(tmp_path: Path) -> None:
    (tmp_path / "failing.py").write_text("raise SystemExit(7)\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(tmp_path))
        child = Child("failing", "", (), tmp_path / "failing.stderr")
    child.end(30.0)
    assert child.last_message() == "exit code 7"


def test_a_full_disk_leaves_no_half_of_a_summary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = Path.write_text

    def full(path: Path, text: str, **how: Any) -> int:
        if "summary.json" not in path.name:
            return written(path, text, **how)
        written(path, text[: len(text) // 2], **how)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    monkeypatch.setattr(summary, "as_text", lambda told: "in words\n")
    monkeypatch.setattr(summary, "as_json", lambda told: {"status": "complete"})
    (tmp_path / "summary.json").write_bytes(b'{"status": "before"}')
    with pytest.raises(OSError, match="No space left"):
        summary.write_texts(None, tmp_path)  # type: ignore[arg-type]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["summary.json", "summary.txt"]
    assert json.loads((tmp_path / "summary.json").read_bytes()) == {"status": "before"}


def test_a_full_disk_is_told_without_a_number() -> None:
    """A write names no file in its error, as opening one does."""
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert command_error.in_words(full) == "No space left on device"


def test_a_disk_too_small_for_the_run_is_told_before_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run's rows are counted as if nothing of them could be compressed."""
    need = 1000 * disk.row_bytes()  # 10 s at 100 Hz
    monkeypatch.setattr("os.statvfs", lambda place: SimpleNamespace(f_bavail=need, f_frsize=1))
    assert disk.shortage(tmp_path / "not" / "yet", 10.0, 100.0) == ""
    said = disk.shortage(tmp_path / "not" / "yet", 10.01, 100.0)
    assert said.startswith(f"{1e-6 * need:.1f} MB free in {tmp_path}; this run may write up to")
