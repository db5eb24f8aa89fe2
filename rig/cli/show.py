"""`rig show RUN`."""

import json
from pathlib import Path

from rig import cli
from rig.cli.file_problems import INPUT_ERRORS, refuse
from rig.cli.find_run import find_calibrations, find_run
from rig.recording.runs import RunError


def main(
    run_name: Path, runs: Path, calibrations: list[str], *, incomplete_rows: bool, as_json: bool
) -> int:
    """Compute the summary of a run from its record, print it, and return the exit code."""
    from rig.analysis.report import summarise_run
    from rig.analysis.rows import MEAN_POSITION_ALARM
    from rig.analysis.summary import as_json as in_json
    from rig.analysis.summary import as_text
    from rig.recording.runs.folder import run_info

    try:
        known = find_calibrations(calibrations)
        run = find_run(run_name, runs)
        if "session" in run_info(run).config:
            return _show_session(run, as_json=as_json)
        summary = summarise_run(run, MEAN_POSITION_ALARM, known, incomplete_rows=incomplete_rows)
    except INPUT_ERRORS as error:
        return refuse("show", error, as_json=as_json)
    print(json.dumps(in_json(summary)) if as_json else as_text(summary).rstrip())
    return cli.OK


def _show_session(run: Path, *, as_json: bool) -> int:
    """Analyse a session of the bench again, print its results, and rewrite its files.

    The files are the session's report and calibration file.
    """
    from rig.analysis.stop_reason import describe_ending, find_stop
    from rig.kinds.oswec_bench.products import analyse
    from rig.recording.runs import reader
    from rig.recording.runs.folder import run_info

    try:
        summary = analyse(run)
    except RunError as error:
        status = run_info(run).status
        ending = describe_ending(status, find_stop(run, status).lost)
        record = reader.check_record(run).sentence
        raise RunError(f"{ending.description}.\n{record}.\n{error}") from error
    print(json.dumps(summary.as_dict()) if as_json else summary.as_text())
    return cli.OK
