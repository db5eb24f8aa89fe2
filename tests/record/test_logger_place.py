"""The logger with a failed disk or an unreachable folder."""

from __future__ import annotations

import errno
import json
import os
import shutil
import time
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import record_files as files
from mcap.reader import make_reader

from rig.kinds.wavebot.tick import WaveBotRow
from rig.processes import logger
from rig.processes.logger import RunLogger
from rig.processes.messages import (
    DiskState,
    LoggerJob,
    RecordLost,
    RecordMoved,
    read_report,
)
from rig.recording import ring
from rig.recording.folder_watch import FolderTracker
from rig.recording.row_layout import schema
from rig.recording.runs import create, open_run
from rig.recording.runs.mcap_file import scan

COUNT = 3000


@pytest.fixture
def run_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of a run, with a temporary home folder."""
    (tmp_path / "home").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(logger, "RETRY_INTERVAL", 0.01)
    folder = tmp_path / "runs" / "a"
    folder.mkdir(parents=True)
    (folder / "config.json").write_text('{"name": "x"}')
    (folder / "privileges.json").write_text("null")  # so that the logger does not wait for it
    create.write_json(folder, "run.json", {"run": "a", "status": "running"})
    return folder


def logged_rows() -> Any:
    """Return the rows of a loop that ended normally."""
    block = files.rows(COUNT)
    block["safety.reason"] = block["timing.skipped"] = 0
    return block


def log_of(run_folder: Path, timeout_s: float = 0.1, part: str = "run.mcap.part0") -> RunLogger:
    """Return a logger at a ring whose loop has ended."""
    fd = ring.create(WaveBotRow, 4096)
    writer = ring.RingWriter(fd, WaveBotRow, wait=False)
    writer.start(files.START)
    for row in row_tuples():
        writer.put(row)
    writer.finish()
    attached = ("config.json", "privileges.json")
    job = LoggerJob(fd, schema(WaveBotRow), os.getppid(), str(run_folder), -1, part, attached, "a",
              "rehearsal", "virtual", 1000.0, timeout_s)  # fmt: skip
    return RunLogger(job)


@cache
def row_tuples() -> list[Any]:
    return [tuple_of(row) for row in logged_rows()]


def tuple_of(row: Any) -> Any:
    """Return a record as the nested tuple that the loop puts into the ring."""
    values = iter(row.tolist())

    def build(kind: Any) -> Any:
        hints = kind.__annotations__
        return kind(*(build(h) if hasattr(h, "_fields") else next(values) for h in hints.values()))

    return build(WaveBotRow)


def refusing(monkeypatch: pytest.MonkeyPatch, error: int, *below: Path) -> None:
    """Make writes to files below some folders fail."""
    write, full = os.pwrite, tuple(f"{path}/" for path in below)

    def refuse(fd: int, data: Any, at: int) -> int:
        if os.readlink(f"/proc/self/fd/{fd}").startswith(full):
            raise OSError(error, os.strerror(error))
        return write(fd, data, at)

    monkeypatch.setattr(os, "pwrite", refuse)


def saved(folder: Path, output: str) -> list[Any]:
    assert np.array_equal(open_run(folder, ["tick"])["tick"].values, np.arange(COUNT))
    assert (folder / "config.json").exists()
    assert json.loads((folder / "run.json").read_text())["run"] == "a"
    return reports(output)


def reports(output: str) -> list[Any]:
    return [read_report(line) for line in output.splitlines()]


@pytest.mark.parametrize("error", [errno.EROFS, errno.EIO, errno.ENOSPC])
def test_a_failed_disk_moves_the_record_to_a_rescue_folder(
    error: int, run_folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    log = log_of(run_folder)
    refusing(monkeypatch, error, run_folder.parent)
    assert log.run() == 0
    sent = saved(run_folder.parents[1] / "home" / "a.rescued", capfd.readouterr().out)
    assert {RecordLost, RecordMoved} <= {type(each) for each in sent}
    assert os.strerror(error) in next(each.why for each in sent if isinstance(each, RecordMoved))
    assert not (run_folder.parent / "a.rescued").exists()  # no partial file is left


def test_an_unreachable_folder_moves_the_record(
    run_folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Without permissions the open file can be written, but its path is unreachable."""
    log = log_of(run_folder)
    reached, stat = str(run_folder), os.stat

    def hidden(path: Any, **how: Any) -> os.stat_result:
        if str(path).startswith(f"{reached}/"):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return stat(path, **how)

    monkeypatch.setattr(os, "stat", hidden)
    assert log.run() == 0
    monkeypatch.undo()
    saved(run_folder.parent / "a.rescued", capfd.readouterr().out)


@pytest.mark.parametrize("error", [errno.EIO, errno.ENOSPC])
def test_a_failed_rescue_folder_is_replaced_by_the_next(
    error: int, run_folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The next folder gets a whole copy; the failed one is not used again."""
    log = log_of(run_folder)
    home, last = run_folder.parents[1] / "home", run_folder.parents[1] / "tmp"
    last.mkdir()
    monkeypatch.setattr(
        "rig.recording.folder_watch.tempfile", SimpleNamespace(gettempdir=lambda: last)
    )
    refusing(monkeypatch, error, run_folder.parent)
    go_on = log._writer.switch_file

    def fails_later(path: Path) -> None:
        go_on(path)
        refusing(monkeypatch, error, run_folder.parent, home)

    monkeypatch.setattr(log._writer, "switch_file", fails_later)
    assert log.run() == 0
    sent = saved(last / "a.rescued", capfd.readouterr().out)
    places = [each.folder for each in sent if isinstance(each, RecordMoved)]
    assert places == [str(home / "a.rescued"), str(last / "a.rescued")]


@pytest.mark.parametrize("error", [errno.EIO, errno.ENOSPC])
def test_without_a_writable_folder_the_logger_ends(
    error: int, run_folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The logger ends with an exit code and reports each folder once."""
    log = log_of(run_folder, timeout_s=0.3)
    nowhere = SimpleNamespace(gettempdir=lambda: run_folder.parents[1] / "nowhere")
    monkeypatch.setattr("rig.recording.folder_watch.tempfile", nowhere)
    refusing(monkeypatch, error, run_folder.parent)
    go_on = log._writer.switch_file

    def fails_later(path: Path) -> None:
        go_on(path)
        refusing(monkeypatch, error, run_folder.parents[1])

    monkeypatch.setattr(log._writer, "switch_file", fails_later)
    began = time.monotonic()
    assert log.run() == logger.EXIT_ROWS_LOST
    assert time.monotonic() - began < 10.0
    sent = [type(each) for each in reports(capfd.readouterr().out)]
    assert sent == [DiskState, RecordLost, RecordMoved, RecordLost]


def test_the_rescue_folder_has_its_own_timeout(
    run_folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The timeout of the full disk does not count against the rescue folder."""
    log = log_of(run_folder)
    finish = log._writer.finish

    def fills() -> None:
        refusing(monkeypatch, errno.ENOSPC, run_folder.parent)
        finish()

    monkeypatch.setattr(log._writer, "finish", fills)
    assert log.run() == 0
    saved(run_folder.parents[1] / "home" / "a.rescued", capfd.readouterr().out)
    assert scan(run_folder.parents[1] / "home" / "a.rescued" / "run.mcap.part0").finished


def test_the_tracker_opens_the_rescued_part(tmp_path: Path) -> None:
    """After a rescue by the logger its copy grows, and may be deleted as well."""
    folder, rescue = tmp_path / "a", tmp_path / "a.rescued"
    for run_folder, data in ((folder, b"begun"), (rescue, b"begun, and all that followed")):
        run_folder.mkdir()
        (run_folder / "run.mcap.part0").write_bytes(data)
    where = FolderTracker(folder)
    where.open_part("run.mcap.part0")
    shutil.rmtree(folder)
    where.relocate(rescue, "the run's folder was deleted")
    shutil.rmtree(rescue)
    saved = where.locate_record()
    assert (saved / "run.mcap.part0").read_bytes() == b"begun, and all that followed"
    where.close()


def test_uncommitted_rows_of_a_killed_logger_count_once(run_folder: Path) -> None:
    """The ring still holds rows of the earlier part: its logger died before moving the tail."""
    files.write(run_folder / "run.mcap.part0", logged_rows()[: COUNT // 2], finish=False)
    assert log_of(run_folder, part="run.mcap.part1").run() == 0
    with (run_folder / "run.mcap.part1").open("rb") as file:
        written = {each.name: each.data for each in make_reader(file).iter_attachments()}
    for name in ("timing.json", "status.json"):
        assert json.loads(written[name])["ticks"] == COUNT
