"""Runs with drives that work on SYNC0, on the real clock: OP, a run, a loss, refusals by name."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from benchmarks.support.campaigns import SilentView, write_yaml
from benchmarks.support.emulated_wavebot import (
    emulated_wavebot,
    write_ethercat_rig_file,
)
from rig.emulation.cable import cable_problem
from rig.execution.emulated_rig import EmulatedRig
from rig.execution.fault_runs import measure_fault, run_when_free
from rig.execution.fault_table import REFUSED, START, FaultRow

pytest.importorskip("pysoem")
if problem := cable_problem("wectest"):
    pytest.skip(problem, allow_module_level=True)

pytestmark = [pytest.mark.realtime, pytest.mark.long(group="SYNC0")]
# A missed SYNC0 adds 3, and loop and emulation share a host that stands still for 40 ms.
PATIENT = {"object": 0x10F1, "sub": 2, "type": "u16", "value": 300}
REST = (
    ("stator", "position_drive"), ("coupler", "coupler"), ("inputs", "digital_input"),
    ("outputs", "digital_output"), ("slew", "analog_input"), ("stator_a", "analog_input"),
    ("stator_b", "analog_input"), ("probe_1", "analog_input"), ("probe_2", "analog_input"),
    ("probe_3", "analog_input"),
)  # fmt: skip


def write_rig(folder: Path, *objects: dict[str, Any], interface: str = "wes") -> Path:
    """Write a rig whose torque drives work with SYNC0 only; ``objects``: more ones of heave."""
    base = write_ethercat_rig_file(folder).rename(folder / "base.yaml")
    write_yaml(folder / "sync0_drive.yaml", {"extends": "torque_drive", "sync0": True})
    line: list[dict[str, Any]] = [
        {"name": "heave", "device": "sync0_drive.yaml", "objects": [PATIENT, *objects]},
        {"name": "surge", "device": "sync0_drive.yaml", "objects": [PATIENT]},
        *({"name": name, "device": device} for name, device in REST),
    ]
    segment = {"clock": "distributed", "interface": f"{interface}{os.getpid()}", "line": line}
    rig = {"extends": str(base), "wiring": {"ethercat": segment}}
    return write_yaml(folder / "rig.yaml", rig)


@pytest.fixture(scope="module")
def segment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedRig]:
    """Start the emulated segment for all tests of this file."""
    with emulated_wavebot(tmp_path_factory.mktemp("sync0"), write_rig) as started:
        yield started


def lost_sync0(expected: str, onset: str = "") -> FaultRow:
    return FaultRow(
        "heave", "sync0_lost", expected, None, 0.0, "", None, None, onset, False, False, ()
    )


def test_drives_on_sync0_run_to_the_end(segment: EmulatedRig) -> None:
    segment.control.request("restart")
    result = run_when_free(lambda: segment.run(SilentView()))
    assert result.outcome.status == "complete", result.outcome
    report = json.loads((Path(result.folder) / "wires.json").read_text())
    offsets = sorted(abs(row[1]) for row in report["clock"]["rows"])
    assert offsets[len(offsets) // 2] < 200_000  # ns; half of the cycle is left to SYNC0


def test_a_drive_without_its_sync0_loses_the_segment(segment: EmulatedRig) -> None:
    """It takes the commands of its frames with SYNC0 only, so its power goes within some cycles."""
    finding = measure_fault(segment, lost_sync0("FIELDBUS_LOST"))
    assert finding.verdict == "FIELDBUS_LOST", finding
    assert finding.seconds is not None
    assert finding.seconds < 0.1
    print(finding.message)
    assert "heave left OP: is in SAFE_OPERATIONAL, AL status code 0x002c" in finding.message


def test_a_drive_that_gets_no_sync0_refuses_op_and_the_run_by_name(
    segment: EmulatedRig,
) -> None:
    finding = measure_fault(segment, lost_sync0(REFUSED, START))
    assert finding.verdict == REFUSED, finding
    assert "heave refuses OP: AL status code 0x002d, " in finding.message


def test_a_drive_with_another_cycle_is_refused_before_op(tmp_path: Path) -> None:
    cycle = {"object": 0x1C32, "sub": 2, "type": "u32", "value": 2_000_000}

    def write(folder: Path) -> Path:
        return write_rig(folder, cycle, interface="wet")

    with emulated_wavebot(tmp_path, write) as started:
        result = run_when_free(lambda: started.run(SilentView()))
    assert result.outcome.status == "refused"
    text = "heave: 0x1C32:02 is 2000000 ns; SYNC0 comes with each tick of the rig, 1000000 ns"
    assert text in str(result.outcome)
