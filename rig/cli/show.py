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
    from rig.runs.folder import facts

    try:
        read_by = find_calibrations(calibrations)
        run = find_run(named, runs)
        if "session" in facts(run).config:
            return _session(run, as_json=as_json)
        summary = summary_of(run, MEAN_POSITION_ALARM, read_by)
    except REFUSED as error:
        return refuse("show", error, as_json=as_json)
    print(json.dumps(in_json(summary)) if as_json else as_text(summary).rstrip())
    return cli.OK


def _session(run: Path, *, as_json: bool) -> int:
    """The results of a session of the bench, its report and calibration file written anew."""
    from rig.analysis.session.analyse import analyse

    summary = analyse(run)
    print(json.dumps(summary.as_dict()) if as_json else summary.as_text())
    return cli.OK
