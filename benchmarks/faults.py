"""Every fault of a rig (--rig) on the real stacks: what was done, and how soon it was safe."""

import json
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.support import host
from benchmarks.support.fault_page import page
from benchmarks.support.fault_rigs import RIGS, FaultRig
from benchmarks.support.fault_table import GOES_ON, REFUSED, Row
from benchmarks.support.fault_walk import NO_RUN, Finding, walk_fairly, wrong
from benchmarks.support.result import Figure, Result, figure

Walked = tuple[Row, Finding]
WAVEBOT = RIGS["wavebot"]


def measure(short: bool, rig: FaultRig = WAVEBOT) -> Result:
    """Walk a rig's table (short: its short selection); a whole walk rewrites its page."""
    chosen = [row for row in rig.rows() if row.short or not short]
    return _result(*_walked(rig, chosen, not short))


def measure_some(rig: FaultRig, text: str, missing: bool) -> Result:
    """Walk the rows with this text in their names (``missing``: of them those without a finding).

    Each is kept as soon as it is there.
    """
    chosen = [row for row in rig.rows() if text in row.name]
    if not chosen:
        raise ValueError(f"no row of {rig.table.name} has {text!r} in its name")
    known = measured(rig) if missing else {}
    return _result(*_walked(rig, [row for row in chosen if row.name not in known], True))


def measured(rig: FaultRig) -> dict[str, Any]:
    """What was found so far, by the rows' names."""
    there = rig.measured.exists()
    known: dict[str, Any] = json.loads(rig.measured.read_text()) if there else {}
    return known


def _walked(rig: FaultRig, chosen: list[Row], kept: bool) -> tuple[list[Walked], list[str]]:
    """Walk these rows; what is not as it should be is walked again, and the second time counts."""
    walked: list[Walked] = []
    notes: list[str] = []
    if not chosen:
        return walked, notes
    with tempfile.TemporaryDirectory() as scratch, rig.stage(Path(scratch)) as on:
        for number, row in enumerate(chosen, start=1):
            found = walk_fairly(on, row)
            if first := wrong(row, found):
                notes.append(f"{row.name}: at first {'; '.join(first)}")
                found = walk_fairly(on, row)
            walked.append((row, found))
            said = f"{row.name}: {found.verdict}, {found.seconds} s"
            amiss = "".join(f"; NOT SO: {text}" for text in wrong(row, found))
            print(f"{number}/{len(chosen)} {said}{amiss}", file=sys.stderr, flush=True)
            if kept and found.verdict != NO_RUN:  # half a walk is half a page, and no work lost
                keep(rig, {**measured(rig), row.name: noted(row, found)})
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
    """A finding as JSON values, with the day and the machine."""
    seconds = None if found.seconds is None else round(found.seconds, 3)
    return {
        "verdict": found.verdict,
        "seconds": seconds,
        "as_due": not wrong(row, found),
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "host": host.told(),
    }


def keep(rig: FaultRig, known: dict[str, Any]) -> None:
    """Put what was found on disk, and on the page of the documentation."""
    rows = rig.rows()
    there = {row.name for row in rows}
    known = {name: one for name, one in sorted(known.items()) if name in there}
    rig.measured.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n")
    rig.page.write_text(page(rig, rows, known))


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
    for verdict in (REFUSED, GOES_ON):
        made.append(figure(verdict, "faults", sum(f.verdict == verdict for _, f in walked)))
    made.append(figure("rows lost", "rows", sum(f.lost for _, f in walked), at_most=0))
    return made
