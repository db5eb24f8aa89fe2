"""`rig runs`."""

import json
from pathlib import Path

from rich.console import Console
from rich.table import Table

from rig import cli
from rig.runs import list_runs

_STYLES = {"complete": "green", "stopped": "yellow", "running": "cyan"}


def main(runs: Path, *, as_json: bool) -> int:
    """Print the runs, newest first."""
    listed = list_runs(runs)[::-1]
    if as_json:
        print(json.dumps([run._asdict() | {"path": str(run.path)} for run in listed]))
        return cli.OK
    if not listed:
        print(f"no runs in {runs}/")
        return cli.OK
    table = Table(box=None, header_style="bold", pad_edge=False)
    for name in ("run", "rung", "rows", "status", "reason", "size"):
        table.add_column(name, justify="right" if name in ("rows", "size") else "left")
    for run in listed:
        done = "-" if run.rows_done is None else str(run.rows_done)
        whole = "-" if run.rows_planned is None else str(run.rows_planned)
        table.add_row(
            run.run,
            run.rung,
            f"{done}/{whole}",
            f"[{_STYLES.get(run.status, 'red')}]{run.status}[/]",
            run.problem or run.reason,
            f"{run.size / 1e6:.1f} MB",
        )
    Console().print(table)
    return cli.OK
