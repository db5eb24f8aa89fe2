"""Every row of the table of faults on the real stacks: reason, category, time to the safe state.

By default only the rows marked `short` are run; with FAULTS=all in the environment, all rows. The
drivers are those of the rig, so the tick is compiled alone, never coupled with a plant.
"""

from __future__ import annotations

import os

import pytest
from hil_processes import EXECUTIONS, assert_executed, in_execution

from benchmarks.support.fault_rigs import RIGS
from rig.emulation.control_client import ControlError
from rig.execution.emulated_rig import EmulatedRig
from rig.execution.fault_runs import Finding, available_faults, measure_fault, mismatches
from rig.execution.fault_table import FaultRow, missing_rows

pytestmark = pytest.mark.realtime

TABLE = RIGS["wavebot"].rows()
CHOSEN = TABLE if os.environ.get("FAULTS") == "all" else [row for row in TABLE if row.short]


@pytest.mark.sampled
@pytest.mark.parametrize("execution", EXECUTIONS)
@pytest.mark.parametrize("row", CHOSEN, ids=lambda row: row.name)
def test_the_rig_reacts_to_faults_as_in_the_table(
    on: EmulatedRig, row: FaultRow, execution: str
) -> None:
    finding: Finding = measure_fault(in_execution(on, execution), row)
    print(f"{row.name}: {finding.verdict}, {finding.seconds} s")
    assert mismatches(row, finding) == []
    assert_executed(finding.run_result, execution)


def test_every_fault_of_every_device_has_its_row(on: EmulatedRig) -> None:
    assert missing_rows(TABLE, available_faults(on)) == []


def test_the_control_port_refuses_by_name(on: EmulatedRig) -> None:
    with pytest.raises(ControlError, match="'heave' has no fault 'tired'"):
        on.control.switch("heave", "tired")
    with pytest.raises(ControlError, match="KeyError: 'dance'"):
        on.control.request("dance")


def test_the_control_port_reports_the_world(on: EmulatedRig) -> None:
    on.control.request("restart")
    world = on.control.request("world")
    assert world["currents"].keys() == {"heave", "surge"}
    assert world["nodes"].keys() == {"heave", "surge", "stator"}
    assert world["actuation"]["heave_enable"] == 0
