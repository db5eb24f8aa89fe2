"""Measuring a fault table row by row: existing findings are kept, missing ones are measured."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from benchmarks import faults
from benchmarks.support.fault_page import format_page
from benchmarks.support.fault_rigs import RIGS, FaultRig
from rig.config.problems import ConfigError
from rig.execution import fault_runs
from rig.execution.fault_runs import NO_RUN, Finding, mismatches
from rig.execution.fault_table import (
    GOES_ON,
    LOOP_LOST,
    REFUSED,
    UNDETECTED,
    FaultRow,
    load_table,
    missing_rows,
)

Measurement = Callable[[FaultRow], Finding]
SIX_ROWS = RIGS["wavebot"].rows()[:6]
NAMES = [row.name for row in SIX_ROWS]


class SixRowRig(FaultRig):
    """A rig whose table has six rows."""

    def rows(self) -> list[FaultRow]:
        return SIX_ROWS


def make_finding(
    verdict: str, seconds: float | None = None, category: int | None = None
) -> Finding:
    ended: Any = None
    return Finding(verdict, "", category, seconds, 0, ended)


def expected_finding(row: FaultRow) -> Finding:
    return make_finding(row.verdicts[0], row.max_seconds or None, row.category)


@pytest.fixture
def rig(tmp_path: Path) -> FaultRig:
    """A rig with findings of its own; no emulated devices."""
    no_devices: Any = nullcontext
    paths = {"results": tmp_path / "measured.json"}
    return SixRowRig(
        **{**RIGS["wavebot"]._asdict(), **paths, "emulate": lambda folder: no_devices()}
    )


@pytest.fixture
def measure_rows(
    rig: FaultRig, monkeypatch: pytest.MonkeyPatch
) -> Callable[[Measurement], list[str]]:
    """Measure six rows, two of which have findings, with synthetic findings; return the names
    measured.
    """
    faults.store_results(
        rig, {row.name: faults.finding_as_json(row, expected_finding(row)) for row in SIX_ROWS[:2]}
    )

    def run(measurement: Measurement) -> list[str]:
        measured: list[str] = []

        def measure_row(on: Any, row: FaultRow) -> Finding:
            measured.append(row.name)
            return measurement(row)

        monkeypatch.setattr(fault_runs, "measure_fault", measure_row)
        faults.measure_some(rig, "", missing=True)
        return measured

    return run


def test_only_missing_rows_are_measured(measure_rows: Any, rig: FaultRig) -> None:
    assert measure_rows(expected_finding) == NAMES[2:]
    assert faults.read_results(rig).keys() == set(NAMES)
    assert all(one["as_expected"] for one in faults.read_results(rig).values())
    assert measure_rows(expected_finding) == []


def test_an_interrupted_measurement_resumes_at_its_row(measure_rows: Any, rig: FaultRig) -> None:

    def killed(row: FaultRow) -> Finding:
        if row.name == NAMES[4]:
            raise KeyboardInterrupt
        return expected_finding(row)

    with pytest.raises(KeyboardInterrupt):
        measure_rows(killed)
    assert faults.read_results(rig).keys() == set(NAMES[:4])
    assert measure_rows(expected_finding) == NAMES[4:]


def test_an_unexpected_finding_is_measured_again_and_the_second_one_counts(
    measure_rows: Any, rig: FaultRig
) -> None:
    third = SIX_ROWS[2]
    times: list[str] = []

    def once_wrong(row: FaultRow) -> Finding:
        times.append(row.name)
        if row == third and times.count(row.name) == 1:
            return make_finding(UNDETECTED)
        return expected_finding(row)

    assert measure_rows(once_wrong).count(third.name) == 2
    assert faults.read_results(rig)[third.name]["as_expected"]


def test_a_run_that_never_reached_its_fault_is_no_finding(measure_rows: Any, rig: FaultRig) -> None:
    measure_rows(lambda row: make_finding(NO_RUN))
    assert faults.read_results(rig).keys() == set(NAMES[:2])


def test_a_row_can_be_measured_again_by_its_name(
    measure_rows: Any, rig: FaultRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    measure_rows(expected_finding)
    measured: list[str] = []

    def measure_row(on: Any, row: FaultRow) -> Finding:
        measured.append(row.name)
        return expected_finding(row)

    monkeypatch.setattr(fault_runs, "measure_fault", measure_row)
    faults.measure_some(rig, NAMES[3], missing=False)
    faults.measure_some(rig, NAMES[3], missing=True)
    assert measured == [NAMES[3]]
    with pytest.raises(ValueError, match="'tired'"):
        faults.measure_some(rig, "tired", missing=True)


def test_the_page_lists_unmeasured_rows_and_the_hosts_of_the_others(
    measure_rows: Any, rig: FaultRig
) -> None:
    findings = faults.read_results(rig)
    text = format_page(rig, SIX_ROWS, findings)
    sentences = " ".join(text.split())
    assert "2 of 6 rows are measured" in text
    assert f"2 on {findings[NAMES[0]]['date']}: {findings[NAMES[0]]['host']}." in sentences
    assert [line.count("| - |") for line in text.splitlines()].count(1) == 4
    assert "Not as the table" not in text
    wrong_one = {**findings[NAMES[1]], "as_expected": False}
    unexpected = " ".join(format_page(rig, SIX_ROWS, {NAMES[1]: wrong_one}).split())
    assert f"Result differs from the table: {NAMES[1]}." in unexpected


@pytest.mark.parametrize("name", RIGS)
def test_a_table_is_sound(name: str) -> None:
    """There are no findings for absent rows."""
    fault_rig = RIGS[name]
    table, findings = fault_rig.rows(), faults.read_results(fault_rig)
    assert 6 <= sum(row.short for row in table) <= 10
    assert findings.keys() <= {row.name for row in table}


def test_faults_without_a_row_are_reported() -> None:
    faults_by_part = {"heave": {row.fault for row in SIX_ROWS} | {"tired"}}
    assert missing_rows(SIX_ROWS, faults_by_part) == ["heave: tired"]


HEAD = f"task: {RIGS['wavebot'].table.parent}/tasks/wavebot.yaml\nfaults:\n  one:\n"


def read_table(tmp_path: Path, *lines: str) -> tuple[FaultRow, ...]:
    path = tmp_path / "table.yaml"
    path.write_text(HEAD + "".join(f"    - {{fault: bad, {line}}}\n" for line in lines))
    return load_table(path).rows


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("must: goes on", r"faults\.one\[1\]\.must: .*needs an explanation"),
        ("must: not detected, why: so, within_s: 1", "has no category and no time within_s"),
        ("must: loop lost", "needs a time within_s above 0 s"),
        ("must: loop lost, category: 0, within_s: 1", "loop lost has none"),
        ("must: STALE_ENCODER, category: 1, within_s: 1", "a stop of category 0"),
        ("must: STALE_ENCODER, within_s: 1", "a stop of category 0"),
        ("must: STALE_ENCODER, category: 0", "needs a time within_s above 0 s"),
        ("must: STALE_ENCODER, category: 0, within_s: 1, maybe: 2", "maybe"),
        ("must: STALE_ENCODRE, category: 0, within_s: 1", "allowed .*STALE_ENCODER"),
        ("must: STALE_ENCODER, and: [x], category: 0, within_s: 1", r"one\[1\]\.and"),
        ("must: STALE_ENCODER, category: 0, within_s: 61", r"allowed 0 \.\. 60"),
        ("must: STALE_ENCODER, category: 0, within_s: 1, from: motion", "needs the key motion"),
        ("must: goes on, why: so, long: true", "needs the key long_task"),
    ],
)
def test_a_row_that_contradicts_itself_is_refused(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        read_table(tmp_path, "must: refused at start, from: start", line)
    assert [problem.line for problem in caught.value.problems] == [5]


def test_all_rows_that_contradict_themselves_are_listed(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        read_table(tmp_path, "must: goes on", "must: loop lost", "must: loop lost, value: 2")
    assert [problem.line for problem in caught.value.problems] == [4, 5, 6]
    same = "must: refused at start, from: start"
    with pytest.raises(ConfigError, match="occurs twice"):
        read_table(tmp_path, same, same)


def test_rows_are_selected_by_text_short_form_or_all(tmp_path: Path) -> None:
    table = load_table(RIGS["wavebot"].table)
    assert table.selection() == [row for row in table.rows if row.short]
    assert table.selection(every=True) == list(table.rows)
    named = table.selection(["heave: silent", "nan"])
    assert named == [row for row in table.rows if "heave: silent" in row.name or "nan" in row.name]
    with pytest.raises(ValueError, match="has sleepy in its name"):
        table.selection(["nan", "sleepy"])
    rows = read_table(tmp_path, "must: refused at start, from: start")
    assert load_table(tmp_path / "table.yaml").selection() == list(rows)


def test_a_finding_is_compared_with_its_row(tmp_path: Path) -> None:
    (goes,) = read_table(tmp_path, "must: goes on, and: [STALE_PANEL], why: so")
    assert mismatches(goes, make_finding(GOES_ON)) == []
    assert mismatches(goes, make_finding("STALE_PANEL", 9.0, 1)) == []
    assert mismatches(goes, make_finding(GOES_ON)._replace(affected=3)) == []
    assert mismatches(goes, make_finding(GOES_ON)._replace(affected=0)) == [
        "the fault affected no message"
    ]
    assert mismatches(goes, make_finding(LOOP_LOST, 0.1)) != []
    (unseen,) = read_table(tmp_path, f"must: {UNDETECTED}, why: so")
    assert mismatches(unseen, make_finding(GOES_ON)) == []
    (lost,) = read_table(tmp_path, "must: loop lost, within_s: 0.5")
    assert mismatches(lost, make_finding(LOOP_LOST, 0.4)) == []
    assert mismatches(lost, make_finding(LOOP_LOST, 0.6)) == ["no power after 0.6 s, not 0.5 s"]
    assert mismatches(lost, make_finding(LOOP_LOST, None)) == ["a motor kept its power"]
    (refusal,) = mismatches(lost, make_finding(REFUSED, None))
    assert "not refused at start" in refusal
    (refused,) = read_table(tmp_path, f"must: {REFUSED}, from: start")
    assert mismatches(refused, make_finding(REFUSED)) == []
    assert mismatches(refused, make_finding(GOES_ON)) != []
