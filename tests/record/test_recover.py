"""Recovery of a run: the sources are kept, the new file is complete or absent."""

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

from rig import module_process
from rig.recording import runs
from rig.recording.runs import RunError, create, folder
from rig.recording.runs.mcap_file import scan
from rig.recording.runs.recover import Recovery, recover
from rig.recording.runs.state import Gap

NOW = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


def rows(count: int, first: int = 0) -> Any:
    """Return rows of a loop that skipped no period."""
    block = files.rows(count, first)
    block["timing.skipped"] = 0
    return block


def left_behind(run_folder: Path, *stretches: tuple[int, int], **status: Any) -> Path:
    """Write the folder of a run with killed loggers: each part holds (first tick, rows)."""
    run_folder.mkdir(parents=True)
    for number, (first, count) in enumerate(stretches):
        files.write(run_folder / f"run.mcap.part{number}", rows(count, first), finish=False)
    status_file = {
        "run": run_folder.name,
        "status": "running",
        "pid": 1 << 30,
        "pid_started": 1,
        **status,
    }
    create.write_json(run_folder, folder.STATUS, status_file)
    return run_folder


def recover_run(run: Path, output: Path | None = None) -> Recovery:
    return recover(run, output, NOW)


def prints(run_folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in run_folder.glob("*.part*")}


def messages(path: Path) -> int:
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())


def test_parts_are_joined_and_kept(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 1000), (900, 300), (1250, 100))
    before = prints(run)
    recovery = recover_run(run)
    assert prints(run) == before
    assert recovery.output == run / "run.mcap"
    assert (recovery.written, recovery.duplicates) == (True, 100)
    assert recovery.account.gaps == (Gap(1200, 1249, 0),)
    assert (recovery.account.rows, recovery.account.lost, recovery.complete) == (1300, 50, False)
    assert messages(recovery.output) == recovery.read_back.rows == 1300
    assert len(runs.open_run(run, "load")["time"]) == 1300
    status_file = json.loads((run / "run.json").read_text())
    assert (status_file["status"], status_file["reason"]) == (
        "crashed",
        "its processes were killed",
    )
    assert status_file["recovered_utc"] == NOW.isoformat()


def test_a_second_recovery_changes_nothing(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 500), (510, 500))
    (run / "progress.json").write_text('{"last_tick": 1030, "skipped": 0}   \n')
    first = recover_run(run)
    every = {p: p.read_bytes() for p in run.iterdir()}
    second = recover_run(run)
    assert {p: p.read_bytes() for p in run.iterdir()} == every
    assert (first.written, second.written) == (True, False)
    assert second.account == first.account
    assert first.account.gaps == (Gap(500, 509, 0), Gap(1010, 1030, 0))
    assert (second.complete, second.outcome) == (first.complete, first.outcome)
    for part in run.glob("*.part*"):  # no longer needed
        part.unlink()
    assert recover_run(run).account == first.account


def test_the_end_report_of_the_logger_counts(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a")
    out = files.writer(run / "run.mcap.part0")
    out.append(rows(700).tobytes())
    status = {"status": "fault", "reason": "SUPERVISOR_LOST", "ticks": 700, "dropped_rows": 0}
    out.attach("status.json", json.dumps(status).encode())
    out.finish()
    recovery = recover_run(run)
    assert recovery.complete
    assert recovery.outcome == "fault: SUPERVISOR_LOST"
    status_file = json.loads((run / "run.json").read_text())
    assert (status_file["status"], status_file["reason"], status_file["ticks"]) == (
        "fault",
        "SUPERVISOR_LOST",
        700,
    )
    assert recover_run(run).complete


def test_the_end_report_of_the_supervisor_counts(tmp_path: Path) -> None:
    """A log ended by a full disk: the ring held more rows and then overflowed."""
    ended = {"status": "fault", "reason": "LOGGER_LOST", "ticks": 1100, "last_tick": 1049}
    run = left_behind(tmp_path / "a", (0, 1000), **ended, skipped=10)
    recovery = recover_run(run)
    assert recovery.account.gaps == (Gap(1000, 1049, 10),)
    assert (recovery.account.lost_at_end, recovery.account.lost) == (60, 100)
    status_file = json.loads((run / "run.json").read_text())
    assert (status_file["status"], status_file["ticks"]) == ("fault", 1100)
    assert status_file["recovered_utc"] == NOW.isoformat()


def test_a_damaged_record_is_recovered_next_to_itself(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a")
    whole = files.write(tmp_path / "whole.mcap", rows(1000), flush_every=100)
    torn = whole.read_bytes()[: scan(whole).chunks[6].offset + 5]
    (run / "run.mcap").write_bytes(torn)
    recovery = recover_run(run)
    assert recovery.output == run / "run.recovered.mcap"
    assert (recovery.account.rows, messages(recovery.output)) == (600, 600)
    assert recovery.unread > 0
    assert (run / "run.mcap").read_bytes() == torn
    assert len(runs.open_run(run, "load")["time"]) == 600
    assert not recover_run(run).written


def test_a_single_file_is_recovered(tmp_path: Path) -> None:
    for name in ("x.mcap", "run.mcap.part0"):
        path = files.write(tmp_path / name, rows(300), finish=False)
        recovery = recover_run(path)
        stem = name.removesuffix(".mcap")
        assert recovery.output == tmp_path / f"{stem}.recovered.mcap"
        assert (recovery.account.rows, messages(recovery.output)) == (300, 300)
        done = recover_run(recovery.output)
        assert (done.written, done.sources, done.output) == (False, (), recovery.output)


def test_damage_is_reported_every_time(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a")
    path = files.write(run / "run.mcap.part0", rows(1000), flush_every=100)
    chunk = scan(path).chunks[3]
    data = bytearray(path.read_bytes())
    data[chunk.offset + chunk.length // 2] ^= 0xFF
    path.write_bytes(data)
    for _ in range(2):
        recovery = recover_run(run)
        assert recovery.account.gaps == (Gap(300, 399, 0),)
        assert f"chunk at byte {chunk.offset}" in recovery.damage[0]
        assert not recovery.complete


def test_another_output_leaves_the_run_unchanged(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 200))
    before = {p: p.read_bytes() for p in run.iterdir()}
    recovery = recover_run(run, tmp_path / "elsewhere.mcap")
    assert messages(recovery.output) == 200
    assert {p: p.read_bytes() for p in run.iterdir()} == before
    recover_run(run)
    copy = recover_run(run, tmp_path / "copy.mcap")  # of a record that is complete by now
    assert messages(copy.output) == 200


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"not at all", bytes(10_000)])
def test_an_unreadable_record_is_no_success(content: bytes, tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a")
    (run / "run.mcap.part0").write_bytes(content)
    with pytest.raises(RunError):
        recover_run(run)
    assert sorted(p.name for p in run.iterdir()) == ["run.json", "run.mcap.part0"]
    assert json.loads((run / "run.json").read_text())["status"] == "running"
    (run / "run.mcap.part0").rename(run / "run.mcap")
    with pytest.raises(RunError):
        recover_run(run)
    (run / "run.mcap").unlink()
    with pytest.raises(RunError, match="nothing was written"):
        recover_run(run)


def test_a_running_run_is_refused(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 100))
    with create.lock_run(run), pytest.raises(create.BusyError, match="still being written"):
        recover_run(run)
    me = {"pid": os.getpid(), "pid_started": module_process.start_ticks(os.getpid())}
    other = left_behind(tmp_path / "b", (0, 100), **me)
    with pytest.raises(create.BusyError, match=f"process {os.getpid()}"):
        recover_run(other)
    assert not (run / "run.mcap").exists()
    assert not (other / "run.mcap").exists()
    assert recover_run(run).written  # the lock ended with its holder


def test_an_existing_output_is_not_overwritten(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 400))
    for content in (files.write(tmp_path / "o.mcap", rows(100)).read_bytes(), b"something else"):
        target = tmp_path / "out.mcap"
        target.write_bytes(content)
        with pytest.raises(RunError, match=r"out\.mcap"):
            recover_run(run, target)
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
        recover_run(run)
    monkeypatch.undo()
    assert sorted(p.name for p in run.iterdir()) == ["run.json", "run.mcap.part0"]
    assert recover_run(run).account.rows == 5000


def test_a_killed_recovery_can_be_repeated(tmp_path: Path) -> None:
    run = left_behind(tmp_path / "a", (0, 60_000))
    code = (
        "import sys; from pathlib import Path; from datetime import datetime, UTC\n"
        "from rig.recording.runs.recover import recover\n"
        "print('go', flush=True); recover(Path(sys.argv[1]), None, datetime.now(UTC))\n"
    )
    chance, unfinished = random.Random(11), 0
    for longest in (0.0, *[0.6] * 5):  # s; at once, or a quick host would end each one in time
        with subprocess.Popen(
            [sys.executable, "-c", code, str(run)], stdout=subprocess.PIPE
        ) as child:
            assert child.stdout is not None
            child.stdout.readline()
            time.sleep(chance.uniform(0.0, longest))
            child.kill()
        unfinished += not (run / "run.mcap").exists()
        if (run / "run.mcap").exists():
            assert messages(run / "run.mcap") == 60_000
    assert unfinished > 0
    assert recover_run(run).account.rows == 60_000
    assert not list(run.glob("*.joining"))
