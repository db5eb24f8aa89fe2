"""Generate the documentation page of a rig's faults from its table and the measurements."""

from collections import Counter
from textwrap import fill
from typing import Any

from benchmarks.support.fault_rigs import FaultRig
from benchmarks.support.fault_table import GOES_ON, REFUSED, UNDETECTED, FaultRow

_HEAD = """# {title}

`configs/faults/{name}.yaml` holds the required reactions;
`python -m benchmarks faults --rig {name}` measures them. Each fault is injected into an emulated
device, a wire or a process during a run on the real drivers and wires. The measured time lasts from
the fault until {without}; it is never too short, and at most 5 ms too long. A stop of category 0
removes power at once; one of category 1 {stop} first. {motion}

The limits are those of `configs/limits/{limits}_hil.yaml`, for a host with occasional stalls of 40
ms; the computer of a rig uses those of `{limits}.yaml` and is faster by the difference. "-" marks a
row without a measurement (`python -m benchmarks faults --rig {name} --missing` runs these rows).
Every test run executes the rows in bold; with FAULTS=all in the environment, `pytest
tests/hil/{test}` executes all of them.

{measured}

Software limits are not a safety chain: with the hard-wired emergency stop and the drives' own
limits in place, faults that are not detected here must not be able to hurt anyone.
"""


def format_page(rig: FaultRig, rows: list[FaultRow], results: dict[str, Any]) -> str:
    """Return the whole page."""
    head = _HEAD.format(
        title=rig.title,
        name=rig.name,
        limits=rig.limits or rig.name,
        without=rig.safe_state,
        stop=rig.stop_action,
        motion=rig.motion,
        test=rig.test_file,
        measured=format_progress(rows, results),
    )
    parts = ["\n\n".join(fill(part, 100) for part in head.split("\n\n")) + "\n"]
    for device in dict.fromkeys(row.device for row in rows):
        of_device = [row for row in rows if row.device == device]
        parts.append(f"## {device}\n\n{_table(of_device, results)}")
    undetected = [row for row in rows if row.expected == UNDETECTED]
    lines = "\n".join(f"- {row.name}: {row.explanation}" for row in undetected)
    parts.append(f"## What is not detected\n\n{lines}\n")
    return "\n".join(parts)


def format_progress(rows: list[FaultRow], results: dict[str, Any]) -> str:
    """Return the number of measured rows, dates and hosts, and rows with unexpected results."""
    results = {row.name: results[row.name] for row in rows if row.name in results}
    lines = [f"**{len(results)} of {len(rows)} rows are measured.**"]
    where = Counter((each.get("date", ""), each.get("host", "")) for each in results.values())
    for (date, host), count in sorted(where.items()):
        lines.append(
            f"{count} on {date}: {host}." if date else f"{count} before date and host were stored."
        )
    unexpected = [name for name, result in results.items() if not result["as_expected"]]
    if unexpected:
        lines.append(f"**Result differs from the table: {', '.join(unexpected)}.**")
    return "\n".join(lines)


def _table(rows: list[FaultRow], results: dict[str, Any]) -> str:
    lines = [
        "| fault | expected reaction | category | within, s | measured, s | explanation |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        name = row.name.removeprefix(f"{row.device}: ")
        category = "" if row.category is None else str(row.category)
        within = f"{row.max_seconds:g}" if row.max_seconds else ""
        cells = (
            f"**{name}**" if row.short else name,
            " or ".join((row.expected, *row.alternatives)),
            category,
            within,
            _measured(row, results.get(row.name, {})),
            row.explanation,
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _measured(row: FaultRow, result: dict[str, Any]) -> str:
    """Return the measured result of a row, with the reason if the table allows several."""
    if not result:
        return "-"
    verdict = result["verdict"]
    seconds = "" if result["seconds"] is None else f"{result['seconds']:.3f}"
    if not result["as_expected"]:
        return f"differs: {verdict} {seconds}".rstrip()
    if row.alternatives:
        return f"{verdict} {seconds}".rstrip()
    return "as expected" if verdict in (REFUSED, GOES_ON) else seconds
