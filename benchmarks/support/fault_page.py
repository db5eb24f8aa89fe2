"""The page of the documentation about a rig's faults, made from its table and what was found."""

from collections import Counter
from textwrap import fill
from typing import Any

from benchmarks.support.fault_rigs import FaultRig
from benchmarks.support.fault_table import GOES_ON, REFUSED, UNDETECTED, Row

_HEAD = """# {title}

Made by `python -m benchmarks faults --rig {name}` from `configs/faults/{name}.yaml`; do not edit.
Each fault is given to an emulated device, to a wire or to a process while a run is under way on the
real drivers and wires. Measured is the time from the fault until {without}; it is never told too
short, and up to 5 ms too long. A stop of category 0 takes the power away at once; one of category 1
{stop} first. {motion}

Limits are those of `configs/limits/{name}_hil.yaml`, for a host that stands still for 40 ms now and
then; a rig's own computer takes those of `{name}.yaml`, and is quicker by the difference. "-" is
not walked yet (`python -m benchmarks faults --rig {name} --missing` walks those rows). Every test
run walks the rows in bold; with FAULTS=all in the environment, `pytest tests/hil/{test}` walks them
all.

{walked}

Software limits are no safety chain: what is not detected here must not be able to hurt, with the
hard-wired emergency stop and the drives' own limits in place.
"""


def page(rig: FaultRig, rows: list[Row], measured: dict[str, Any]) -> str:
    """The whole page."""
    head = _HEAD.format(
        title=rig.title,
        name=rig.name,
        without=rig.without,
        stop=rig.stop,
        motion=rig.motion,
        test=rig.test,
        walked=walked(rows, measured),
    )
    parts = ["\n\n".join(fill(part, 100) for part in head.split("\n\n")) + "\n"]
    for device in dict.fromkeys(row.device for row in rows):
        several = [row for row in rows if row.device == device]
        parts.append(f"## {device}\n\n{_table(several, measured)}")
    unseen = [row for row in rows if row.must == UNDETECTED]
    lines = "\n".join(f"- {row.name}: {row.why}" for row in unseen)
    parts.append(f"## What is not detected\n\n{lines}\n")
    return "\n".join(parts)


def walked(rows: list[Row], measured: dict[str, Any]) -> str:
    """How many rows were walked, where and when, and which not as the table has them."""
    found = {row.name: measured[row.name] for row in rows if row.name in measured}
    said = [f"**{len(found)} of {len(rows)} rows are walked.**"]
    where = Counter((one.get("date", ""), one.get("host", "")) for one in found.values())
    for (date, host), count in sorted(where.items()):
        said.append(
            f"{count} on {date}: {host}." if date else f"{count} before day and host were kept."
        )
    amiss = [name for name, one in found.items() if not one["as_due"]]
    if amiss:
        said.append(f"**Not as the table has it: {', '.join(amiss)}.**")
    return "\n".join(said)


def _table(rows: list[Row], measured: dict[str, Any]) -> str:
    lines = [
        "| fault | what happens | category | within, s | measured, s | why |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        name = row.name.removeprefix(f"{row.device}: ")
        category = "" if row.category is None else str(row.category)
        within = f"{row.within:g}" if row.within else ""
        cells = (
            f"**{name}**" if row.short else name,
            " or ".join((row.must, *row.also)),
            category,
            within,
            _measured(row, measured.get(row.name, {})),
            row.why,
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _measured(row: Row, found: dict[str, Any]) -> str:
    """A row's finding, with its name where the table has several."""
    if not found:
        return "-"
    verdict = found["verdict"]
    seconds = "" if found["seconds"] is None else f"{found['seconds']:.3f}"
    if not found["as_due"]:
        return f"not so: {verdict} {seconds}".rstrip()
    if row.also:
        return f"{verdict} {seconds}".rstrip()
    return "so it was" if verdict in (REFUSED, GOES_ON) else seconds
