"""Every fault of every device on the real stacks: what the rig did, and how soon it was safe."""

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.support.fault_page import page
from benchmarks.support.fault_table import REFUSED, UNDETECTED, Row, rows
from benchmarks.support.fault_walk import NO_RUN, Finding, stage, walk_fairly, wrong
from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Figure, Result, figure

MEASURED = ROOT / "benchmarks" / "results" / "faults_measured.json"
PAGE = ROOT / "docs" / "faults.md"

Walked = tuple[Row, Finding]


def measure(short: bool) -> Result:
    """Walk the table (short: its short selection); a whole walk rewrites docs/faults.md."""
    return _result(*_walked([row for row in rows() if row.short or not short], not short))


def measure_missing() -> Result:
    """Walk the rows that have no finding yet; each is kept as soon as it is there."""
    known = measured()
    return _result(*_walked([row for row in rows() if row.name not in known], True))


def measured() -> dict[str, Any]:
    """What was found so far, by the rows' names."""
    known: dict[str, Any] = json.loads(MEASURED.read_text()) if MEASURED.exists() else {}
    return known


def _walked(chosen: list[Row], kept: bool) -> tuple[list[Walked], list[str]]:
    """Walk these rows; what is not as it should be is walked again, and the second time counts."""
    walked: list[Walked] = []
    notes: list[str] = []
    if not chosen:
        return walked, notes
    with tempfile.TemporaryDirectory() as scratch, stage(Path(scratch)) as on:
        for number, row in enumerate(chosen, start=1):
            found = walk_fairly(on, row)
            if first := wrong(row, found):
                notes.append(f"{row.name}: at first {'; '.join(first)}")
                found = walk_fairly(on, row)
            walked.append((row, found))
            said = f"{row.name}: {found.verdict}, {found.seconds} s"
            print(f"{number}/{len(chosen)} {said}", file=sys.stderr, flush=True)
            if kept and found.verdict != NO_RUN:  # half a walk is half a page, and no work lost
                keep({**measured(), row.name: noted(row, found)})
    return walked, notes


def _result(walked: list[Walked], notes: list[str]) -> Result:
    amiss = [f"{row.name}: {text}" for row, found in walked for text in wrong(row, found)]
    return Result(
        "Faults",
        "What the rig did with each fault of each device, on real wires with emulated devices.",
        f"{len(walked)} faults, each in a run of its own",
        tuple(figures(walked)),
        (*amiss, *notes),
    )


def noted(row: Row, found: Finding) -> dict[str, Any]:
    """A finding as JSON values."""
    seconds = None if found.seconds is None else round(found.seconds, 3)
    return {"verdict": found.verdict, "seconds": seconds, "as_due": not wrong(row, found)}


def keep(known: dict[str, Any]) -> None:
    """Put what was measured on disk, and on the page of the documentation."""
    there = {row.name for row in rows()}
    known = {name: one for name, one in sorted(known.items()) if name in there}
    MEASURED.write_text(json.dumps(known, indent=1) + "\n")
    PAGE.write_text(page(rows(), known))


def figures(walked: list[Walked]) -> list[Figure]:
    """How many were as the table has them, and the times to the safe state."""
    amiss = sum(bool(wrong(row, found)) for row, found in walked)
    made = [figure("not as the table has it", "faults", amiss, at_most=0)]
    for category in (0, 1):
        seconds = [
            found.seconds
            for row, found in walked
            if row.category == category and found.seconds is not None
        ]
        if seconds:
            made.append(figure(f"category {category}: until no motor had power", "s", seconds))
    for verdict in (REFUSED, UNDETECTED):
        made.append(figure(verdict, "faults", sum(f.verdict == verdict for _, f in walked)))
    made.append(figure("rows lost", "rows", sum(f.lost for _, f in walked), at_most=0))
    return made
