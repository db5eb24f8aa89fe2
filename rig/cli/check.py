"""`rig check FILE`."""

import json
from datetime import UTC, datetime
from pathlib import Path

from rig.cli import BAD_INPUT, OK
from rig.cli.check_view import CheckView
from rig.cli.command_error import fail
from rig.cli.input_files import CAMPAIGNS, SESSIONS, input_file, rig_file
from rig.config.shipped_files import UnknownNameError
from rig.design.predictions import predict
from rig.execution.rehearsal.job import problems
from rig.planning.campaign import CheckReport, check_campaign
from rig.planning.session.files import is_session


def examine(path: Path, rig: Path | None = None) -> CheckReport:
    """Check a campaign and all its input files, the simulated plant and predictions included.

    ``rig`` replaces the rig that the campaign names. Calibrations must be valid today (UTC).
    """
    today = datetime.now(UTC).date()
    return check_campaign(path, extra_check=problems, predictor=predict, rig=rig, day=today)


def main(path: Path, rig: Path | None = None, *, every_row: bool, as_json: bool) -> int:
    """Print the report, and return the exit code (0: the campaign or session can run)."""
    try:
        path, rig = input_file(path, CAMPAIGNS, SESSIONS), rig_file(rig)
    except UnknownNameError as error:
        return fail("check", error, as_json=as_json)
    if is_session(path):
        from rig.cli.bench import examine_session, show

        return show(examine_session(path, rig), as_json=as_json)
    report = examine(path, rig)
    if as_json:
        print(report.to_json())
    elif report.prediction is None:
        print(report.text())
    else:
        CheckView(every_row=every_row).show(report)
    return OK if report.ok else BAD_INPUT


def print_errors(report: CheckReport, *, as_json: bool) -> int:
    """Print why a campaign cannot run, and return the exit code."""
    if as_json:
        print(json.dumps({"status": "bad input"} | json.loads(report.to_json())))
    else:
        print(report.text())
    return BAD_INPUT
