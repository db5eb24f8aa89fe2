"""Walking the table of faults row by row: what is there is kept, what is missing is walked."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from benchmarks import faults
from benchmarks.support.fault_page import page
from benchmarks.support.fault_rigs import RIGS, FaultRig
from benchmarks.support.fault_table import (
    GOES_ON,
    LOOP_LOST,
    REFUSED,
    UNDETECTED,
    Row,
    gaps,
    rows,
    unsound,
)
from benchmarks.support.fault_walk import NO_RUN, Finding, wrong

Walk = Callable[[Row], Finding]
SIX = RIGS["wavebot"].rows()[:6]
NAMES = [row.name for row in SIX]


class Rig(FaultRig):
    """One whose table has six rows."""

    def rows(self) -> list[Row]:
        return SIX


def found(verdict: str, seconds: float | None = None, category: int | None = None) -> Finding:
    ended: Any = None
    return Finding(verdict, "", category, seconds, 0, ended)


def as_due(row: Row) -> Finding:
    return found(row.verdicts[0], row.within or None, row.category)


@pytest.fixture
def rig(tmp_path: Path) -> FaultRig:
    """Findings and page of its own; no emulated devices."""
    nothing: Any = nullcontext
    own = {"measured": tmp_path / "measured.json", "page": tmp_path / "page.md"}
    return Rig(**{**RIGS["wavebot"]._asdict(), **own, "stage": lambda folder: nothing()})


@pytest.fixture
def scene(rig: FaultRig, monkeypatch: pytest.MonkeyPatch) -> Callable[[Walk], list[str]]:
    """A walk of made-up findings over six rows, of which two are there; gives what was walked."""
    faults.keep(rig, {row.name: faults.noted(row, as_due(row)) for row in SIX[:2]})

    def walked(walk: Walk) -> list[str]:
        seen: list[str] = []

        def fairly(on: Any, row: Row) -> Finding:
            seen.append(row.name)
            return walk(row)

        monkeypatch.setattr(faults, "walk_fairly", fairly)
        faults.measure_some(rig, "", missing=True)
        return seen

    return walked


def test_only_what_is_missing_is_walked_and_then_nothing_is(scene: Any, rig: FaultRig) -> None:
    assert scene(as_due) == NAMES[2:]
    assert faults.measured(rig).keys() == set(NAMES)
    assert all(one["as_due"] for one in faults.measured(rig).values())
    assert scene(as_due) == []


def test_a_walk_that_is_killed_goes_on_where_it_was(scene: Any, rig: FaultRig) -> None:

    def killed(row: Row) -> Finding:
        if row.name == NAMES[4]:
            raise KeyboardInterrupt
        return as_due(row)

    with pytest.raises(KeyboardInterrupt):
        scene(killed)
    assert faults.measured(rig).keys() == set(NAMES[:4])
    page = rig.page.read_text()
    assert NAMES[3].partition(": ")[2] in page
    assert scene(as_due) == NAMES[4:]


def test_what_is_not_as_due_is_walked_again_and_the_second_time_counts(
    scene: Any, rig: FaultRig
) -> None:
    third = SIX[2]
    times: list[str] = []

    def once_wrong(row: Row) -> Finding:
        times.append(row.name)
        if row == third and times.count(row.name) == 1:
            return found(UNDETECTED)
        return as_due(row)

    assert scene(once_wrong).count(third.name) == 2
    assert faults.measured(rig)[third.name]["as_due"]


def test_a_run_that_never_came_to_the_fault_is_no_finding(scene: Any, rig: FaultRig) -> None:
    scene(lambda row: found(NO_RUN))
    assert faults.measured(rig).keys() == set(NAMES[:2])


def test_a_row_can_be_walked_anew_by_its_name(
    scene: Any, rig: FaultRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene(as_due)
    seen: list[str] = []

    def fairly(on: Any, row: Row) -> Finding:
        seen.append(row.name)
        return as_due(row)

    monkeypatch.setattr(faults, "walk_fairly", fairly)
    faults.measure_some(rig, NAMES[3], missing=False)
    faults.measure_some(rig, NAMES[3], missing=True)
    assert seen == [NAMES[3]]
    with pytest.raises(ValueError, match="'tired'"):
        faults.measure_some(rig, "tired", missing=True)


def test_the_page_says_which_rows_are_not_walked_and_where_the_others_were(
    scene: Any, rig: FaultRig
) -> None:
    known = faults.measured(rig)
    text = page(rig, SIX, known)
    told = " ".join(text.split())
    assert "2 of 6 rows are walked" in text
    assert f"2 on {known[NAMES[0]]['date']}: {known[NAMES[0]]['host']}." in told
    assert [line.count("| - |") for line in text.splitlines()].count(1) == 4
    assert "Not as the table" not in text
    wrong_one = {**known[NAMES[1]], "as_due": False}
    amiss = " ".join(page(rig, SIX, {NAMES[1]: wrong_one}).split())
    assert f"Not as the table has it: {NAMES[1]}." in amiss


@pytest.mark.parametrize("name", RIGS)
def test_a_table_is_sound_and_its_page_is_made_of_it(name: str) -> None:
    """Nothing is kept of rows that are not there, and the page is the generator's own."""
    one = RIGS[name]
    table, known = one.rows(), faults.measured(one)
    assert unsound(table) == []
    assert known.keys() <= {row.name for row in table}
    assert one.page.read_text() == page(one, table, known)


def test_gaps_of_a_table_are_told_both_ways() -> None:
    there = {"heave": {row.fault for row in SIX} | {"tired"}}
    assert gaps(SIX, there) == ["heave: tired: has no row"]
    assert gaps(SIX, {"heave": []})[0].endswith("there is no such fault")


def table(tmp_path: Path, line: str) -> list[Row]:
    path = tmp_path / "table.yaml"
    path.write_text(f"one:\n  - {{fault: bad, {line}}}\n")
    return rows(path)


@pytest.mark.parametrize(
    "line",
    [
        "must: goes on",  # and why?
        "must: not detected, why: so, within_s: 1",
        "must: loop lost",
        "must: loop lost, category: 0, within_s: 1",
        "must: STALE_ENCODER, category: 1, within_s: 1",
        "must: STALE_ENCODER, category: 0",
        "must: STALE_ENCODER, category: 0, within_s: 1, maybe: 2",
    ],
)
def test_a_row_that_contradicts_itself_is_refused(tmp_path: Path, line: str) -> None:
    with pytest.raises(ValueError, match="one: bad"):
        table(tmp_path, line)


def test_a_finding_is_judged_by_the_row(tmp_path: Path) -> None:
    (goes,) = table(tmp_path, "must: goes on, and: [STALE_PANEL], why: so")
    assert wrong(goes, found(GOES_ON)) == []
    assert wrong(goes, found("STALE_PANEL", 9.0, 1)) == []
    assert wrong(goes, found(GOES_ON)._replace(struck=3)) == []
    assert wrong(goes, found(GOES_ON)._replace(struck=0)) == ["the fault struck nothing"]
    assert wrong(goes, found(LOOP_LOST, 0.1)) != []
    (unseen,) = table(tmp_path, f"must: {UNDETECTED}, why: so")
    assert wrong(unseen, found(GOES_ON)) == []
    (lost,) = table(tmp_path, "must: loop lost, within_s: 0.5")
    assert wrong(lost, found(LOOP_LOST, 0.4)) == []
    assert wrong(lost, found(LOOP_LOST, 0.6)) == ["safe after 0.6 s, not 0.5 s"]
    assert wrong(lost, found(LOOP_LOST, None)) != []
    (refused,) = table(tmp_path, f"must: {REFUSED}, from: start")
    assert wrong(refused, found(REFUSED)) == []
    assert wrong(refused, found(GOES_ON)) != []
