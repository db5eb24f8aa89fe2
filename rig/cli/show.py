"""`rig show RUN`."""

import json

from rig.cli.input_files import find_calibrations, find_run, products_of
from rig.cli.options import RUNS, IncompleteRows, Json, ReadBy, Run, Runs
from rig.cli.output import OK, input_errors


def command(
    run: Run,
    calibration: ReadBy = None,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Show how a run went and the summary of its results."""
    with input_errors("show", as_json=as_json):
        calibrations = find_calibrations(calibration or [])
        path = find_run(run, runs)
        summary = products_of(path).summarise(path, calibrations, incomplete_rows=incomplete_rows)
    print(json.dumps(summary.values) if as_json else summary.text)
    return OK
