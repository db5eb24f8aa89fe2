"""`rig check FILE`."""

import json
from datetime import UTC, datetime
from pathlib import Path

from rig.cli import BAD_INPUT, OK
from rig.cli.check_view import View
from rig.design.predictions import predict
from rig.execution.rehearsal.job import problems
from rig.planning.campaign import CheckReport, check_campaign
from rig.planning.session.files import is_session


def examine(path: Path, rig: Path | None = None) -> CheckReport:
    """Check a campaign with all it stands on, the simulated plant and its prediction included.

    ``rig`` stands in for the rig that the campaign names. Calibrations are to hold today.
    """
    today = datetime.now(UTC).date()
    return check_campaign(path, extra_check=problems, predictor=predict, rig=rig, day=today)


def main(path: Path, rig: Path | None = None, *, every_row: bool, as_json: bool) -> int:
    """Print the report; 0 if the campaign or session can be run."""
    if is_session(path):
        from rig.cli.bench import examine_session, show

        return show(examine_session(path, rig), as_json=as_json)
    report = examine(path, rig)
    if as_json:
        print(report.to_json())
    elif report.prediction is None:
        print(report.text())
    else:
        View(every_row=every_row).show(report)
    return OK if report.ok else BAD_INPUT


def complain(report: CheckReport, *, as_json: bool) -> int:
    """Say why a campaign cannot be run."""
    if as_json:
        print(json.dumps({"status": "bad input"} | json.loads(report.to_json())))
    else:
        print(report.text())
    return BAD_INPUT
