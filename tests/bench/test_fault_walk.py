"""Walking the table of faults row by row: what is there is kept, what is missing is walked."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from benchmarks import faults
from benchmarks.support.fault_table import UNDETECTED, Row, rows
from benchmarks.support.fault_walk import NO_RUN, Finding

Walk = Callable[[Row], Finding]
SIX = rows()[:6]
NAMES = [row.name for row in SIX]


def found(verdict: str, seconds: float | None = None, category: int | None = None) -> Finding:
    ended: Any = None
    return Finding(verdict, "", category, seconds, 0, ended)


def as_due(row: Row) -> Finding:
    return found(row.must, row.within or None, row.category)


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Walk], list[str]]:
    """A walk of made-up findings over six rows, of which two are there; gives what was walked."""
    monkeypatch.setattr(faults, "MEASURED", tmp_path / "measured.json")
    monkeypatch.setattr(faults, "PAGE", tmp_path / "page.md")
    monkeypatch.setattr(faults, "stage", lambda folder: nullcontext())
    monkeypatch.setattr(faults, "rows", lambda: SIX)
    faults.keep({row.name: faults.noted(row, as_due(row)) for row in SIX[:2]})

    def walked(walk: Walk) -> list[str]:
        seen: list[str] = []

        def fairly(on: Any, row: Row) -> Finding:
            seen.append(row.name)
            return walk(row)

        monkeypatch.setattr(faults, "walk_fairly", fairly)
        faults.measure_missing()
        return seen

    return walked


def kept() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(faults.MEASURED.read_text())
    return found


def test_only_what_is_missing_is_walked_and_then_nothing_is(scene: Any) -> None:
    assert scene(as_due) == NAMES[2:]
    assert kept().keys() == set(NAMES)
    assert all(one["as_due"] for one in kept().values())
    assert scene(as_due) == []


def test_a_walk_that_is_killed_goes_on_where_it_was(scene: Any) -> None:

    def killed(row: Row) -> Finding:
        if row.name == NAMES[4]:
            raise KeyboardInterrupt
        return as_due(row)

    with pytest.raises(KeyboardInterrupt):
        scene(killed)
    assert kept().keys() == set(NAMES[:4])
    page = faults.PAGE.read_text()
    assert NAMES[3].partition(": ")[2] in page
    assert scene(as_due) == NAMES[4:]


def test_what_is_not_as_due_is_walked_again_and_the_second_time_counts(scene: Any) -> None:
    third = SIX[2]
    times: list[str] = []

    def once_wrong(row: Row) -> Finding:
        times.append(row.name)
        if row == third and times.count(row.name) == 1:
            return found(UNDETECTED)
        return as_due(row)

    assert scene(once_wrong).count(third.name) == 2
    assert kept()[third.name]["as_due"]


def test_a_run_that_never_came_to_the_fault_is_no_finding(scene: Any) -> None:
    scene(lambda row: found(NO_RUN))
    assert kept().keys() == set(NAMES[:2])
