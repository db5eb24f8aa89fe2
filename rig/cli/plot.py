"""`rig plot RUN`."""

import json
import sys
from pathlib import Path

from rig import cli
from rig.cli.find_run import find_run
from rig.runs import RunError


def main(
    named: Path,
    runs: Path,
    fields: list[str],
    rows: list[int],
    output: Path | None,
    *,
    as_json: bool,
) -> int:
    """Write surfaces and summary anew, or log fields over time; print what was written."""
    from rig.analysis.report import write_products
    from rig.analysis.traces import write_traces

    try:
        run = find_run(named, runs)
        if fields:
            folder = run if run.is_dir() else run.parent
            written = [write_traces(run, output or folder / "traces.png", fields, rows or None)]
        else:
            written = write_products(run)
    except (RunError, KeyError, ValueError, OSError) as error:
        print(f"rig plot: {error.args[0] if error.args else error}", file=sys.stderr)
        return cli.BAD_INPUT
    if as_json:
        print(json.dumps([str(path) for path in written]))
    else:
        print("\n".join(str(path) for path in written))
    return cli.OK
