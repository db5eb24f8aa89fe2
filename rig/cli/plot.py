"""`rig plot RUN`."""

import json
from pathlib import Path

from rig import cli
from rig.cli.failure import fail
from rig.cli.find_run import find_run


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
    from rig.analysis.traces import DEFAULT_FIELDS, write_traces

    try:
        run = find_run(named, runs)
        if fields or rows or output:
            picture = output or (run if run.is_dir() else run.parent) / "traces.png"
            written = [write_traces(run, picture, fields or DEFAULT_FIELDS, rows or None)]
        else:
            written = write_products(run)
    except (KeyError, ValueError, OSError) as error:
        return fail("plot", error, as_json=as_json)
    if as_json:
        print(json.dumps([str(path) for path in written]))
    else:
        print("\n".join(str(path) for path in written))
    return cli.OK
