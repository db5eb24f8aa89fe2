"""`rig check FILE`."""

import json
from datetime import UTC, datetime
from pathlib import Path

from rig.cli import BAD_INPUT, OK
from rig.cli.check_view import CheckView
from rig.cli.command_error import fail
from rig.cli.input_files import CAMPAIGNS, SESSIONS, input_file, rig_file
from rig.config import Problem
from rig.config.shipped_files import UnknownNameError
from rig.kinds.oswec_bench.sessions.files import is_session
from rig.kinds.wavebot.campaign import Campaign, CheckReport, Plan, check_campaign
from rig.kinds.wavebot.predictions import predict, unpredicted_reason
from rig.kinds.wavebot.rehearsal.job import problems
from rig.laws import OWN_MODULES


def examine(path: Path, rig: Path | None = None) -> CheckReport:
    """Check a campaign and all its input files, the simulated plant and predictions included.

    ``rig`` replaces the rig that the campaign names. Calibrations must be valid today (UTC).
    """
    today = datetime.now(UTC).date()
    report = check_campaign(path, extra_check=problems, predictor=predict, rig=rig, day=today)
    if report.campaign is None or report.plan is None:
        return report
    return report._replace(
        not_predicted=unpredicted_reason(report.campaign, report.plan),
        law_warnings=_compilation_warnings(report.campaign, report.plan),
    )


def _compilation_warnings(campaign: Campaign, planned: Plan) -> tuple[Problem, ...]:
    """Return a warning about a law that cannot be compiled; those of wec-rig can."""
    if not campaign.law.is_file and campaign.law.name in OWN_MODULES:
        return ()
    from rig.sweep.law_compilation import compilation_problem  # numba

    reason = compilation_problem(campaign, planned)
    if not reason:
        return ()
    message = f"the law cannot be compiled, so it runs interpreted and no sweep has it: {reason}"
    return (campaign.locate.problem(("law",), campaign.law.name, message),)


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
