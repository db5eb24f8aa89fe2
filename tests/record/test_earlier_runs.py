"""Run folders recorded before keys, names and texts changed: they open, show, plot and replay.

The folders in ``runs_of_2026_11`` are those of a campaign and of a bench session, as the rig wrote
them in November 2026 (without pictures and tables).
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from rig_command import rig_here

from rig.execution.replay import replay
from rig.recording.runs import open_run, run_info

FOLDER = Path(__file__).resolve().parent / "runs_of_2026_11"
CAMPAIGN, SESSION = "20261123T182201Z_golden_cots", "20261123T182438Z_golden_bench_torque"
TICKS = {CAMPAIGN: 1720, SESSION: 3520}


@pytest.fixture(params=[CAMPAIGN, SESSION])
def run_folder(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A copy of a run folder, with nothing else beside it."""
    return Path(shutil.copytree(FOLDER / request.param, tmp_path / "runs" / request.param))


def test_opens_with_its_execution_mode(run_folder: Path) -> None:
    run = open_run(run_folder)
    assert np.array_equal(run["tick"].values, np.arange(TICKS[run_folder.name]))
    assert run.attrs["mode"] == "rehearsal"
    assert run.attrs["status"] == "complete"


def test_its_sea_has_the_key_of_today() -> None:
    recorded = json.loads((FOLDER / CAMPAIGN / "plan.json").read_text())
    plan = run_info(FOLDER / CAMPAIGN).plan
    assert plan["requested_sea"] == recorded["asked_sea"]
    assert "asked_sea" not in plan


def test_is_listed(run_folder: Path) -> None:
    code, printed, _ = rig_here("runs", "--json", "--runs", run_folder.parent)
    assert code == 0
    (listed,) = json.loads(printed)
    assert (listed["run"], listed["mode"]) == (run_folder.name, "rehearsal")
    assert listed["problem"] == ""


def test_shows(run_folder: Path) -> None:
    code, printed, errors = rig_here("show", run_folder, "--json")
    assert code == 0, errors
    assert run_folder.name in printed


def test_replays_bit_by_bit(run_folder: Path) -> None:
    report = replay(run_folder)
    assert report.identical
    assert report.ticks == TICKS[run_folder.name]


def test_the_campaign_is_plotted(tmp_path: Path) -> None:
    folder = shutil.copytree(FOLDER / CAMPAIGN, tmp_path / CAMPAIGN)
    code, _, errors = rig_here("plot", folder)
    assert code == 0, errors
    assert {"rows.csv", "summary.png", "surfaces.png"} <= {path.name for path in folder.iterdir()}
