"""How `rig devices` shows what it found on a bench."""

from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from rig.cli.devices_view import BAD, NOTE, drawn_line, line_dict, valued, verdict
from rig.execution.hardware.bench_survey import BenchFound, StreamFound


def as_dict(rig: str, found: BenchFound) -> dict[str, Any]:
    """All of it as JSON values; null for what did not come."""
    return {
        "status": "trouble" if found.trouble else "ok",
        "rig": rig,
        "trouble": list(found.trouble),
        "streams": [
            {**one._asdict(), "values": [value._asdict() for value in one.values]}
            for one in found.streams
        ],
        "lines": [line_dict(line, found.at) for line in found.lines],
    }


def drawn(rig: str, found: BenchFound) -> Group:
    """A row a device, the lines with a row a unit, and what is wrong."""
    parts: list[Table | Text] = [Text.assemble((rig, "bold"), ": who answers on its wires\n")]
    for one in found.streams:
        parts += _stream(one)
    parts += [part for line in found.lines for part in drawn_line(line, found.at)]
    return Group(*parts, verdict(found.trouble))


def _stream(one: StreamFound) -> list[Table | Text]:
    head = Text.assemble((f"{one.name}  ", "bold cyan"), f"at {one.address}")
    if not one.answers:
        return [head.append(f"\n  {one.trouble}", BAD), Text("")]
    table = Table.grid(padding=(0, 2, 0, 0))
    age = Text("") if one.age is None else Text(f"{1e3 * one.age:.0f} ms", NOTE)
    table.add_row(Text("  "), Text(one.identity), age, valued(one.values))
    return [head, table, Text("")]
