"""A sweep whose processes are all killed goes on where it was; one that is finished waits for none.

What is killed is the command line in a process group of its own, by SIGKILL to the group; what is
left alone runs in this process.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import xarray
from rehearsing import write_campaign
from rig_command import rig_here

from rig.sweep.journal import NAME

ROWS = [
    {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000 - 100 * i, "ki_n_per_m": 0} for i in range(6)
]
OVER = "sea.amplitude_m=0.08,0.09,0.1,0.11"
CASES = 24
HEAVY = ("matplotlib", "xarray", "pandas", "numba", "filterpy", "scipy", "dask")
SEEN = f"""
import json, sys
from rig.cli import app
try:
    app(sys.argv[1:])
except SystemExit as end:
    assert not end.code, end.code
print(json.dumps(sorted(set({HEAVY!r}) & {{name.split(".")[0] for name in sys.modules}})))
"""


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    return write_campaign(
        tmp_path,
        sea={"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
        tare={"duration_s": 1},
        start={"set_point_s": 1, "lead_in_s": 30},
        timing={"settle_s": 3, "interval_s": 61},
        matrix={"list": ROWS},
    )


def words(campaign: Path, sweeps: Path) -> list[str]:
    options = ("--over", OVER, "--jobs", "1", "--sweeps", str(sweeps), "--json")
    return ["sweep", str(campaign), *options]


def finished(sweeps: Path) -> list[bytes]:
    """The whole lines of the journal."""
    found = list(sweeps.glob(f"*/{NAME}"))
    lines = found[0].read_bytes().splitlines(keepends=True) if found else []
    return [line for line in lines if line.endswith(b"\n")]


def ended(campaign: Path, sweeps: Path) -> dict[str, Any]:
    code, said, error = rig_here(*words(campaign, sweeps))
    assert code == 0, error
    told: dict[str, Any] = json.loads(said)
    return told


def killed(campaign: Path, sweeps: Path, least: int) -> list[bytes]:
    """What a sweep had finished when it was killed, at ``least`` cases or soon after."""
    command = [sys.executable, "-m", "rig", *words(campaign, sweeps)]
    with subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL) as child:
        while len(finished(sweeps)) < least and child.poll() is None:
            time.sleep(0.002)
        os.killpg(child.pid, signal.SIGKILL)
    assert child.returncode == -signal.SIGKILL, "it ended before it was killed"
    return finished(sweeps)


@pytest.mark.slow
def test_kill_minus_nine_costs_no_case_and_changes_no_bit(campaign: Path, tmp_path: Path) -> None:
    sweeps = tmp_path / "killed"
    once = killed(campaign, sweeps, 3)
    assert 3 <= len(once) < CASES
    twice = killed(campaign, sweeps, len(once) + 3)
    assert twice[: len(once)] == once
    assert len(once) + 3 <= len(twice) < CASES
    assert not list(sweeps.glob("*/sweep.nc"))
    told = ended(campaign, sweeps)
    assert told["status"] == "complete"
    assert told["run_now"] == CASES - len(twice)
    lines = finished(sweeps)
    assert lines[: len(twice)] == twice
    assert sorted(json.loads(line)["case"] for line in lines) == list(range(CASES))
    whole = ended(campaign, tmp_path / "undisturbed")
    assert whole["run_now"] == CASES
    with xarray.open_dataset(told["result"]) as one, xarray.open_dataset(whole["result"]) as other:
        xarray.testing.assert_identical(one.load(), other.load())
    assert {told["best"][kind]["power_w"] for kind in told["best"]} == {
        whole["best"][kind]["power_w"] for kind in whole["best"]
    }
    _a_finished_sweep_is_only_told_again(campaign, tmp_path / "undisturbed", whole)


def _a_finished_sweep_is_only_told_again(
    campaign: Path, sweeps: Path, whole: dict[str, Any]
) -> None:
    """Nothing heavy is imported, nothing is written; what was removed is made again."""
    files = [Path(name) for name in (whole["result"], *whole["pictures"])]
    assert len(files) == 3
    stood = [path.stat().st_mtime_ns for path in files]
    command = [sys.executable, "-c", SEEN, *words(campaign, sweeps)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    said, imported = (json.loads(line) for line in done.stdout.splitlines())
    assert imported == []
    assert said["run_now"] == 0
    for key in ("status", "result", "pictures", "rows", "best", "failed", "folder"):
        assert said[key] == whole[key]
    assert [path.stat().st_mtime_ns for path in files] == stood
    files[-1].unlink()
    assert ended(campaign, sweeps)["run_now"] == 0
    assert files[-1].exists()
