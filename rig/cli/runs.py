"""`rig runs`."""

from rich.text import Text

from rig.cli.options import RUNS, Json, Runs
from rig.cli.output import OK, input_errors, print_json
from rig.presentation.console import plain_table, table_console
from rig.recording.runs import list_runs

_STYLES = {"complete": "green", "stopped": "yellow", "running": "cyan"}


def command(runs: Runs = RUNS, as_json: Json = False) -> int:
    """List all runs, newest first."""
    with input_errors("runs", as_json=as_json):
        if runs.exists() and not runs.is_dir():
            raise NotADirectoryError(f"{runs}: not a folder")
        runs_found = list_runs(runs)[::-1]
    if as_json:
        return print_json([run._asdict() | {"path": str(run.path)} for run in runs_found])
    if not runs_found:
        print(f"no runs in {runs}/")
        return OK
    table = plain_table("run", "mode", ">rows", "status", "record…", "reason…", ">size")
    # What a person copies and types.
    table.columns[0].min_width = max(len(run.run) for run in runs_found)
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
