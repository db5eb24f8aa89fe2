"""`rig faults`: the command on the emulated WaveBot, its file, and what it refuses."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_here import rig

from benchmarks.support.campaigns import write_yaml
from benchmarks.support.emulated_wavebot import write_campaign_file
from benchmarks.support.live_run import wait_until
from rig.analysis.rehearsed_faults import find_rehearsed_faults
from rig.recording.runs import list_runs, run_info
from rig.recording.runs.folder import FAULTS

pytestmark = pytest.mark.realtime

RIGHT = {"fault": "drive_fault", "must": "DRIVE_FAULT", "category": 0, "within_s": 0.2}
WRONG = {"fault": "silent", "must": "BUS_OVERVOLTAGE", "category": 0, "within_s": 0.4}
REFUSED = {"fault": "silent", "from": "start", "must": "refused at start"}


def write_table(folder: Path, *heave: dict[str, object]) -> Path:
    task = write_campaign_file(folder)
    return write_yaml(folder / "table.yaml", {"task": str(task), "faults": {"heave": [*heave]}})


def test_reactions_are_compared_and_kept(tmp_path: Path) -> None:
    """Each fault has a run; the file names its reaction, and is found for the rig."""
    table, runs = write_table(tmp_path, RIGHT, WRONG, REFUSED), tmp_path / "runs"
    done = rig("faults", table, "--runs", runs, "--json")
    assert done.returncode == 1, done.stderr
    result = json.loads(done.stdout)
    assert result["status"] == "failed"
    assert [each["as_required"] for each in result["faults"]] == [True, False, True]
    reactions = [each["reaction"] for each in result["faults"]]
    assert reactions == ["DRIVE_FAULT", "STALE_ENCODER", "refused at start"]
    assert result["faults"][1]["differences"] == result["faults"][1]["first_try"]
    assert "heave: encoder_wrapped" in result["without_row"]
    folder = Path(result["folder"])
    for fault in result["faults"][:2]:
        info = run_info(folder / fault["run"])
        assert (info.status["reason"], info.mode) == (fault["reaction"], "hil")
    assert json.loads((folder / FAULTS).read_text())["faults"] == result["faults"]
    config = run_info(folder / result["faults"][0]["run"]).config
    found = find_rehearsed_faults(runs, config)
    assert found is not None
    assert "1 NOT AS REQUIRED: heave: silent" in found.text()
    assert found.differences == ()
    assert list_runs(runs) == []  # runs with a fault are none of the campaign's


def test_ctrl_c_keeps_the_faults_before_it(tmp_path: Path) -> None:
    table, runs = write_table(tmp_path, RIGHT, REFUSED, {**REFUSED, "fault": "pdo_lost"}), tmp_path
    command = [sys.executable, "-m", "rig", "faults", str(table), "--runs", str(runs)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    def rehearsed() -> bool:
        return any(
            json.loads(path.read_text())["faults"] for path in runs.glob(f"*_faults_table/{FAULTS}")
        )

    wait_until(rehearsed, "a rehearsed fault")
    time.sleep(0.5)  # in the run of the next one
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=60.0)
    assert process.returncode == 3, output
    assert "Ctrl-C left" in output
    assert "1/3  heave: drive_fault: DRIVE_FAULT" in output


def test_a_table_whose_faults_the_devices_lack_is_refused(tmp_path: Path) -> None:
    table = write_table(tmp_path, RIGHT, {**RIGHT, "fault": "sleepy"})
    done = rig("faults", table, "--runs", tmp_path / "runs")
    assert done.returncode == 2
    assert "faults.heave[1].fault: sleepy is no fault of heave; allowed" in done.stderr
    assert not (tmp_path / "runs").exists()


def test_a_table_with_an_odd_value_is_refused(tmp_path: Path) -> None:
    table = write_table(tmp_path, RIGHT, {**RIGHT, "fault": "tpdo_delay", "value": -3})
    done = rig("faults", table, "--runs", tmp_path / "runs")
    assert done.returncode == 2
    assert "faults.heave[1].value: -3 is out of range; allowed 0 .. 60 s" in done.stderr
    assert not (tmp_path / "runs").exists()


def test_a_rig_without_wiring_has_no_devices(tmp_path: Path) -> None:
    done = rig("faults", "wavebot", "--rig", "wavebot", "--runs", tmp_path / "runs")
    assert done.returncode == 2
    assert "has no wiring" in done.stderr
    assert not (tmp_path / "runs").exists()
