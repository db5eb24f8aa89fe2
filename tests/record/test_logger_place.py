"""The logger where its disk takes nothing any more, or its folder is out of reach."""

from __future__ import annotations

import errno
import json
import os
import shutil
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import record_files as files
from mcap.reader import make_reader

from rig.kinds.wavebot import WaveBotRow
from rig.recording import logger, ring
from rig.recording.folder_watch import Whereabouts
from rig.recording.logger import Job, Log
from rig.recording.runs import create, open_run
from rig.recording.runs.mcap_file import scan

COUNT = 3000


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a run, and another place for a home."""
    (tmp_path / "home").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(logger, "RETRY", 0.01)
    folder = tmp_path / "runs" / "a"
    folder.mkdir(parents=True)
    (folder / "config.json").write_text('{"name": "x"}')
    (folder / "privileges.json").write_text("null")  # no wait for it at the end
    create.write_json(folder, "run.json", {"run": "a", "status": "running"})
    return folder


def logged_rows() -> Any:
    """The rows of a loop that ended well."""
    block = files.rows(COUNT)
    block["safety.reason"] = block["timing.skipped"] = 0
    return block


def log_of(place: Path, patience: float = 0.1, part: str = "run.mcap.part0") -> Log:
    """A logger at a ring whose loop has ended."""
    fd = ring.create(WaveBotRow, 4096)
    writer = ring.Writer(fd, WaveBotRow, wait=False)
    writer.start(files.START)
    for row in logged_rows():
        writer.put(tuple_of(row))
    writer.finish()
    attached = ("config.json", "privileges.json")
    job = Job("wavebot", fd, os.getppid(), str(place), part, attached, "a",
              "rehearsal", "virtual", 1000.0, patience)  # fmt: skip
    return Log(job)


def tuple_of(row: Any) -> Any:
    """A record as the nested tuple that the loop puts into the ring."""
    values = iter(row.tolist())

    def build(kind: Any) -> Any:
        hints = kind.__annotations__
        return kind(*(build(h) if hasattr(h, "_fields") else next(values) for h in hints.values()))

    return build(WaveBotRow)


def refusing(monkeypatch: pytest.MonkeyPatch, error: int, *below: Path) -> None:
    """Let no byte be written to files below some folders."""
    write, full = os.pwrite, tuple(f"{path}/" for path in below)

    def refuse(fd: int, data: Any, at: int) -> int:
        if os.readlink(f"/proc/self/fd/{fd}").startswith(full):
            raise OSError(error, os.strerror(error))
        return write(fd, data, at)

    monkeypatch.setattr(os, "pwrite", refuse)


def saved(folder: Path, heard: str) -> list[dict[str, Any]]:
    assert np.array_equal(open_run(folder, ["tick"])["tick"].values, np.arange(COUNT))
    assert (folder / "config.json").exists()
    assert json.loads((folder / "run.json").read_text())["run"] == "a"
    return [json.loads(line) for line in heard.splitlines()]


@pytest.mark.parametrize("error", [errno.EROFS, errno.EIO, errno.ENOSPC])
def test_a_disk_that_takes_nothing_any_more(
    error: int, place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    log = log_of(place)
    refusing(monkeypatch, error, place.parent)
    assert log.run() == 0
    events = saved(place.parents[1] / "home" / "a.rescued", capfd.readouterr().out)
    assert {"lost", "place"} <= {event["event"] for event in events}
    assert os.strerror(error) in next(each["why"] for each in events if each["event"] == "place")
    assert not (place.parent / "a.rescued").exists()  # nothing half done is left


def test_a_folder_out_of_reach(
    place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Its rights were taken away: what is open can be written, but nobody finds it."""
    log = log_of(place)
    reached, stat = str(place), os.stat

    def hidden(path: Any, **how: Any) -> os.stat_result:
        if str(path).startswith(f"{reached}/"):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return stat(path, **how)

    monkeypatch.setattr(os, "stat", hidden)
    assert log.run() == 0
    monkeypatch.undo()
    saved(place.parent / "a.rescued", capfd.readouterr().out)


@pytest.mark.parametrize("error", [errno.EIO, errno.ENOSPC])
def test_a_rescue_place_that_fails_as_well(
    error: int, place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The next place is taken, with a whole copy; the first is never come back to."""
    log = log_of(place)
    home, last = place.parents[1] / "home", place.parents[1] / "tmp"
    last.mkdir()
    monkeypatch.setattr(
        "rig.recording.folder_watch.tempfile", SimpleNamespace(gettempdir=lambda: last)
    )
    refusing(monkeypatch, error, place.parent)
    go_on = log._writer.go_on_in

    def fails_later(path: Path) -> None:
        go_on(path)
        refusing(monkeypatch, error, place.parent, home)

    monkeypatch.setattr(log._writer, "go_on_in", fails_later)
    assert log.run() == 0
    events = saved(last / "a.rescued", capfd.readouterr().out)
    places = [each["folder"] for each in events if each["event"] == "place"]
    assert places == [str(home / "a.rescued"), str(last / "a.rescued")]


@pytest.mark.parametrize("error", [errno.EIO, errno.ENOSPC])
def test_no_place_that_takes_anything(
    error: int, place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The logger ends and says so, and tells of each place once."""
    log = log_of(place, patience=0.3)
    nowhere = SimpleNamespace(gettempdir=lambda: place.parents[1] / "nowhere")
    monkeypatch.setattr("rig.recording.folder_watch.tempfile", nowhere)
    refusing(monkeypatch, error, place.parent)
    go_on = log._writer.go_on_in

    def fails_later(path: Path) -> None:
        go_on(path)
        refusing(monkeypatch, error, place.parents[1])

    monkeypatch.setattr(log._writer, "go_on_in", fails_later)
    began = time.monotonic()
    assert log.run() == logger.DISK
    assert time.monotonic() - began < 10.0
    events = [json.loads(line)["event"] for line in capfd.readouterr().out.splitlines()]
    assert events == ["disk", "lost", "place", "lost"]


def test_a_disk_that_fills_at_the_very_end(
    place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The time of the full disk does not count against the place that the record is saved to."""
    log = log_of(place)
    finish = log._writer.finish

    def fills() -> None:
        refusing(monkeypatch, errno.ENOSPC, place.parent)
        finish()

    monkeypatch.setattr(log._writer, "finish", fills)
    assert log.run() == 0
    saved(place.parents[1] / "home" / "a.rescued", capfd.readouterr().out)
    assert scan(place.parents[1] / "home" / "a.rescued" / "run.mcap.part0").finished


def test_the_rescued_part_is_the_one_that_is_held(tmp_path: Path) -> None:
    """After a rescue by the logger its copy grows, and that can be deleted as well."""
    folder, rescue = tmp_path / "a", tmp_path / "a.rescued"
    for place, data in ((folder, b"begun"), (rescue, b"begun, and all that followed")):
        place.mkdir()
        (place / "run.mcap.part0").write_bytes(data)
    where = Whereabouts(folder)
    where.hold("run.mcap.part0")
    shutil.rmtree(folder)
    where.relocate(rescue, "the run's folder was deleted")
    shutil.rmtree(rescue)
    saved = where.settle()
    assert (saved / "run.mcap.part0").read_bytes() == b"begun, and all that followed"
    where.close()


def test_rows_that_a_killed_logger_wrote_but_did_not_commit_count_once(place: Path) -> None:
    """The ring still has the rows of the earlier part: its logger died before it moved the tail."""
    files.write(place / "run.mcap.part0", logged_rows()[: COUNT // 2], finish=False)
    assert log_of(place, part="run.mcap.part1").run() == 0
    with (place / "run.mcap.part1").open("rb") as file:
        written = {each.name: each.data for each in make_reader(file).iter_attachments()}
    for name in ("timing.json", "status.json"):
        assert json.loads(written[name])["ticks"] == COUNT
