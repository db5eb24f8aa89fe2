"""`rig doctor`."""

import json
from pathlib import Path

from rich.console import Group
from rich.table import Table
from rich.text import Text

from rig import cli
from rig.cli.console import table_console
from rig.cli.file_problems import REFUSED, refuse
from rig.config.any_rig_file import load_rig
from rig.host import DoctorOptions, Examination, Finding, Use, Verdict, examine
from rig.host.timing import PLAIN

RATE = 1000.0  # Hz, of the loop where nobody says another
_WIDE = 110  # columns
_LOOKS = {
    Verdict.GOOD: ("ok", "green"),
    Verdict.WARNING: ("!", "yellow"),
    Verdict.BAD: ("BAD", "bold red"),
    Verdict.UNKNOWN: ("?", "dim"),
    Verdict.NOTE: ("-", "dim"),
}


def main(
    runs: Path,
    seconds: float,
    rate_hz: float | None,
    hours: float,
    *,
    rehearsal: bool,
    as_json: bool,
    rig: Path | None = None,
) -> int:
    """Examine the host and say what it is fit for; 0 if fit for what was asked.

    ``rig``: also what its wires need; its rate is the loop's where none is given.
    """
    console = table_console()
    wanted = None
    if rig is not None:
        try:
            wanted, _ = load_rig(rig)
        except REFUSED as error:
            return refuse("doctor", error, as_json=as_json)
    rate = rate_hz or (float(wanted.rate_hz) if wanted is not None else RATE)
    asked = DoctorOptions(runs, seconds, rate, hours, wanted)
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
        if more and finding.verdict not in (Verdict.GOOD, Verdict.NOTE):
            value.append("\n").append(more)
    table.add_row(*head, value)
