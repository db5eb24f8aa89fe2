"""`rig doctor`."""

import itertools
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Group
from rich.table import Table
from rich.text import Text

from rig.cli.input_files import RIGS, input_file
from rig.cli.options import RUNS, Json, Runs
from rig.cli.output import FAILED, OK, input_errors, print_json, waiting
from rig.host import DoctorOptions, Examination, Finding, Use, Verdict, examine
from rig.host.timing import UNPRIVILEGED_S
from rig.kinds.rig_file import load_rig
from rig.presentation.console import table_console

EXIT_CODES = """\
Exit codes: 0 fit for real time on a rig (with --rehearsal: for a rehearsal); 1 not fit, the \
verdict names the reasons; 2 bad input."""
DEFAULT_RATE_HZ = 1000.0  # of the loop, without --rate and --rig
_WIDE_CONSOLE = 110  # columns
_MARKS = {
    Verdict.GOOD: ("ok", "green"),
    Verdict.WARNING: ("!", "yellow"),
    Verdict.BAD: ("BAD", "bold red"),
    Verdict.UNKNOWN: ("?", "dim"),
    Verdict.NOTE: ("-", "dim"),
}


def command(
    seconds: Annotated[
        float, typer.Option("--seconds", min=0.1, max=3600, help="Time to measure wake-ups, s.")
    ] = 35.0,
    during_run: Annotated[
        bool,
        typer.Option("--during-run", help="Leave out wake-ups: those of the loop that runs count."),
    ] = False,
    core: Annotated[
        int | None,
        typer.Option("--core", min=0, help="Core of the loop (default: the one it would take)."),
    ] = None,
    rehearsal: Annotated[
        bool, typer.Option("--rehearsal", help="Judge fitness for rehearsals only (exit code).")
    ] = False,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate", min=10, max=10_000, help="Loop rate, Hz (default: the rig file's, or 1000)."
        ),
    ] = None,
    hours: Annotated[
        float, typer.Option("--hours", min=0, max=1000, help="Hours of log that must fit on disk.")
    ] = 8.0,
    rig: Annotated[
        Path | None, typer.Option("--rig", help="Rig file: also check what its wires need.")
    ] = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Check whether this host is fit for real time on a rig; give advice where it is not."""
    console = table_console()
    rig_config = None
    if rig is not None:
        with input_errors("doctor", as_json=as_json):
            rig_config, _, _ = load_rig(input_file(rig, RIGS))
    rate = rate or (float(rig_config.rate_hz) if rig_config is not None else DEFAULT_RATE_HZ)
    seconds = 0.0 if during_run else seconds
    options = DoctorOptions(runs, seconds, rate, hours, rig_config, core)
    duration = seconds + min(seconds, UNPRIVILEGED_S)
    wakeups = f"measuring wake-ups for {duration:g} s, then the other checks ..."
    text = "checking ..." if during_run else wakeups
    with waiting(console, text, quiet=as_json):
        examination = examine(options)
    if as_json:
        print_json(examination.as_dict())
    else:
        console.print(render(examination, console.width))
    return OK if examination.fit(Use.REHEARSAL if rehearsal else Use.REALTIME) else FAILED


def render(examination: Examination, width: int) -> Group:
    """Draw the findings by area, advice where a finding needs it, and the verdict.

    A console of `_WIDE_CONSOLE` columns shows every limit in a column of its own; a narrower one
    shows only the limits that are exceeded.
    """
    parts: list[Table | Text] = []
    for area, findings in itertools.groupby(examination.findings, lambda each: each.area):
        table = _table(width)
        for finding in findings:
            _add_finding(table, finding)
        parts += [Text(f"\n{area}", style="bold"), table]
    fit = examination.fit(Use.REALTIME)
    style = "bold green" if fit else "bold yellow" if examination.fit(Use.REHEARSAL) else "bold red"
    parts += [Text(""), Text(examination.verdict, style=style)]
    return Group(*parts)


def _table(width: int) -> Table:
    table = Table.grid(padding=(0, 2, 0, 0), expand=True)
    table.add_column(width=4, justify="right")
    table.add_column(width=28)
    table.add_column(ratio=1)
    if width >= _WIDE_CONSOLE:
        table.add_column(ratio=1)
    return table


def _add_finding(table: Table, finding: Finding) -> None:
    mark, style = _MARKS[finding.verdict]
    value, limit = Text(finding.value), Text(finding.limit, style="dim")
    advice = Text(f"-> {finding.advice}", style="cyan") if finding.advice else Text("")
    head = (Text(mark, style=style), Text(finding.check))
    if len(table.columns) > 3:
        if advice:
            limit.append("\n").append(advice)
        table.add_row(*head, value, limit)
        return
    for more in (limit, advice):
        if more and finding.verdict not in (Verdict.GOOD, Verdict.NOTE):
            value.append("\n").append(more)
    table.add_row(*head, value)
