"""The bench's faults on the real stacks: reason, category, time until the servo has no power.

By default the rows marked `short` are walked; with FAULTS=all in the environment, all of them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from benchmarks.support.bench_fault_walk import TABLE, BenchStage, bench_stage
from benchmarks.support.fault_table import UNDETECTED, Row, rows
from benchmarks.support.fault_walk import walk_fairly, wrong

pytestmark = pytest.mark.realtime

ALL = rows(TABLE)
CHOSEN = ALL if os.environ.get("FAULTS") == "all" else [row for row in ALL if row.short]


@pytest.fixture(scope="module")
def on(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BenchStage]:
    with bench_stage(tmp_path_factory.mktemp("bench_faults")) as made:
        yield made


@pytest.mark.parametrize("row", CHOSEN, ids=lambda row: row.name)
def test_the_bench_does_what_the_table_says(on: BenchStage, row: Row) -> None:
    found = walk_fairly(on, row)
    print(f"{row.name}: {found.verdict}, {found.seconds} s")
    if wrong(row, found):  # a loaded host stops a run for its own reasons: the second time counts
        print(f"  at first {wrong(row, found)}")
        found = walk_fairly(on, row)
        print(f"  then {found.verdict}, {found.seconds} s")
    assert wrong(row, found) == []


def test_every_fault_of_the_table_is_one_of_a_device(on: BenchStage) -> None:
    listed = on.control.ask("faults")["faults"]
    there = {(device, fault) for device, several in listed.items() for fault in several}
    assert {(row.device, row.fault) for row in ALL} - there == set()


def test_the_table_is_whole() -> None:
    names = [row.name for row in ALL]
    assert len(names) == len(set(names))
    assert 6 <= sum(row.short for row in ALL) <= 10
    assert all(row.why for row in ALL if row.must == UNDETECTED)
