"""A killed sweep resumes; a finished one is reported from its cache.

The killed sweep is the command line in its own process group, ended by SIGKILL to the group; the
undisturbed sweep runs in this process.
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

from rig.sweeps.result_cache import JOURNAL_FILE

ROWS = [
    {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000 - 100 * i, "ki_n_per_m": 0} for i in range(6)
]
OVER = "sea.amplitude_m=0.08,0.09,0.1,0.11"
CASES = 24
HEAVY = ("matplotlib", "xarray", "pandas", "numba", "filterpy", "scipy", "dask")
PRINT_IMPORTS = f"""
import json, sys
from rig.cli.app import app
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


def arguments(campaign: Path, sweeps: Path) -> list[str]:
    options = ("--over", OVER, "--jobs", "1", "--sweeps", str(sweeps), "--json")
    return ["sweep", str(campaign), *options]


def journal_lines(sweeps: Path) -> list[bytes]:
    """Return the complete lines of the journal."""
    found = list(sweeps.glob(f"*/{JOURNAL_FILE}"))
    lines = found[0].read_bytes().splitlines(keepends=True) if found else []
    return [line for line in lines if line.endswith(b"\n")]


def run_sweep(campaign: Path, sweeps: Path) -> dict[str, Any]:
    code, out, error = rig_here(*arguments(campaign, sweeps))
    assert code == 0, error
    report: dict[str, Any] = json.loads(out)
    return report


def kill_sweep(campaign: Path, sweeps: Path, least: int) -> list[bytes]:
    """Kill a sweep after at least ``least`` cases; return the lines of its journal."""
    command = [sys.executable, "-m", "rig", *arguments(campaign, sweeps)]
    with subprocess.Popen(command, process_group=0, stdout=subprocess.DEVNULL) as child:
        while len(journal_lines(sweeps)) < least and child.poll() is None:
            time.sleep(0.002)
        os.killpg(child.pid, signal.SIGKILL)
    assert child.returncode == -signal.SIGKILL, "the sweep ended before it was killed"
    return journal_lines(sweeps)


@pytest.mark.slow
@pytest.mark.long
def test_sigkill_loses_no_case_and_changes_no_bit(campaign: Path, tmp_path: Path) -> None:
    sweeps = tmp_path / "killed"
    after_first_kill = kill_sweep(campaign, sweeps, 3)
    assert 3 <= len(after_first_kill) < CASES
    after_second_kill = kill_sweep(campaign, sweeps, len(after_first_kill) + 3)
    assert after_second_kill[: len(after_first_kill)] == after_first_kill
    assert len(after_first_kill) + 3 <= len(after_second_kill) < CASES
    assert not list(sweeps.glob("*/sweep.nc"))
    report = run_sweep(campaign, sweeps)
    assert report["status"] == "complete"
    assert report["run_now"] == CASES - len(after_second_kill)
    lines = journal_lines(sweeps)
    assert lines[: len(after_second_kill)] == after_second_kill
    assert sorted(json.loads(line)["case"] for line in lines) == list(range(CASES))
    undisturbed = run_sweep(campaign, tmp_path / "undisturbed")
    assert undisturbed["run_now"] == CASES
    with (
        xarray.open_dataset(report["result"]) as first,
        xarray.open_dataset(undisturbed["result"]) as second,
    ):
        xarray.testing.assert_identical(first.load(), second.load())
    assert {report["best"][kind]["power_w"] for kind in report["best"]} == {
        undisturbed["best"][kind]["power_w"] for kind in undisturbed["best"]
    }
    _check_finished_sweep_is_reported_from_cache(campaign, tmp_path / "undisturbed", undisturbed)


def _check_finished_sweep_is_reported_from_cache(
    campaign: Path, sweeps: Path, undisturbed: dict[str, Any]
) -> None:
    """Nothing heavy is imported and nothing written; a removed file is made again."""
    files = [Path(name) for name in (undisturbed["result"], *undisturbed["pictures"])]
    assert len(files) == 3
    modified = [path.stat().st_mtime_ns for path in files]
    command = [sys.executable, "-c", PRINT_IMPORTS, *arguments(campaign, sweeps)]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    out, imported = (json.loads(line) for line in process.stdout.splitlines())
    assert imported == []
    assert out["run_now"] == 0
    for key in ("status", "result", "pictures", "rows", "best", "failed", "folder"):
        assert out[key] == undisturbed[key]
    assert [path.stat().st_mtime_ns for path in files] == modified
    files[-1].unlink()
    assert run_sweep(campaign, sweeps)["run_now"] == 0
    assert files[-1].exists()
