"""Entry point of the analysis: reads a session's run; writes tables, figures, page, calibration
file.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from rig.analysis.stop_reason import Ending, LostTicks, describe_ending, find_stop
from rig.kinds.oswec_bench.products import (
    brake_report,
    driveline_report,
    flap_decay_report,
    flap_pto_report,
    flap_rao_report,
    flap_stiffness_report,
    losses_report,
    torque_report,
    tracking_report,
    velocity_report,
)
from rig.kinds.oswec_bench.products.constants import FILE, read_constant, write_constants
from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.page import page_notes, write_page
from rig.kinds.oswec_bench.products.points import SessionRun, open_session, session_config
from rig.kinds.oswec_bench.products.result import FigureSpec, Result, format_estimate
from rig.kinds.oswec_bench.products.tables import result_as_dict, write_tables
from rig.presentation import picture
from rig.recording.runs import RunError
from rig.recording.runs.folder import RunInfo, list_runs, run_info
from rig.recording.runs.state import RecordState

_SINGLE_RUN: dict[str, Callable[[SessionRun], Result]] = {
    "torque_constant": torque_report.analyse_session,
    "velocity_constant": velocity_report.analyse_session,
    "brake_map": brake_report.analyse_session,
    "flap_hydrostatic": flap_stiffness_report.analyse_session,
    "flap_rao": flap_rao_report.analyse_session,
    "flap_pto_sweep": flap_pto_report.analyse_session,
}
_WITH_BASELINE: dict[str, Callable[[SessionRun, SessionRun | None], Result]] = {
    "driveline": driveline_report.analyse_session,
    "torque_tracking": tracking_report.analyse_session,
}
_WITH_CONSTANT: dict[str, tuple[Callable[[SessionRun, Estimate | None], Result], str, str]] = {
    "losses": (losses_report.analyse_session, "torque_constant", "torque_constant_motor"),
    "flap_free_decay": (flap_decay_report.analyse_session, "flap_hydrostatic", "flap_stiffness"),
}
KINDS = (*_SINGLE_RUN, *_WITH_BASELINE, *_WITH_CONSTANT)
"""Sessions that have an analysis."""


class Summary(NamedTuple):
    """Outcome of an analysis, for a terminal and for programs."""

    session: str
    run: str
    ending: Ending
    lost_ticks: LostTicks | None  # ticks lost before a trip, if they may be its cause
    record: RecordState
    result: Result
    notes: tuple[str, ...]
    files: tuple[Path, ...]

    @property
    def targets_met(self) -> bool:
        """Whether the run meets every target that it has."""
        return all(each.target_met is not False for each in self.result.comparisons)

    def as_text(self) -> str:
        """Return the summary as lines for a terminal."""
        marks = {True: "ok  ", False: "NOT ", None: "    "}
        width = max((len(each.quantity) for each in self.result.comparisons), default=0)
        lines = [
            f"session {self.session}, run {self.run}",
            f"{self.ending.description}.",
            f"{self.record.sentence}.",
        ]
        for each in self.result.comparisons:
            details = [f"{each.measured}"]
            details += [f"thesis: {each.thesis}"] if each.thesis else []
            details += [f"required: {each.target}"] if each.target else []
            lines.append(
                f"  {marks[each.target_met]}{each.quantity:<{width}}  {'; '.join(details)}"
            )
        lines += [f"  {name} = {format_estimate(c)}" for name, c in self.result.constants.items()]
        lines += [f"  note: {note}" for note in self.notes]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return the summary in the form of JSON, without the tables' columns."""
        document = result_as_dict(self.result)
        document.pop("tables")
        return {
            "session": self.session,
            "run": self.run,
            "ending": self.ending.description,
            "lost_ticks": self.lost_ticks and self.lost_ticks._asdict(),
            "record": self.record.as_dict(),
            "targets_met": self.targets_met,
            **document,
            "notes": list(self.notes),
            "written": [str(path) for path in self.files],
        }


def analyse(
    run_folder: str | os.PathLike[str], against: str | os.PathLike[str] | None = None
) -> Summary:
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
    ending = describe_ending(session.metadata.status, lost_ticks)
    attributes = {
        "session": session.kind,
        **session.metadata.attributes(),
        "ending": ending.description,
        **session.record.attributes(),
    }
    figures = [_draw_figure(each, attributes, folder) for each in result.figures]
    files = [
        *write_tables(result, attributes, folder),
        *write_constants(result, session, folder),
        *figures,
        write_page(result, session, ending, figures, folder),
    ]
    notes = tuple(page_notes(result, session))
    return Summary(
        session.kind,
        session.metadata.run,
        ending,
        lost_ticks,
        session.record,
        result,
        notes,
        tuple(files),
    )


def _result(session: SessionRun, run: Path, against: str | os.PathLike[str] | None) -> Result:
    if session.kind in _SINGLE_RUN:
        if against is not None:
            raise ValueError(f"a session {session.kind} takes no reference run")
        return _SINGLE_RUN[session.kind](session)
    if session.kind in _WITH_CONSTANT:
        analysis, kind, constant = _WITH_CONSTANT[session.kind]
        other = Path(against) if against is not None else _find_analysed_run(run, kind)
        return analysis(session, read_constant(other, constant) if other else None)
    if session.kind not in _WITH_BASELINE:
        raise ValueError(
            f"session {session.kind!r} has no analysis; known kinds: {', '.join(KINDS)}"
        )
    if against is not None:
        return _WITH_BASELINE[session.kind](session, open_session(against))
    other = None if _is_baseline(session_config(session.metadata)) else _find_baseline(session, run)
    return _WITH_BASELINE[session.kind](session, open_session(other) if other else None)


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
        if (each.path / FILE).is_file():
            config = session_config(run_info(each.path, ()))
            if config.get("session") == kind:
                return each.path
    return None


def _draw_figure(spec: FigureSpec, attributes: dict[str, Any], folder: Path) -> Path:
    figure, body = picture.framed_figure(*spec.size, spec.title, attributes, "", spec.caption)
    spec.draw(body)
    return picture.save(figure, folder / f"{spec.name}.png")
