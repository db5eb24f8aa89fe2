"""`rig show RUN`."""

import json
from pathlib import Path

from rig import cli
from rig.cli.file_problems import REFUSED, refuse
from rig.cli.find_run import find_calibrations, find_run
from rig.recording.runs import RunError


def main(
    named: Path, runs: Path, calibrations: list[str], *, incomplete_rows: bool, as_json: bool
) -> int:
    """Print the summary of a run, worked out anew from its record."""
    from rig.analysis.report import summary_of
    from rig.analysis.rows import MEAN_POSITION_ALARM
    from rig.analysis.summary import as_json as in_json
    from rig.analysis.summary import as_text
    from rig.recording.runs.folder import facts

    try:
        read_by = find_calibrations(calibrations)
        run = find_run(named, runs)
        if "session" in facts(run).config:
            return _session(run, as_json=as_json)
        summary = summary_of(run, MEAN_POSITION_ALARM, read_by, incomplete_rows=incomplete_rows)
    except REFUSED as error:
        return refuse("show", error, as_json=as_json)
    print(json.dumps(in_json(summary)) if as_json else as_text(summary).rstrip())
    return cli.OK


def _session(run: Path, *, as_json: bool) -> int:
    """The results of a session of the bench, its report and calibration file written anew."""
    from rig.analysis.session import analyse
    from rig.analysis.stop_reason import ending_of, stop_of
    from rig.recording.runs import reader
    from rig.recording.runs.folder import facts

    try:
        summary = analyse(run)
    except RunError as error:
        status = facts(run).status
        ending = ending_of(status, stop_of(run, status).lost)
        record = reader.read_through(run).sentence
        raise RunError(f"{ending.description}.\n{record}.\n{error}") from error
    print(json.dumps(summary.as_dict()) if as_json else summary.as_text())
    return cli.OK
