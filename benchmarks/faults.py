"""Every fault of a rig (--rig) on the real stacks: reaction of the rig and time until safe."""

import json
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.support import host
from benchmarks.support.fault_rigs import RIGS, FaultRig
from benchmarks.support.result import Figure, Result, figure
from rig.execution.fault_runs import NO_RUN, Finding, mismatches, rehearse_faults
from rig.execution.fault_table import GOES_ON, REFUSED, FaultRow

MeasuredFault = tuple[FaultRow, Finding]
WAVEBOT = RIGS["wavebot"]


def measure(short: bool, rig: FaultRig = WAVEBOT) -> Result:
    """Measure a rig's table (short: its short selection); a complete one stores its results."""
    selected = [row for row in rig.rows() if row.short or not short]
    return _result(*_measure_rows(rig, selected, not short))


def measure_some(rig: FaultRig, text: str, missing: bool) -> Result:
    """Measure the rows with this text in their names (``missing``: only those without a result).

    Each result is stored at once.
    """
    selected = [row for row in rig.rows() if text in row.name]
    if not selected:
        raise ValueError(f"no row of {rig.table.name} has {text!r} in its name")
    known = read_results(rig) if missing else {}
    return _result(*_measure_rows(rig, [row for row in selected if row.name not in known], True))


def read_results(rig: FaultRig) -> dict[str, Any]:
    """Return the stored results by the names of the rows."""
    if not rig.results.exists():
        return {}
    results: dict[str, Any] = json.loads(rig.results.read_text())
    return results


def _measure_rows(
    rig: FaultRig, selected: list[FaultRow], stored: bool
) -> tuple[list[MeasuredFault], list[str]]:
    """Measure these rows; an unexpected result is measured again, and the second one counts."""
    results: list[MeasuredFault] = []
    notes: list[str] = []
    if not selected:
        return results, notes
    with tempfile.TemporaryDirectory() as scratch, rig.emulate(Path(scratch)) as emulated_rig:
        for number, each in enumerate(rehearse_faults(emulated_rig, selected), start=1):
            row, finding = each.row, each.finding
            if each.at_first:
                notes.append(f"{row.name}: at first {'; '.join(each.at_first)}")
            results.append((row, finding))
            messages = "".join(f"; UNEXPECTED: {text}" for text in each.mismatches)
            progress = f"{row.name}: {finding.verdict}, {finding.seconds} s{messages}"
            print(f"{number}/{len(selected)} {progress}", file=sys.stderr, flush=True)
            if stored and finding.verdict != NO_RUN:  # an interrupted measurement keeps its results
                store_results(rig, {**read_results(rig), row.name: finding_as_json(row, finding)})
    return results, notes


def _result(results: list[MeasuredFault], notes: list[str]) -> Result:
    messages = [
        f"{row.name}: {text}" for row, finding in results for text in mismatches(row, finding)
    ]
    return Result(
        "Faults",
        "Reaction of the rig to each fault of each device, on real wires with emulated devices.",
        f"{len(results)} faults, each in a run of its own",
        tuple(figures(results)),
        (*messages, *notes),
    )


def finding_as_json(row: FaultRow, finding: Finding) -> dict[str, Any]:
    """Return a result as JSON values, with date and host."""
    seconds = None if finding.seconds is None else round(finding.seconds, 3)
    return {
        "verdict": finding.verdict,
        "seconds": seconds,
        "as_expected": not mismatches(row, finding),
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "host": host.describe_briefly(),
    }


def store_results(rig: FaultRig, known: dict[str, Any]) -> None:
    """Write the results to disk; the site's page of the rig shows them."""
    names = {row.name for row in rig.rows()}
    known = {name: result for name, result in sorted(known.items()) if name in names}
    rig.results.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n")


def figures(results: list[MeasuredFault]) -> list[Figure]:
    """Return the number of unexpected results, and the times to the safe state."""
    messages = sum(bool(mismatches(row, finding)) for row, finding in results)
    result_figures = [figure("results that differ from the table", "faults", messages, at_most=0)]
    for category in (0, 1):
        seconds = [
            finding.seconds
            for row, finding in results
            if row.category == category and finding.seconds is not None
        ]
        if seconds:
            result_figures.append(
                figure(f"category {category}: until no motor had power", "s", seconds)
            )
    for verdict in (REFUSED, GOES_ON):
        result_figures.append(
            figure(verdict, "faults", sum(f.verdict == verdict for _, f in results))
        )
    result_figures.append(
        figure("rows lost", "rows", sum(f.rows_lost for _, f in results), at_most=0)
    )
    return result_figures
