"""`rig doctor`."""

import json
from pathlib import Path

from rich.console import Group
from rich.table import Table
from rich.text import Text

from rig import cli
from rig.cli.console import table_console
from rig.doctor import Asked, Examination, Finding, Use, Verdict, examine
from rig.doctor.timing import PLAIN

_WIDE = 110  # columns
_LOOKS = {
    Verdict.GOOD: ("ok", "green"),
    Verdict.WARNING: ("!", "yellow"),
    Verdict.BAD: ("BAD", "bold red"),
    Verdict.UNKNOWN: ("?", "dim"),
}


def main(
    runs: Path, seconds: float, rate_hz: float, hours: float, *, rehearsal: bool, as_json: bool
) -> int:
    """Examine the host and say what it is fit for; 0 if fit for what was asked."""
    console = table_console()
    asked = Asked(runs, seconds, rate_hz, hours)
    if not as_json and console.is_terminal:
        with console.status(
            f"measuring wake-ups for {seconds + min(seconds, PLAIN):g} s, then the rest ..."
        ):
            found = examine(asked)
    else:
        found = examine(asked)
    if as_json:
        print(json.dumps(found.as_dict()))
    else:
        console.print(drawn(found, console.width))
    return cli.OK if found.fit(Use.REHEARSAL if rehearsal else Use.REALTIME) else cli.FAILED


def drawn(found: Examination, width: int) -> Group:
    """The findings by area, advice under what needs it, and the verdict.

    Where there is room, every limit stands beside its value; else only those that are not held.
    """
    parts: list[Table | Text] = []
    area = ""
    for finding in found.findings:
        if finding.area != area:
            area = finding.area
            parts.append(Text(f"\n{area}", style="bold"))
            parts.append(_table(width))
        table = parts[-1]
        assert isinstance(table, Table)
        _add(table, finding)
    fit = found.fit(Use.REALTIME)
    style = "bold green" if fit else "bold yellow" if found.fit(Use.REHEARSAL) else "bold red"
    parts += [Text(""), Text(found.verdict, style=style)]
    return Group(*parts)


def _table(width: int) -> Table:
    table = Table.grid(padding=(0, 2, 0, 0), expand=True)
    table.add_column(width=4, justify="right")
    table.add_column(width=28)
    table.add_column(ratio=1)
    if width >= _WIDE:
        table.add_column(ratio=1)
    return table


def _add(table: Table, finding: Finding) -> None:
    mark, style = _LOOKS[finding.verdict]
    value, limit = Text(finding.value), Text(finding.limit, style="dim")
    advice = Text(f"-> {finding.advice}", style="cyan") if finding.advice else Text("")
    head = (Text(mark, style=style), Text(finding.what))
    if len(table.columns) > 3:
        if advice:
            limit.append("\n").append(advice)
        table.add_row(*head, value, limit)
        return
    for more in (limit, advice):
        if more and finding.verdict is not Verdict.GOOD:
            value.append("\n").append(more)
    table.add_row(*head, value)
