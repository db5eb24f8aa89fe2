"""A loop whose supervisor and logger are dead saves its rows itself, or says how many are lost."""

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

from rig.kinds.wavebot import WaveBotRow
from rig.processes import last_logger
from rig.processes.last_logger import LastLogger
from rig.realtime.loop import End
from rig.realtime.safety import Reason
from rig.recording import ring
from rig.recording.mcap_writer import RowWriter
from rig.recording.row_layout import leaves
from rig.recording.runs import create, mcap_file
from rig.recording.runs.recover import recover

NOW = datetime(2026, 1, 2, tzinfo=UTC)
END = End(900, 0, Reason.SUPERVISOR_LOST.value)
GONE = 1 << 30  # no process


@pytest.fixture
def run(tmp_path: Path) -> Path:
    folder = tmp_path / "a"
    folder.mkdir()
    (folder / "config.json").write_text("{}")
    (folder / "privileges.json").write_text("null")  # no logger waits for it at its end
    create.write_json(folder, "run.json", {"status": "running", "pid": GONE, "pid_started": 1})
    return folder


@pytest.fixture
def rows() -> tuple[int, ring.Writer]:
    """A ring with 900 rows that nobody has taken."""
    fd = ring.create(WaveBotRow, 1024)
    writer = ring.Writer(fd, WaveBotRow, wait=False)
    writer.start(1_760_000_000_000_000_000)
    for tick in range(900):
        values = {"tick": tick, "tick_end": tick, "time": tick * 1e-3}
        zero = {"d": 0.0, "q": 0}
        flat = [values.get(leaf.name, zero[leaf.code]) for leaf in leaves(WaveBotRow)]
        writer.put(unflatten(WaveBotRow, flat))
    writer.finish()
    return fd, writer


def request(run: Path, fd: int) -> str:
    job = {
        **{"kind": "wavebot", "ring": fd, "supervisor": GONE, "folder": str(run)},
        **{"part": "run.mcap.part0", "attachments": ["config.json"], "run": "a"},
        **{"mode": "rehearsal", "clock": "virtual", "rate_hz": 1000.0, "patience": 1.0},
    }
    return json.dumps({"job": job, "ring": fd, "folder": -1})


def ticks(path: Path) -> Any:
    return np.concatenate([block["tick"] for block in mcap_file.blocks(mcap_file.scan(path))])


def test_a_logger_of_its_own_saves_every_row(
    run: Path, rows: tuple[int, ring.Writer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(last_logger, "STUCK", 0.1)
    fd, writer = rows
    (run / "run.mcap.part0").write_bytes(b"")  # of the logger that was killed as it started
    LastLogger(request(run, fd), GONE).see_out(writer, END)
    assert writer.tail == writer.head == 900
    assert np.array_equal(ticks(run / "run.mcap.part1"), np.arange(900))
    made = recover(run, None, NOW)
    assert (made.account.lost, made.account.ending and made.account.ending.final) == (0, True)
    assert made.ending == "fault: SUPERVISOR_LOST"


def test_where_none_can_be_started_the_loss_is_noted_exactly(
    run: Path, rows: tuple[int, ring.Writer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(last_logger, "STUCK", 0.1)
    fd, writer = rows
    reader = ring.Reader(fd)
    saved = reader.take(300)
    out = RowWriter(run / "run.mcap.part0", WaveBotRow, {}, {}, start_utc_ns=writer.start_utc_ns)
    out.append(saved)
    out.flush()
    out.close()
    reader.commit()
    monkeypatch.setattr(sys, "executable", "/bin/false")
    LastLogger(request(run, fd), GONE).see_out(writer, END)
    noted = json.loads((run / "progress.json").read_text())
    assert noted["final"] is True
    assert (noted["ticks"], noted["saved"], noted["last_tick"]) == (900, 300, 899)
    made = recover(run, None, NOW)
    assert [(gap.first, gap.last, gap.lost) for gap in made.account.gaps] == [(300, 899, 600)]
    assert made.account.ending is not None
    assert (made.account.ending.final, made.account.ending.witness) == (True, "the loop")


def test_nobody_interferes_while_the_supervisor_lives(
    run: Path, rows: tuple[int, ring.Writer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(last_logger, "LIVING", 0.2)
    fd, writer = rows
    LastLogger(request(run, fd), os.getppid()).see_out(writer, END)
    assert sorted(path.name for path in run.iterdir()) == [
        *("config.json", "privileges.json", "run.json")
    ]


def test_a_slow_logger_that_lives_is_not_joined_by_a_second(
    run: Path, rows: tuple[int, ring.Writer], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its disk lets it save nothing for a while; once it is dead, another goes on from its tail."""
    monkeypatch.setattr(last_logger, "STUCK", 0.1)
    fd, writer = rows
    lock = ring.consume(fd)
    found: list[list[str]] = []

    def die() -> None:
        found.append([path.name for path in run.glob("*.mcap*")])
        os.close(lock)

    timer = threading.Timer(1.0, die)
    timer.start()
    LastLogger(request(run, fd), GONE).see_out(writer, END)
    timer.join()
    assert found == [[]]
    assert np.array_equal(ticks(run / "run.mcap.part0"), np.arange(900))
    assert not ring.consumed(fd)


def test_a_logger_that_hangs_keeps_its_rows(
    run: Path, rows: tuple[int, ring.Writer], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop does not wait for ever: the ring lives as long as that logger does."""
    monkeypatch.setattr(last_logger, "STUCK", 0.1)
    monkeypatch.setattr(last_logger, "HANGS", 0.3)
    fd, writer = rows
    lock = ring.consume(fd)
    LastLogger(request(run, fd), GONE).see_out(writer, END)
    os.close(lock)
    assert list(run.glob("*.mcap*")) == []
    assert json.loads((run / "progress.json").read_text())["saved"] == 0


def test_two_loggers_take_turns(run: Path, rows: tuple[int, ring.Writer]) -> None:
    """However both came to be started: one reads the ring, the other goes on where it ended."""
    fd, writer = rows
    first = ring.consume(fd)
    reader = ring.Reader(fd)
    job = json.loads(request(run, fd))["job"]
    command = [sys.executable, "-m", "rig.recording.logger"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, text=True, pass_fds=(fd,)) as second:
        assert second.stdin is not None
        second.stdin.write(json.dumps(list(job.values())))
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


def test_without_a_request_nothing_is_waited_for_or_noted(
    rows: tuple[int, ring.Writer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(last_logger, "STUCK", 0.1)
    _, writer = rows
    LastLogger("", GONE).see_out(writer, END)
    assert writer.tail == 0
