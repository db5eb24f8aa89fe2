"""Every row of the table of faults on the real stacks: reason, category, time to the safe state.

By default the rows marked `short` are walked; with FAULTS=all in the environment, all of them.
"""

from __future__ import annotations

import os

import pytest

from benchmarks.support.fault_rigs import RIGS
from benchmarks.support.fault_table import Row, gaps
from benchmarks.support.fault_walk import Finding, there, walk_fairly, wrong
from benchmarks.support.wavebot_fault_walk import Stage
from rig.execution.rehearsal.control_client import ControlError

pytestmark = pytest.mark.realtime

TABLE = RIGS["wavebot"].rows()
CHOSEN = TABLE if os.environ.get("FAULTS") == "all" else [row for row in TABLE if row.short]


@pytest.mark.parametrize("row", CHOSEN, ids=lambda row: row.name)
def test_the_rig_does_what_the_table_says(on: Stage, row: Row) -> None:
    found: Finding = walk_fairly(on, row)
    print(f"{row.name}: {found.verdict}, {found.seconds} s")
    assert wrong(row, found) == []


def test_every_fault_of_every_device_has_its_row(on: Stage) -> None:
    assert gaps(TABLE, there(on)) == []


def test_the_control_port_refuses_by_name(on: Stage) -> None:
    with pytest.raises(ControlError, match="'heave' has no fault 'tired'"):
        on.control.switch("heave", "tired")
    with pytest.raises(ControlError, match="KeyError: 'dance'"):
        on.control.ask("dance")


def test_the_world_can_be_asked(on: Stage) -> None:
    on.control.ask("restart")
    told = on.control.ask("world")
    assert told["currents"].keys() == {"heave", "surge"}
    assert told["nodes"].keys() == {"heave", "surge", "stator"}
    assert told["actuation"]["heave_enable"] == 0
