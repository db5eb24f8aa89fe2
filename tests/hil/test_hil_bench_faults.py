"""The bench's faults on the real stacks: reason, category, time until the servo has no power.

By default the rows marked `short` are walked; with FAULTS=all in the environment, all of them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from benchmarks.support.bench_fault_walk import BenchStage, bench_stage
from benchmarks.support.fault_rigs import RIGS
from benchmarks.support.fault_table import Row, gaps
from benchmarks.support.fault_walk import there, walk_fairly, wrong

pytestmark = pytest.mark.realtime

TABLE = RIGS["oswec_bench"].rows()
CHOSEN = TABLE if os.environ.get("FAULTS") == "all" else [row for row in TABLE if row.short]


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


def test_every_fault_of_the_bench_has_its_row(on: BenchStage) -> None:
    assert gaps(TABLE, there(on)) == []
