"""The page of the documentation about faults, made from the table and what was measured."""

from typing import Any

from benchmarks.support.fault_table import REFUSED, UNDETECTED, Row

_HEAD = """# Faults: what the rig does with them

Made by `python -m benchmarks faults` from `configs/faults/wavebot.yaml`; do not edit. Each fault
is given to an emulated device while a run is under way on the real drivers and wires. Measured is
the time from the fault until neither motor has power, at the drives; it is never told too short,
and up to 5 ms too long. A stop of category 0 takes the power away at once; one of category 1 damps
the body for 2 s first.

Limits are those of `configs/limits/wavebot_hil.yaml`, for a host that stands still for 40 ms now
and then; a rig's own computer takes those of `wavebot.yaml`, and is quicker by the difference. "-"
is not measured yet (`python -m benchmarks faults --missing` walks those rows). Every test run walks
the rows in bold; with FAULTS=all in the environment, `pytest tests/hil/test_hil_faults.py` walks
them all.

Software limits are no safety chain: what is not detected here must not be able to hurt, with the
hard-wired emergency stop and the drives' own limits in place.
"""


def page(rows: list[Row], measured: dict[str, Any]) -> str:
    """The whole page."""
    parts = [_HEAD]
    for device in dict.fromkeys(row.device for row in rows):
        several = [row for row in rows if row.device == device]
        parts.append(f"## {device}\n\n{_table(several, measured)}")
    unseen = [row for row in rows if row.must == UNDETECTED]
    lines = "\n".join(f"- {row.name}: {row.why}" for row in unseen)
    parts.append(f"## What is not detected\n\n{lines}\n")
    return "\n".join(parts)


def _table(rows: list[Row], measured: dict[str, Any]) -> str:
    lines = [
        "| fault | what happens | category | within, s | measured, s | why |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        name = row.name.removeprefix(f"{row.device}: ")
        found = measured.get(row.name, {})
        category = "" if row.category is None else str(row.category)
        within = f"{row.within:g}" if row.within else ""
        cells = (
            f"**{name}**" if row.short else name,
            " or ".join((row.must, *row.also)),
            category,
            within,
            _measured(row, found),
            row.why,
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _measured(row: Row, found: dict[str, Any]) -> str:
    if not found:
        return "-"
    if row.must in (REFUSED, UNDETECTED) and found["as_due"]:
        return "so it was"
    seconds = "" if found["seconds"] is None else f"{found['seconds']:.3f}"
    return seconds if found["as_due"] else f"not so: {found['verdict']} {seconds}".rstrip()
