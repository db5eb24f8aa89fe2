"""`rig runs`."""

from rich.table import Table
from rich.text import Text

from rig.cli.errors import input_errors
from rig.cli.exit_codes import OK
from rig.cli.options import RUNS, Json, Runs
from rig.cli.output import print_json
from rig.presentation.console import table_console
from rig.recording.runs import list_runs

_STYLES = {"complete": "green", "stopped": "yellow", "running": "cyan"}


def command(runs: Runs = RUNS, as_json: Json = False) -> int:
    """List all runs, newest first."""
    with input_errors("runs", as_json=as_json):
        if runs.exists() and not runs.is_dir():
            raise NotADirectoryError(f"{runs}: not a folder")
        runs_found = list_runs(runs)[::-1]
    if as_json:
        print_json([run._asdict() | {"path": str(run.path)} for run in runs_found])
        return OK
    if not runs_found:
        print(f"no runs in {runs}/")
        return OK
    table = Table(box=None, header_style="bold", pad_edge=False)
    longest_name = max(len(run.run) for run in runs_found)
    table.add_column("run", no_wrap=True, min_width=longest_name)  # what a person copies and types
    table.add_column("mode", no_wrap=True)
    table.add_column("rows", no_wrap=True, justify="right")
    table.add_column("status", no_wrap=True)
    table.add_column("record", overflow="fold")
    table.add_column("reason", overflow="fold")
    table.add_column("size", no_wrap=True, justify="right")
    for run in runs_found:
        done = "-" if run.rows_done is None else str(run.rows_done)
        planned = "-" if run.rows_planned is None else str(run.rows_planned)
        table.add_row(
            Text(run.run),
            run.mode,
            f"{done}/{planned}",
            Text(run.status, style=_STYLES.get(run.status, "red")),
            Text(run.record or "-", style="" if run.record in ("", "complete") else "red"),
            Text(run.problem or run.reason),
            f"{run.size / 1e6:.1f} MB",
        )
    table_console().print(table, crop=False)
    return OK
