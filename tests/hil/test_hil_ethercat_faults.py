"""Faults of an EtherCAT segment on the real stacks: reason, category, time to the safe state.

By default only the rows marked `short` are run; with FAULTS=all in the environment, all rows.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from hil_processes import assert_executed, in_execution

from benchmarks.support.emulated_wavebot import (
    emulated_wavebot,
    write_ethercat_rig_file,
)
from benchmarks.support.fault_rigs import RIGS
from rig.emulation.cable import cable_problem
from rig.execution.emulated_rig import EmulatedRig
from rig.execution.fault_runs import available_faults, measure_fault, mismatches
from rig.execution.fault_table import FaultRow, missing_rows

pytest.importorskip("pysoem")
if problem := cable_problem("wectest"):
    pytest.skip(problem, allow_module_level=True)

pytestmark = pytest.mark.realtime

TABLE = RIGS["wavebot_ethercat"].rows()
CHOSEN = TABLE if os.environ.get("FAULTS") == "all" else [row for row in TABLE if row.short]
WHOLE = ("segment", "ethercat", "process ethercat")
"""Devices whose every fault has a row; of the others each sort of fault has one at some slave."""


@pytest.fixture(scope="module")
def segment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedRig]:
    """Start the emulated segment for all tests of this file."""
    with emulated_wavebot(tmp_path_factory.mktemp("ec"), write_ethercat_rig_file) as started:
        yield started


@pytest.mark.sampled
@pytest.mark.parametrize("row", CHOSEN, ids=lambda row: row.name)
def test_the_rig_reacts_to_faults_as_in_the_table(segment: EmulatedRig, row: FaultRow) -> None:
    finding = measure_fault(in_execution(segment, "compiled"), row)
    print(f"{row.name}: {finding.verdict}, {finding.seconds} s")
    assert mismatches(row, finding) == []
    assert_executed(finding.run_result, "compiled")


def test_every_sort_of_fault_has_its_row(segment: EmulatedRig) -> None:
    available = available_faults(segment)
    whole = [row for row in TABLE if row.device in WHOLE]
    assert missing_rows(whole, {name: available[name] for name in WHOLE}) == []
    listed = {row.fault for row in TABLE}
    assert set(available["coupler"]) <= listed, "faults of every slave"
    for row in TABLE:
        assert row.fault in available[row.device], row.name
