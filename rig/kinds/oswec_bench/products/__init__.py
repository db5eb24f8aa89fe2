"""Analysis of sessions of the bench: the results of a dynamometer run in the form of the OSWEC
thesis, as tables, figures, page and calibration file. As the room `products`
(`rig.kinds.interface`), what a run, `rig show` and `rig plot` write.

A new kind of session is one module of this package and one row of the table below. The module's
`analyse_session(session)` returns a `Result` (`result.py`) of these parts:

- a table: its rows, and a function of a row by heading, such as ``"period [s]": lambda point:
  point.period``; a column of estimates has a second one with their half widths;
- ``compare(quantity, measured, thesis, target, target_met)``: a line of the comparison;
- ``@figures.figure(title, caption, axes=(x, y, ...))`` on a function that draws into axes: a
  figure, whose file has the function's name;
- constants: an `Estimate` by name.

`report.py` writes all of them as page, CSV, NetCDF and JSON, and the calibration file. An analysis
that needs another run has a row in a second table: the baseline, or a constant of an analysed run.
"""

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from rig.analysis.run_products import DrawOptions, RunProducts, RunSummary
from rig.analysis.stop_reason import Ending, LostTicks, describe_ending, find_stop
from rig.kinds.oswec_bench.products import (
    brake_map,
    driveline_report,
    flap_decay,
    flap_pto,
    flap_rao,
    flap_stiffness,
    losses,
    torque_constant,
    tracking,
    velocity_constant,
)
from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.points import SessionRun, open_session, session_config
from rig.kinds.oswec_bench.products.report import (
    CALIBRATION,
    page_notes,
    read_constant,
    result_as_dict,
    write_constants,
    write_page,
    write_tables,
)
from rig.kinds.oswec_bench.products.result import Result
from rig.processes.run_types import Outcome
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs import RunError, RunInfo, list_runs, reader, run_info

PROGRESS = "analysing the session"
NO_PRODUCTS = RunProducts((), {"results": {}})

Against = str | os.PathLike[str] | None
"""The reference run that a caller asks for."""


def _baseline(session: SessionRun, run: Path, against: Against) -> SessionRun | None:
    """Return the run without correction or in open loop that serves as the baseline."""
    if against is None and not _is_baseline(session_config(session.metadata)):
        against = _find_baseline(session, run)
    return open_session(against) if against is not None else None


def _constant(
    kind: str, name: str, _session: SessionRun, run: Path, against: Against
) -> Estimate | None:
    """Return a constant from the newest analysed run of a kind of session in the same folder."""
    other = Path(against) if against is not None else _find_analysed_run(run, kind)
    return read_constant(other, name) if other else None


_ANALYSES: dict[str, ModuleType] = {
    "torque_constant": torque_constant,
    "velocity_constant": velocity_constant,
    "brake_map": brake_map,
    "flap_hydrostatic": flap_stiffness,
    "flap_rao": flap_rao,
    "flap_pto_sweep": flap_pto,
    "driveline": driveline_report,
    "torque_tracking": tracking,
    "losses": losses,
    "flap_free_decay": flap_decay,
}
"""The module whose `analyse_session` analyses a kind of session."""
_REFERENCES: dict[str, Callable[[SessionRun, Path, Against], Any]] = {
    "driveline": _baseline,
    "torque_tracking": _baseline,
    "losses": partial(_constant, "torque_constant", "torque_constant_motor"),
    "flap_free_decay": partial(_constant, "flap_hydrostatic", "flap_stiffness"),
}
"""The reference that the analysis of a kind takes as its second argument."""
KINDS = tuple(_ANALYSES)
"""Sessions that have an analysis."""


class Summary(NamedTuple):
    """Outcome of an analysis, for a terminal and for programs."""

    session: SessionRun
    ending: Ending
    lost_ticks: LostTicks | None  # ticks lost before a trip, if they may be its cause
    result: Result
    notes: tuple[str, ...]
    files: tuple[Path, ...]

    @property
    def targets_met(self) -> bool:
        """Whether the run meets every target that it has."""
        return all(each.target_met is not False for each in self.result.comparisons)

    def as_text(self) -> str:
        """Return the summary as lines for a terminal."""
        marks = {"met": "ok  ", "missed": "NOT ", "undecided": "?   ", "": "    "}
        width = max((len(each.quantity) for each in self.result.comparisons), default=0)
        lines = [
            f"session {self.session.kind}, run {self.session.metadata.run}",
            f"{self.ending.description}.",
            *self.ending.hints,
            f"{self.session.record.sentence}.",
        ]
        for each in self.result.comparisons:
            details = [f"{each.measured}"]
            details += [f"thesis: {each.thesis}"] if each.thesis else []
            details += [f"required: {each.target}"] if each.target else []
            details += ["undecided"] if each.verdict == "undecided" else []
            lines.append(f"  {marks[each.verdict]}{each.quantity:<{width}}  {'; '.join(details)}")
        lines += [f"  {name} = {each}" for name, each in self.result.constants.items()]
        lines += [f"  note: {note}" for note in self.notes]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return the summary in the form of JSON, without the tables' columns."""
        document = result_as_dict(self.result)
        document.pop("tables")
        return {
            "session": self.session.kind,
            "run": self.session.metadata.run,
            "ending": self.ending.description,
            "lost_ticks": self.lost_ticks and self.lost_ticks._asdict(),
            "record": self.session.record.as_dict(),
            "targets_met": self.targets_met,
            **document,
            "notes": list(self.notes),
            "written": [str(path) for path in self.files],
        }


def analyse(run_folder: str | os.PathLike[str], against: Against = None) -> Summary:
    """Analyse a session's run and write all results into its folder.

    ``against`` names the reference run. For a corrected or closed-loop run it is the run without
    correction or in open loop that serves as the baseline; for losses, the analysed torque constant
    run that supplies the motor's constant; for a free decay, the analysed hydrostatic run whose
    spring converts the results to moments. By default it is the newest such run in the same parent
    folder. Raises RunError if the run is not a session's, or if it has no usable set point; the
    message gives the reason.
    """
    run = Path(run_folder)
    session = open_session(run)
    try:
        result = _result(session, run, against)
    except ValueError as error:
        raise RunError(f"{run}: {error}") from error
    folder = run if run.is_dir() else run.parent
    lost_ticks = find_stop(run, session.metadata.status).lost
    ending = describe_ending(session.metadata.status, lost_ticks, session.metadata.reasons)
    attributes = {
        "session": session.kind,
        **session.metadata.attributes(),
        "ending": ending.description,
        **session.record.attributes(),
    }
    figures = [each.save(attributes, folder) for each in result.figures]
    files = [
        *write_tables(result, attributes, folder),
        *write_constants(result, session, folder),
        *figures,
        write_page(result, session, ending, figures, folder),
    ]
    notes = tuple(page_notes(result, session))
    return Summary(session, ending, lost_ticks, result, notes, tuple(files))


def _result(session: SessionRun, run: Path, against: Against) -> Result:
    reference = _REFERENCES.get(session.kind)
    if reference is None and against is not None:
        raise ValueError(f"a session {session.kind} takes no reference run")
    return session_result(
        session, *([] if reference is None else [reference(session, run, against)])
    )


def session_result(session: SessionRun, *reference: Any) -> Result:
    """Return the result of a session; ``reference``: of `_REFERENCES`, by default none.

    Raises ValueError if the session has no analysis, or its set points give no result.
    """
    if session.kind not in _ANALYSES:
        raise ValueError(
            f"session {session.kind!r} has no analysis; known kinds: {', '.join(KINDS)}"
        )
    result: Result = _ANALYSES[session.kind].analyse_session(session, *reference)
    return result


def _is_baseline(config: dict[str, Any]) -> bool:
    """Return whether a session file has neither correction nor feedback."""
    correction = config.get("correction") or "none"
    kind = correction.get("kind") if isinstance(correction, dict) else correction
    return kind == "none" and config.get("control", "open loop") == "open loop"


def _find_baseline(session: SessionRun, run: Path) -> Path | None:
    """Return the uncorrected run of this kind, in the same parent folder, that serves as the
    baseline.

    A run whose drive was commanded by the same constants comes first, since a better constant would
    look like a correction; then the run that the correction was computed from; then the newest.
    """
    config = session_config(session.metadata)
    calibration_runs = (session.metadata.config.get("calibration_runs") or {}).values()
    regular = config.get("irregular") is None
    candidates = []
    for each in list_runs(run.resolve().parent)[::-1]:
        if each.status != "complete" or each.path.resolve() == run.resolve():
            continue
        other_metadata = run_info(each.path, ())
        other_config = session_config(other_metadata)
        same_kind = (
            other_config.get("session") == session.kind
            and (other_config.get("irregular") is None) == regular
        )
        if same_kind and _is_baseline(other_config):
            same_scales = _command_scales(run_info(each.path)) == _command_scales(session.metadata)
            candidates.append((not same_scales, each.run not in calibration_runs, each.path))
    candidates.sort(key=lambda each: each[:2])
    return candidates[0][2] if candidates else None


def _command_scales(metadata: RunInfo) -> dict[str, Any]:
    """Return the constants by which a run's drive was commanded."""
    scales = metadata.plan.get("scales") or {}
    return {key: value for key, value in scales.items() if key != "origin"}


def _find_analysed_run(run: Path, kind: str) -> Path | None:
    """Return the newest analysed run of a kind of session in the parent folder of a run."""
    for each in list_runs(run.resolve().parent)[::-1]:
        if (each.path / CALIBRATION).is_file():
            config = session_config(run_info(each.path, ()))
            if config.get("session") == kind:
                return each.path
    return None


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
        facts = run_info(run)
        lost_ticks = find_stop(run, facts.status).lost
        ending = describe_ending(facts.status, lost_ticks, facts.reasons)
        record = reader.check_record(run).sentence
        lines = (f"{ending.description}.", *ending.hints, f"{record}.", str(error))
        raise RunError("\n".join(lines)) from error
    return RunSummary(summary.as_text(), summary.as_dict())


def draw(run: Path, options: DrawOptions) -> list[Path]:
    """Write all results of a session and return the files; a session has no power surfaces."""
    if options.selects_surface or options.sort:
        raise ValueError("a session has no power surfaces and no bars; allowed --field, --row")
    return list(analyse(run).files)
