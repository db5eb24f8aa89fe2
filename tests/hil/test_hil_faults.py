"""Every row of the table of faults on the real stacks: reason, category, time to the safe state.

By default the rows marked `short` are walked; with FAULTS=all in the environment, all of them.
"""

from __future__ import annotations

import os

import pytest

from benchmarks.support.fault_table import UNDETECTED, Row, rows
from benchmarks.support.fault_walk import Finding, Stage, walk_fairly, wrong
from rig.rehearsal.control_client import ControlError

pytestmark = pytest.mark.realtime

TABLE = rows()
CHOSEN = TABLE if os.environ.get("FAULTS") == "all" else [row for row in TABLE if row.short]


@pytest.mark.parametrize("row", CHOSEN, ids=lambda row: row.name)
def test_the_rig_does_what_the_table_says(on: Stage, row: Row) -> None:
    found: Finding = walk_fairly(on, row)
    print(f"{row.name}: {found.verdict}, {found.seconds} s")
    assert wrong(row, found) == []


def test_every_fault_of_every_device_has_its_row(on: Stage) -> None:
    listed = on.control.ask("faults")["faults"]
    there = {(device, fault) for device, several in listed.items() for fault in several}
    have = {(row.device, row.fault) for row in TABLE}
    assert there - have == set()
    assert have - there == set()


def test_no_row_is_there_twice() -> None:
    names = [row.name for row in TABLE]
    assert len(names) == len(set(names))
    assert 6 <= sum(row.short for row in TABLE) <= 10
    assert all(row.why for row in TABLE if row.must == UNDETECTED)


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
