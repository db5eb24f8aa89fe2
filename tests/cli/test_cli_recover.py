"""`rig recover` on a run whose supervisor was killed, and on unreadable runs."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from command_here import CompletedCommand, rig
from made_once import made_once
from mcap.reader import make_reader
from rehearsing import write_yaml
from rig_command import rig as process

from benchmarks.support.live_run import LOGGER, LOOP, is_running, live_run, wait_until
from benchmarks.support.recorded import write_campaign_file


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run whose supervisor was killed after some rows."""
    (run,) = (made_once(tmp_path_factory, "killed", killed_run) / "runs").glob("*/")
    return run


def killed_run(folder: Path) -> None:
    """Kill the supervisor of a run; `rig recover` refuses the run while the loop stops."""
    rows = {"extends": str(write_campaign_file(folder, 2000.0)),
            "timing": {"settle_s": 1, "interval_s": 4}}  # fmt: skip
    path = write_yaml(folder / "killed.yaml", rows)
    with live_run(path, folder / "runs", real_clock=False) as run:
        run.wait_started()
        processes = run.pid(LOOP), run.pid(LOGGER)
        logger = processes[1]
        wait_until(lambda: run.ring.tail > 18_000, "two rows of the matrix on the disk")
        run.process.kill()
        run.process.wait()
        os.kill(logger, signal.SIGSTOP)  # before it has written all rows
        refused = process("recover", run.folder, "--json")
        assert refused.returncode == 1
        assert "still being written" in json.loads(refused.stdout)["message"]
        os.kill(logger, signal.SIGCONT)
        wait_until(lambda: not any(map(is_running, processes)), "the end of loop and logger")


@pytest.fixture
def run(killed: Path, tmp_path: Path) -> Path:
    """A copy of the killed run."""
    return Path(shutil.copytree(killed, tmp_path / "runs" / killed.name))


def json_of(done: CompletedCommand) -> dict[str, Any]:
    assert done.stderr == ""
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def test_a_recovered_run_is_complete_and_usable(run: Path) -> None:
    runs = run.parent
    assert "abandoned" in rig("runs", "--runs", runs).stdout
    part = (run / "run.mcap.part0").read_bytes()
    done = rig("recover", "last", "--runs", runs)
    assert done.returncode == 0, done.stderr
    assert "missing   nothing" in done.stdout
    assert (run / "run.mcap.part0").read_bytes() == part
    report = json_of(rig("recover", run, "--json"))
    assert (report["status"], report["written"], report["lost"]) == ("whole", False, 0)
    assert report["ending"] == "fault: SUPERVISOR_LOST"
    states = [row["state"] for row in report["campaign_rows"]]
    assert states[:2] == ["complete", "complete"]
    assert states.count("cut short") <= 1
    with (run / "run.mcap").open("rb") as file:
        count = sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())
    assert count == report["rows_saved"] == report["last_tick"] + 1
    shown = rig("show", run)
    assert shown.returncode == 0
    assert "stopped sending its heartbeat" in shown.stdout
    assert rig("plot", run).returncode == 0
    assert (run / "surfaces.png").exists()
    (listed,) = json.loads(rig("runs", "--runs", runs, "--json").stdout)
    assert (listed["status"], listed["problem"]) == ("fault", "")
    assert listed["rows_done"] == states.count("complete")


def tear(run: Path) -> None:
    """Cut the file in the middle of a chunk, as if the logger had been killed, too."""
    part = run / "run.mcap.part0"
    with part.open("r+b") as file:
        file.truncate(part.stat().st_size // 2)


def test_the_lost_ticks_of_a_torn_end_are_exact(run: Path) -> None:
    """The loop survived, and recorded its last tick."""
    tear(run)
    report = json_of(rig("recover", run, "--json"))
    (gap,) = report["missing_ticks"]
    assert gap == [report["last_tick"] + 1, report["last_tick_known"]]
    assert report["lost"] == gap[1] - gap[0] + 1
    assert (report["end_seen_by"], report["lost_at_least"]) == ("the loop", False)
    assert report["ending"] == "fault: SUPERVISOR_LOST"
    assert f"in all {report['lost']} (end recorded by the loop" in rig("recover", run).stdout


def test_the_lost_ticks_without_a_recorded_end_are_a_lower_bound(run: Path) -> None:
    """All processes were killed: the count reaches to the supervisor's last note."""
    tear(run)
    (run / "progress.json").write_text('{"last_tick": 30000, "skipped": 0}')
    done = rig("recover", run, "--json")
    assert done.returncode == 5
    report = json_of(done)
    (gap,) = report["missing_ticks"]
    assert gap == [report["last_tick"] + 1, 30_000]
    assert report["lost"] == gap[1] - gap[0] + 1
    assert (report["end_seen_by"], report["lost_at_least"]) == (None, True)
    assert report["ending"] == "crashed: its processes were killed"
    text = rig("recover", run)
    assert text.returncode == 5
    assert f"ticks {gap[0]} to {gap[1]}: {report['lost']} lost" in text.stdout
    assert "torn bytes" in text.stdout
    assert f"in all at least {report['lost']} rows" in text.stdout
    assert "no process recorded what the loop did after tick 30000" in text.stdout
    assert rig("show", run).returncode == 0


def test_an_unreadable_record_is_bad_input(run: Path) -> None:
    for content in (b"", b"rubbish" * 100):
        (run / "run.mcap.part0").write_bytes(content)
        done = rig("recover", run)
        assert (done.returncode, done.stdout) == (2, "")
        assert "run.mcap.part0" in done.stderr
        assert "Traceback" not in done.stderr
    assert not (run / "run.mcap").exists()
    (run / "run.mcap.part0").unlink()
    assert "nothing was written" in rig("recover", run).stderr
    assert rig("recover", run.parent / "none", "--runs", run.parent).returncode == 2


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 1 MB; skips the test where the user may not mount it."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("a small file system cannot be mounted here (needs root)")
    yield place
    for _ in range(50):
        if subprocess.run(["umount", str(place)], capture_output=True, check=False).returncode == 0:
            return
        time.sleep(0.1)


def test_a_full_disk_is_an_error_that_names_output(run: Path, small_disk: Path) -> None:
    full = rig("recover", run, "--output", small_disk / "out.mcap")
    assert full.returncode == 1
    assert "No space left on device" in full.stderr
    assert "--output" in full.stderr
    assert list(small_disk.iterdir()) == []
    before = sorted(run.iterdir())
    done = rig("recover", run, "--output", run.parent / "out.mcap", "--json")
    assert done.returncode == 0
    assert json_of(done)["output"] == str(run.parent / "out.mcap")
    assert sorted(run.iterdir()) == before


def test_help_lists_the_exit_codes() -> None:
    text = " ".join(rig("recover", "--help").stdout.replace("\n", " ").split())
    for code in ("0 the record is finished", "5 it is finished, but ticks are lost", "1 not done"):
        assert code in text
