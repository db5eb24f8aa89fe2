"""A loop without supervisor and logger saves its rows itself, or records the loss."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from core_runs import unflatten

from rig.kinds.wavebot.tick import WaveBotRow
from rig.processes import handover, last_logger
from rig.processes.last_logger import LastLogger
from rig.processes.messages import LoggerJob
from rig.realtime.loop import LoopResult
from rig.realtime.reasons import Reason
from rig.recording import ring
from rig.recording.folder_watch import open_folder
from rig.recording.mcap_writer import RowWriter
from rig.recording.row_layout import leaves, schema
from rig.recording.runs import create, mcap_file
from rig.recording.runs.recover import recover

NOW = datetime(2026, 1, 2, tzinfo=UTC)
END = LoopResult(900, 0, Reason.SUPERVISOR_LOST.value)
GONE = 1 << 30  # no process


@pytest.fixture
def run(tmp_path: Path) -> Path:
    folder = tmp_path / "a"
    folder.mkdir()
    (folder / "config.json").write_text("{}")
    (folder / "privileges.json").write_text("null")  # so that no logger waits for it at its end
    create.write_json(folder, "run.json", {"status": "running", "pid": GONE, "pid_started": 1})
    return folder


@pytest.fixture
def rows() -> tuple[int, ring.RingWriter]:
    """Return a ring with 900 rows, none of them taken."""
    fd = ring.create(WaveBotRow, 1024)
    writer = ring.RingWriter(fd, WaveBotRow, wait=False)
    writer.start(1_760_000_000_000_000_000)
    for tick in range(900):
        values = {"tick": tick, "tick_end": tick, "time": tick * 1e-3}
        zero = {"d": 0.0, "q": 0}
        flat = [values.get(leaf.name, zero[leaf.code]) for leaf in leaves(WaveBotRow)]
        writer.put(unflatten(WaveBotRow, flat))
    writer.finish()
    return fd, writer


def job_of(run: Path, fd: int) -> LoggerJob:
    return LoggerJob(
        **{"ring": fd, "rows": schema(WaveBotRow), "supervisor": GONE, "folder": str(run)},
        **{
            "folder_lock": open_folder(run),
            "part": "run.mcap.part0",
            "attachments": ("config.json",),
        },
        **{"run": "a", "mode": "rehearsal", "clock": "virtual"},
        **{"rate_hz": 1000.0, "disk_timeout_s": 1.0},
    )


def ticks(path: Path) -> Any:
    return np.concatenate([block["tick"] for block in mcap_file.blocks(mcap_file.scan(path))])


def test_a_logger_started_by_the_loop_saves_every_row(
    run: Path, rows: tuple[int, ring.RingWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(last_logger, "STALL_TIMEOUT_S", 0.1)
    fd, writer = rows
    (run / "run.mcap.part0").write_bytes(b"")  # of a logger that was killed at its start
    LastLogger(job_of(run, fd), GONE).save_remaining_rows(writer, END)
    assert writer.tail == writer.head == 900
    assert np.array_equal(ticks(run / "run.mcap.part1"), np.arange(900))
    ring_fd = recover(run, None, NOW)
    assert (
        ring_fd.account.lost,
        ring_fd.account.end_report and ring_fd.account.end_report.final,
    ) == (
        0,
        True,
    )
    assert ring_fd.outcome == "fault: SUPERVISOR_LOST"


def test_without_a_logger_the_exact_loss_is_recorded(
    run: Path, rows: tuple[int, ring.RingWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(last_logger, "STALL_TIMEOUT_S", 0.1)
    fd, writer = rows
    reader = ring.RingReader(fd)
    saved = reader.take(300)
    out = RowWriter(
        run / "run.mcap.part0", schema(WaveBotRow), {}, {}, start_utc_ns=writer.start_utc_ns
    )
    out.append(saved)
    out.flush()
    out.close()
    reader.commit()
    monkeypatch.setattr(sys, "executable", "/bin/false")
    LastLogger(job_of(run, fd), GONE).save_remaining_rows(writer, END)
    progress = json.loads((run / "progress.json").read_text())
    assert progress["final"] is True
    assert (progress["ticks"], progress["saved"], progress["last_tick"]) == (900, 300, 899)
    ring_fd = recover(run, None, NOW)
    assert [(gap.first, gap.last, gap.lost) for gap in ring_fd.account.gaps] == [(300, 899, 600)]
    assert ring_fd.account.end_report is not None
    assert (ring_fd.account.end_report.final, ring_fd.account.end_report.source) == (
        True,
        "the loop",
    )


def test_the_loop_starts_no_logger_while_the_supervisor_lives(
    run: Path, rows: tuple[int, ring.RingWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(last_logger, "SUPERVISED_TIMEOUT_S", 0.2)
    fd, writer = rows
    LastLogger(job_of(run, fd), os.getppid()).save_remaining_rows(writer, END)
    assert sorted(path.name for path in run.iterdir()) == [
        *("config.json", "privileges.json", "run.json")
    ]


def test_a_slow_logger_is_not_joined_by_a_second(
    run: Path, rows: tuple[int, ring.RingWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its disk is blocked for a while; after its death another one continues from its tail."""
    monkeypatch.setattr(last_logger, "STALL_TIMEOUT_S", 0.1)
    fd, writer = rows
    lock = ring.lock_consumer(fd)
    found: list[list[str]] = []

    def die() -> None:
        found.append([path.name for path in run.glob("*.mcap*")])
        os.close(lock)

    timer = threading.Timer(1.0, die)
    timer.start()
    LastLogger(job_of(run, fd), GONE).save_remaining_rows(writer, END)
    timer.join()
    assert found == [[]]
    assert np.array_equal(ticks(run / "run.mcap.part0"), np.arange(900))
    assert not ring.has_consumer(fd)


def test_a_logger_that_hangs_keeps_its_rows(
    run: Path, rows: tuple[int, ring.RingWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop does not wait for ever: the ring lives as long as that logger."""
    monkeypatch.setattr(last_logger, "STALL_TIMEOUT_S", 0.1)
    monkeypatch.setattr(last_logger, "HANG_TIMEOUT_S", 0.3)
    fd, writer = rows
    lock = ring.lock_consumer(fd)
    LastLogger(job_of(run, fd), GONE).save_remaining_rows(writer, END)
    os.close(lock)
    assert list(run.glob("*.mcap*")) == []
    assert json.loads((run / "progress.json").read_text())["saved"] == 0


def test_two_loggers_write_one_after_the_other(
    run: Path, rows: tuple[int, ring.RingWriter]
) -> None:
    """If two are started, one reads the ring and the other continues where it ended."""
    fd, writer = rows
    first = ring.lock_consumer(fd)
    reader = ring.RingReader(fd)
    command = [sys.executable, "-m", "rig.processes.logger"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, text=True, pass_fds=(fd,)) as second:
        assert second.stdin is not None
        second.stdin.write(handover.dumps(job_of(run, fd)))
        second.stdin.close()
        with pytest.raises(subprocess.TimeoutExpired):
            second.wait(1.5)
        assert list(run.glob("*.mcap*")) == []
        reader.take(300)
        reader.commit()
        os.close(first)
        assert second.wait(20.0) == 0
    assert writer.tail == 900
    assert np.array_equal(ticks(run / "run.mcap.part0"), np.arange(300, 900))


def test_without_a_job_the_call_returns_at_once(
    rows: tuple[int, ring.RingWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(last_logger, "STALL_TIMEOUT_S", 0.1)
    _, writer = rows
    LastLogger(None, GONE).save_remaining_rows(writer, END)
    assert writer.tail == 0
