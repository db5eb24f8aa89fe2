"""Recovering a run: what the crash left stays, the new file is whole or not there at all."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import random
import subprocess
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import record_files as files
from mcap.reader import make_reader

from rig.recording import process_identity, runs
from rig.recording.runs import RunError, create, folder
from rig.recording.runs.account import Gap
from rig.recording.runs.mcap_file import scan
from rig.recording.runs.recover import Recovery, recover

NOW = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


def rows(count: int, first: int = 0) -> Any:
    """Rows of a loop that skipped nothing."""
    block = files.rows(count, first)
    block["timing.skipped"] = 0
    return block


def left_behind(place: Path, *stretches: tuple[int, int], **status: Any) -> Path:
    """The folder of a run whose loggers were killed: each part holds (first tick, rows)."""
    place.mkdir(parents=True)
    for number, (first, count) in enumerate(stretches):
        files.write(place / f"run.mcap.part{number}", rows(count, first), finish=False)
    told = {"run": place.name, "status": "running", "pid": 1 << 30, "pid_started": 1, **status}
    create.write_json(place, folder.STATUS, told)
    return place


def again(run: Path, output: Path | None = None) -> Recovery:
    return recover(run, output, NOW)


def prints(place: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in place.glob("*.part*")}


def messages(path: Path) -> int:
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())


def test_parts_become_a_record_and_stay(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 1000), (900, 300), (1250, 100))
    before = prints(run)
    made = again(run)
    assert prints(run) == before
    assert made.output == run / "run.mcap"
    assert (made.written, made.duplicates) == (True, 100)
    assert made.account.gaps == (Gap(1200, 1249, 0),)
    assert (made.account.rows, made.account.lost, made.whole) == (1300, 50, False)
    assert messages(made.output) == made.seen.rows == 1300
    assert len(runs.open_run(run, "load")["time"]) == 1300
    told = json.loads((run / "run.json").read_text())
    assert (told["status"], told["reason"]) == ("crashed", "its processes were killed")
    assert told["recovered_utc"] == NOW.isoformat()


def test_doing_it_again_changes_nothing(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 500), (510, 500))
    (run / "progress.json").write_text('{"last_tick": 1030, "skipped": 0}   \n')
    first = again(run)
    every = {p: p.read_bytes() for p in run.iterdir()}
    second = again(run)
    assert {p: p.read_bytes() for p in run.iterdir()} == every
    assert (first.written, second.written) == (True, False)
    assert second.account == first.account
    assert first.account.gaps == (Gap(500, 509, 0), Gap(1010, 1030, 0))
    assert (second.whole, second.ending) == (first.whole, first.ending)
    for part in run.glob("*.part*"):  # nobody needs them any more
        part.unlink()
    assert again(run).account == first.account


def test_what_the_logger_saw_of_the_end_counts(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a")
    out = files.writer(run / "run.mcap.part0")
    out.append(rows(700).tobytes())
    said = {"status": "fault", "reason": "SUPERVISOR_LOST", "ticks": 700, "dropped_rows": 0}
    out.attach("status.json", json.dumps(said).encode())
    out.finish()
    made = again(run)
    assert made.whole
    assert made.ending == "fault: SUPERVISOR_LOST"
    told = json.loads((run / "run.json").read_text())
    assert (told["status"], told["reason"], told["ticks"]) == ("fault", "SUPERVISOR_LOST", 700)
    assert again(run).whole


def test_what_the_supervisor_saw_of_the_end_counts(tmp_path: Path) -> None:
    """A log given up to a full disk: the ring had more, and then it overflowed."""
    ended = {"status": "fault", "reason": "LOGGER_LOST", "ticks": 1100, "last_tick": 1049}
    run = left_behind(tmp_path / "a", (0, 1000), **ended, skipped=10)
    made = again(run)
    assert made.account.gaps == (Gap(1000, 1049, 10),)
    assert (made.account.beyond, made.account.lost) == (60, 100)
    told = json.loads((run / "run.json").read_text())
    assert (told["status"], told["ticks"]) == ("fault", 1100)
    assert told["recovered_utc"] == NOW.isoformat()


def test_a_torn_record_is_recovered_beside_itself(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a")
    whole = files.write(tmp_path / "whole.mcap", rows(1000), flush_every=100)
    torn = whole.read_bytes()[: scan(whole).chunks[6].offset + 5]
    (run / "run.mcap").write_bytes(torn)
    made = again(run)
    assert made.output == run / "run.recovered.mcap"
    assert (made.account.rows, messages(made.output)) == (600, 600)
    assert made.unread > 0
    assert (run / "run.mcap").read_bytes() == torn
    assert len(runs.open_run(run, "load")["time"]) == 600
    assert not again(run).written


def test_one_file_alone(tmp_path: Path) -> None:
    for name in ("x.mcap", "run.mcap.part0"):
        path = files.write(tmp_path / name, rows(300), finish=False)
        made = again(path)
        stem = name.removesuffix(".mcap")
        assert made.output == tmp_path / f"{stem}.recovered.mcap"
        assert (made.account.rows, messages(made.output)) == (300, 300)
        done = again(made.output)
        assert (done.written, done.sources, done.output) == (False, (), made.output)


def test_damage_is_told_every_time(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a")
    path = files.write(run / "run.mcap.part0", rows(1000), flush_every=100)
    chunk = scan(path).chunks[3]
    data = bytearray(path.read_bytes())
    data[chunk.offset + chunk.length // 2] ^= 0xFF
    path.write_bytes(data)
    for _ in range(2):
        made = again(run)
        assert made.account.gaps == (Gap(300, 399, 0),)
        assert f"chunk at byte {chunk.offset}" in made.damage[0]
        assert not made.whole


def test_another_place_leaves_the_run_as_it_is(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 200))
    before = {p: p.read_bytes() for p in run.iterdir()}
    made = again(run, tmp_path / "elsewhere.mcap")
    assert messages(made.output) == 200
    assert {p: p.read_bytes() for p in run.iterdir()} == before
    again(run)
    copy = again(run, tmp_path / "copy.mcap")  # of a record that is whole by now
    assert messages(copy.output) == 200


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"not at all", bytes(10_000)])
def test_an_unreadable_record_is_no_success(content: bytes, tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a")
    (run / "run.mcap.part0").write_bytes(content)
    with pytest.raises(RunError):
        again(run)
    assert sorted(p.name for p in run.iterdir()) == ["run.json", "run.mcap.part0"]
    assert json.loads((run / "run.json").read_text())["status"] == "running"
    (run / "run.mcap.part0").rename(run / "run.mcap")
    with pytest.raises(RunError):
        again(run)
    (run / "run.mcap").unlink()
    with pytest.raises(RunError, match="nothing was written"):
        again(run)


def test_a_run_that_goes_on_is_left_alone(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 100))
    with create.hold_run(run), pytest.raises(create.BusyError, match="still being written"):
        again(run)
    me = {"pid": os.getpid(), "pid_started": process_identity.started(os.getpid())}
    other = left_behind(tmp_path / "b", (0, 100), **me)
    with pytest.raises(create.BusyError, match=f"process {os.getpid()}"):
        again(other)
    assert not (run / "run.mcap").exists()
    assert not (other / "run.mcap").exists()
    assert again(run).written  # the lock went with its holder


def test_a_file_in_the_way_is_not_touched(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 400))
    for content in (files.write(tmp_path / "o.mcap", rows(100)).read_bytes(), b"something else"):
        target = tmp_path / "out.mcap"
        target.write_bytes(content)
        with pytest.raises(RunError, match=r"out\.mcap"):
            again(run, target)
        assert target.read_bytes() == content


def test_a_full_disk_leaves_nothing_half_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = left_behind(tmp_path / "a", (0, 5000))
    write, left = os.pwrite, 100_000

    def small(fd: int, data: Any, offset: int) -> int:
        if offset + len(data) > left:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(fd, data, offset)

    monkeypatch.setattr(os, "pwrite", small)
    with pytest.raises(OSError, match="No space left"):
        again(run)
    monkeypatch.undo()
    assert sorted(p.name for p in run.iterdir()) == ["run.json", "run.mcap.part0"]
    assert again(run).account.rows == 5000


def test_a_recovery_that_is_killed_can_be_done_again(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 60_000))
    code = (
        "import sys; from pathlib import Path; from datetime import datetime, UTC\n"
        "from rig.recording.runs.recover import recover\n"
        "print('go', flush=True); recover(Path(sys.argv[1]), None, datetime.now(UTC))\n"
    )
    chance, unfinished = random.Random(11), 0
    for _ in range(6):
        with subprocess.Popen(
            [sys.executable, "-c", code, str(run)], stdout=subprocess.PIPE
        ) as child:
            assert child.stdout is not None
            child.stdout.readline()
            time.sleep(chance.uniform(0.0, 0.6))
            child.kill()
        unfinished += not (run / "run.mcap").exists()
        if (run / "run.mcap").exists():
            assert messages(run / "run.mcap") == 60_000
    assert unfinished > 0
    assert again(run).account.rows == 60_000
    assert not list(run.glob("*.joining"))
