"""Entry point of the analysis: reads a session's run; writes tables, figures, page, calibration
file.
"""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

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
from rig.kinds.oswec_bench.products.constants import FILE, read_constant, write_constants
from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.points import SessionRun, open_session, session_config
from rig.kinds.oswec_bench.products.report import (
    page_notes,
    result_as_dict,
    write_page,
    write_tables,
)
from rig.kinds.oswec_bench.products.result import Result
from rig.recording.runs import RunError, RunInfo, list_runs, run_info
from rig.recording.runs.state import RecordState

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


_motor_constant = partial(_constant, "torque_constant", "torque_constant_motor")
_flap_stiffness = partial(_constant, "flap_hydrostatic", "flap_stiffness")
_ANALYSES: dict[str, tuple[Callable[..., Result], Callable[..., Any] | None]] = {
    "torque_constant": (torque_constant.analyse_session, None),
    "velocity_constant": (velocity_constant.analyse_session, None),
    "brake_map": (brake_map.analyse_session, None),
    "flap_hydrostatic": (flap_stiffness.analyse_session, None),
    "flap_rao": (flap_rao.analyse_session, None),
    "flap_pto_sweep": (flap_pto.analyse_session, None),
    "driveline": (driveline_report.analyse_session, _baseline),
    "torque_tracking": (tracking.analyse_session, _baseline),
    "losses": (losses.analyse_session, _motor_constant),
    "flap_free_decay": (flap_decay.analyse_session, _flap_stiffness),
}
"""Analysis of each kind of session, and the reference that it takes as second argument."""
KINDS = tuple(_ANALYSES)
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
        lines += [f"  {name} = {each}" for name, each in self.result.constants.items()]
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
    ending = describe_ending(session.metadata.status, lost_ticks)
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


def _result(session: SessionRun, run: Path, against: Against) -> Result:
    if session.kind not in _ANALYSES:
        raise ValueError(
            f"session {session.kind!r} has no analysis; known kinds: {', '.join(KINDS)}"
        )
    analysis, reference = _ANALYSES[session.kind]
    if reference is not None:
        return analysis(session, reference(session, run, against))
    if against is not None:
        raise ValueError(f"a session {session.kind} takes no reference run")
    return analysis(session)


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
