"""Analysis of sessions of the bench: the results of a dynamometer run in the form of the OSWEC
thesis. As the room `products` (`rig.kinds.interface`), what a run, `rig show` and `rig plot` write.
"""

from collections.abc import Sequence
from pathlib import Path

from rig.analysis.run_products import DrawOptions, RunProducts, RunSummary
from rig.analysis.stop_reason import describe_ending, find_stop
from rig.kinds.oswec_bench.products.analyse import KINDS, Summary, analyse
from rig.processes.run_types import Outcome
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs import RunError, reader, run_info

__all__ = ["KINDS", "Summary", "after_run", "analyse", "draw", "summarise"]

PROGRESS = "analysing the session"
NO_PRODUCTS = RunProducts((), {"results": {}})


def after_run(folder: Path, outcome: Outcome) -> RunProducts:
    """Write results, report and calibration file of a finished session.

    A session that stopped early may have no results; that is no trouble.
    """
    complete = outcome.status == "complete"
    done = int(outcome.last_row.get("plan.row", 0))  # the rows before the one of the stop
    rows_done = None if complete else max(0, done)
    try:
        summary = analyse(folder)
    except (RunError, OSError, ValueError) as error:
        reason = f"no results: {error}"
        if complete:
            return NO_PRODUCTS._replace(trouble=reason)
        return NO_PRODUCTS._replace(text=reason, rows_done=rows_done)
    return RunProducts(
        tuple(summary.files), {"results": summary.as_dict()}, summary.as_text(), rows_done
    )


def summarise(
    run: Path, calibrations: Sequence[CalibrationVersion], *, incomplete_rows: bool
) -> RunSummary:
    """Return the results of a session, analysed again; rewrites its report and calibration file.

    Calibrations of the rig's quantities and incomplete rows do not apply to a session.
    """
    try:
        summary = analyse(run)
    except RunError as error:
        status = run_info(run).status
        ending = describe_ending(status, find_stop(run, status).lost)
        record = reader.check_record(run).sentence
        raise RunError(f"{ending.description}.\n{record}.\n{error}") from error
    return RunSummary(summary.as_text(), summary.as_dict())


def draw(run: Path, options: DrawOptions) -> list[Path]:
    """Write all results of a session and return the files; a session has no power surfaces."""
    if options.selects_surface or options.sort:
        raise ValueError("a session has no power surfaces and no bars; allowed --field, --row")
    return list(analyse(run).files)
