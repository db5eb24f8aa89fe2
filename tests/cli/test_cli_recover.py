"""`rig recover` as a person calls it: on a run whose supervisor was killed, and on bad ones."""

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
from command_here import Done, rig
from made_once import made_once
from mcap.reader import make_reader
from rehearsing import yaml_file
from rig_command import rig as process

from benchmarks.support.live import LOGGER, LOOP, live_run, running, wait_until
from benchmarks.support.recorded import campaign_file


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run whose supervisor was killed after some rows."""
    (run,) = (made_once(tmp_path_factory, "killed", killed_run) / "runs").glob("*/")
    return run


def killed_run(folder: Path) -> None:
    """It is refused while the loop stops."""
    rows = {"extends": str(campaign_file(folder, 2000.0)),
            "timing": {"settle_s": 1, "interval_s": 4}}  # fmt: skip
    path = yaml_file(folder / "killed.yaml", rows)
    with live_run(path, folder / "runs", real_clock=False) as run:
        run.wait_started()
        both = [run.pid(LOOP), run.pid(LOGGER)]
        wait_until(lambda: run.ring.tail > 18_000, "two rows of the matrix on the disk")
        run.process.kill()
        run.process.wait()
        os.kill(both[1], signal.SIGSTOP)  # it has more to write
        refused = process("recover", run.folder, "--json")
        assert refused.returncode == 1
        assert "still being written" in json.loads(refused.stdout)["message"]
        os.kill(both[1], signal.SIGCONT)
        wait_until(lambda: not any(map(running, both)), "the end of loop and logger")


@pytest.fixture
def run(killed: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(killed, tmp_path / "runs" / killed.name))


def said(done: Done) -> dict[str, Any]:
    assert done.stderr == ""
    told: dict[str, Any] = json.loads(done.stdout)
    return told


def test_a_killed_run_is_whole_again_and_of_use(run: Path) -> None:
    runs = run.parent
    assert "abandoned" in rig("runs", "--runs", runs).stdout
    part = (run / "run.mcap.part0").read_bytes()
    done = rig("recover", "last", "--runs", runs)
    assert done.returncode == 0, done.stderr
    assert "missing   nothing" in done.stdout
    assert (run / "run.mcap.part0").read_bytes() == part
    told = said(rig("recover", run, "--json"))
    assert (told["status"], told["written"], told["lost"]) == ("whole", False, 0)
    assert told["ending"] == "fault: SUPERVISOR_LOST"
    states = [row["state"] for row in told["campaign_rows"]]
    assert states[:2] == ["complete", "complete"]
    assert states.count("cut short") <= 1
    with (run / "run.mcap").open("rb") as file:
        count = sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())
    assert count == told["rows_saved"] == told["last_tick"] + 1
    shown = rig("show", run)
    assert shown.returncode == 0
    assert "gave no sign of life" in shown.stdout
    assert rig("plot", run).returncode == 0
    assert (run / "surfaces.png").exists()
    (listed,) = json.loads(rig("runs", "--runs", runs, "--json").stdout)
    assert (listed["status"], listed["problem"]) == ("fault", "")
    assert listed["rows_done"] == states.count("complete")


def tear(run: Path) -> None:
    """As if the logger had been killed too: its file ends in the middle of a chunk."""
    part = run / "run.mcap.part0"
    with part.open("r+b") as file:
        file.truncate(part.stat().st_size // 2)


def test_a_torn_end_is_lost_rows_to_the_tick(run: Path) -> None:
    """The loop was left alone, and wrote down what it had done."""
    tear(run)
    told = said(rig("recover", run, "--json"))
    (gap,) = told["missing_ticks"]
    assert gap == [told["last_tick"] + 1, told["last_tick_known"]]
    assert told["lost"] == gap[1] - gap[0] + 1
    assert (told["end_seen_by"], told["lost_at_least"]) == ("the loop", False)
    assert told["ending"] == "fault: SUPERVISOR_LOST"
    assert f"in all {told['lost']} (end seen by the loop" in rig("recover", run).stdout


def test_a_torn_end_that_nobody_saw(run: Path) -> None:
    """All were killed: up to what the supervisor last noted, and at least so many."""
    tear(run)
    (run / "progress.json").write_text('{"last_tick": 30000, "skipped": 0}')
    done = rig("recover", run, "--json")
    assert done.returncode == 5
    told = said(done)
    (gap,) = told["missing_ticks"]
    assert gap == [told["last_tick"] + 1, 30_000]
    assert told["lost"] == gap[1] - gap[0] + 1
    assert (told["end_seen_by"], told["lost_at_least"]) == (None, True)
    assert told["ending"] == "crashed: its processes were killed"
    text = rig("recover", run)
    assert text.returncode == 5
    assert f"ticks {gap[0]} to {gap[1]}: {told['lost']} lost" in text.stdout
    assert "torn bytes" in text.stdout
    assert f"in all at least {told['lost']} rows" in text.stdout
    assert "nobody lived to write down" in text.stdout
    assert rig("show", run).returncode == 0


def test_what_cannot_be_read_is_bad_input(run: Path) -> None:
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
    """A file system of 1 MB; skipped where it may not be mounted."""
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


def test_a_full_disk_is_said_and_another_one_serves(run: Path, small_disk: Path) -> None:
    full = rig("recover", run, "--output", small_disk / "out.mcap")
    assert full.returncode == 1
    assert "No space left on device" in full.stderr
    assert "--output" in full.stderr
    assert list(small_disk.iterdir()) == []
    before = sorted(run.iterdir())
    done = rig("recover", run, "--output", run.parent / "out.mcap", "--json")
    assert done.returncode == 0
    assert said(done)["output"] == str(run.parent / "out.mcap")
    assert sorted(run.iterdir()) == before


def test_help_tells_the_exit_codes() -> None:
    text = " ".join(rig("recover", "--help").stdout.replace("\n", " ").split())
    for words in ("0 the record is finished", "5 it is finished, but ticks are lost", "1 not done"):
        assert words in text
