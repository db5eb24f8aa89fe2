"""The bench's faults on the real stacks: reason, category, time until the servo has no power.

By default only the rows marked `short` are run; with FAULTS=all in the environment, all rows. The
drivers are those of the rig, so the tick is compiled alone, never coupled with a plant.
"""

from __future__ import annotations

import os

import pytest
from hil_processes import EXECUTIONS, assert_executed, in_execution

from benchmarks.support.fault_rigs import RIGS
from rig.execution.emulated_rig import EmulatedRig
from rig.execution.fault_runs import available_faults, measure_fault, mismatches
from rig.execution.fault_table import FaultRow, missing_rows

pytestmark = pytest.mark.realtime

TABLE = RIGS["oswec_bench"].rows()
CHOSEN = TABLE if os.environ.get("FAULTS") == "all" else [row for row in TABLE if row.short]


@pytest.mark.sampled
@pytest.mark.parametrize("execution", EXECUTIONS)
@pytest.mark.parametrize("row", CHOSEN, ids=lambda row: row.name)
def test_the_bench_reacts_to_faults_as_in_the_table(
    on_bench: EmulatedRig, row: FaultRow, execution: str
) -> None:
    rig = in_execution(on_bench, execution)
    finding = measure_fault(rig, row)
    print(f"{row.name}: {finding.verdict}, {finding.seconds} s")
    if mismatches(row, finding):  # a loaded host may stop a run: the second run counts
        print(f"  at first {mismatches(row, finding)}")
        finding = measure_fault(rig, row)
        print(f"  then {finding.verdict}, {finding.seconds} s")
    assert mismatches(row, finding) == []
    assert_executed(finding.run_result, execution)


def test_every_fault_of_the_bench_has_its_row(on_bench: EmulatedRig) -> None:
    assert missing_rows(TABLE, available_faults(on_bench)) == []
