"""`rig show RUN`."""

import json
from pathlib import Path

from rig import cli
from rig.cli.find_run import find_calibrations, find_run
from rig.cli.refusal import REFUSED, refuse


def main(named: Path, runs: Path, calibrations: list[str], *, as_json: bool) -> int:
    """Print the summary of a run, worked out anew from its record."""
    from rig.analysis.report import summary_of
    from rig.analysis.rows import MEAN_POSITION_ALARM
    from rig.analysis.summary import as_json as in_json
    from rig.analysis.summary import as_text

    try:
        read_by = find_calibrations(calibrations)
        summary = summary_of(find_run(named, runs), MEAN_POSITION_ALARM, read_by)
    except REFUSED as error:
        return refuse("show", error, as_json=as_json)
    print(json.dumps(in_json(summary)) if as_json else as_text(summary).rstrip())
    return cli.OK
