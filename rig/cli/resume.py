"""`rig run --resume RUN`: the run that goes on, and the files with which it began."""

import sys
from datetime import UTC, datetime
from pathlib import Path

from rig.campaign.check import CheckReport
from rig.campaign.resume import Resumption, resume_campaign
from rig.cli.input_files import find_run
from rig.execution.task import other_mode_text
from rig.kinds.interface import Report
from rig.recording.runs import RunError, run_info
from rig.recording.runs.folder import MCAP, RECOVERED, STATUS, earlier_records
from rig.recording.runs.recover import recover
from rig.recording.runs.state import read_json
from rig.recording.runs.windows import ADAPTIVE


def named_files(
    name: Path, runs: Path, task: Path | None, rig: Path | None
) -> tuple[Path, Path, Path]:
    """Return the folder of a run with a finished record, its campaign file, and its rig file.

    ``task`` and ``rig``: files that a person names instead of those in the record. A run that was
    killed is recovered. Raises RunError for a run that goes on, or whose files are not there.
    """
    run = find_run(name, runs)
    if not run.is_dir():
        raise RunError(f"{run}: give the folder of the run, in which it goes on")
    if not (run / STATUS).is_file():
        raise RunError(f"{run}: it has no {STATUS}, so how it began is unknown")
    if read_json(run / STATUS).get("status") == "running" or not _has_record(run):
        _recover(run)
    recorded = {
        each["role"]: Path(each["path"]) for each in reversed(run_info(run).config["files"])
    }
    files = []
    for role, given in (("campaign", task), ("rig", rig)):
        file = given or recorded.get(role)
        if file is None:
            raise RunError(f"{run}: only campaigns have rows to go on with")
        if given is None and not file.is_file():
            option = "FILE" if role == "campaign" else "--rig"
            raise RunError(f"{run}: its {role} file {file} is not there; name it by {option}")
        files.append(file)
    return run, files[0], files[1]


def _recover(run: Path) -> None:
    """Finish the record of a run; it may have none if an earlier stage has one."""
    try:
        recover(run, None, datetime.now(UTC))
    except RunError as error:
        if not earlier_records(run):
            message = f"{error}; nothing was measured: run its campaign from the begin"
            raise RunError(message) from None


def _has_record(run: Path) -> bool:
    return any((run / name).is_file() for name in (MCAP, RECOVERED))


def is_emulated(run: Path, *, wired: bool, sim: bool) -> bool:
    """Return whether the next stage of a run needs emulated devices, as its stages before did.

    ``wired``: the rig has wires; ``sim``: the option --sim. Raises RunError for a stage in another
    execution mode, which would put measurements and simulation into one record.
    """
    before = run_info(run).mode
    if before == "hil" and not sim:
        print(f"{run.name}: devices are emulated, as in its stages before", file=sys.stderr)
    emulated = wired and (sim or before == "hil")
    mode = "hil" if emulated else "hardware" if wired else "rehearsal"
    if mode != before:
        raise RunError(other_mode_text(run, before, mode))
    return sim or emulated  # a rig without wires refuses --sim itself


def with_recorded_start(report: Report, run: Path) -> Report:
    """Return the report with the predicted powers from which an adaptive run chose its rows."""
    if not isinstance(report, CheckReport):
        return report
    recorded = run_info(run).plan.get(ADAPTIVE, {})
    return report._replace(recorded_powers=recorded.get("predicted", {}))


def rest_of_run(report: Report, run: Path, *, accept_changes: bool) -> Resumption:
    """Return the rows that a run lacks, of the campaign of a report without problems.

    Raises RunError for a run that cannot go on with these files.
    """
    if not isinstance(report, CheckReport) or report.campaign is None:
        raise RunError(f"{run}: only campaigns have rows to go on with")
    rest = resume_campaign(run, report.campaign, accept_changes=accept_changes)
    left, rows = len(rest.plan.rows) - len(rest.measured.rows), len(rest.plan.rows)
    print(f"{run.name}: {left} of {rows} rows are still to be measured", file=sys.stderr)
    return rest
