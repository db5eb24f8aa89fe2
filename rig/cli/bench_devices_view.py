"""Output of `rig devices` for a bench, for people and for programs."""

from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from rig.cli.devices_view import (
    BAD_STYLE,
    NOTE_STYLE,
    line_as_dict,
    render_line,
    render_values,
    render_verdict,
    value_as_dict,
)
from rig.kinds.oswec_bench.hardware.survey import BenchSurvey, StreamSurvey


def as_dict(rig: str, survey: BenchSurvey) -> dict[str, Any]:
    """Return the survey as JSON values; null for a value that no device sent."""
    return {
        "status": "trouble" if survey.trouble else "ok",
        "rig": rig,
        "trouble": list(survey.trouble),
        "streams": [
            {
                "name": stream.name,
                "address": stream.address,
                "answers": stream.answers,
                "identity": stream.identity,
                "age": stream.age,
                "values": [value_as_dict(value) for value in stream.values],
                "trouble": stream.trouble,
            }
            for stream in survey.streams
        ],
        "lines": [line_as_dict(line, survey.at) for line in survey.lines],
    }


def render(rig: str, survey: BenchSurvey) -> Group:
    """Draw one block per device, one table per line with a row per unit, and the verdict."""
    parts: list[Table | Text] = [Text.assemble((rig, "bold"), ": devices on its wires\n")]
    for stream in survey.streams:
        parts += _render_stream(stream)
    parts += [part for line in survey.lines for part in render_line(line, survey.at)]
    return Group(*parts, render_verdict(survey.trouble))


def _render_stream(stream: StreamSurvey) -> list[Table | Text]:
    head = Text.assemble((f"{stream.name}  ", "bold cyan"), f"at {stream.address}")
    if not stream.answers:
        return [head.append(f"\n  {stream.trouble}", BAD_STYLE), Text("")]
    table = Table.grid(padding=(0, 2, 0, 0))
    age = Text("") if stream.age is None else Text(f"{1e3 * stream.age:.0f} ms", NOTE_STYLE)
    table.add_row(Text("  "), Text(stream.identity), age, render_values(stream.values))
    return [head, table, Text("")]
