"""The door: a session's run in, its tables, figures, page and calibration file out."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from rig.analysis import picture
from rig.analysis.session import (
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
from rig.analysis.session.constants import FILE, known_constant, write_constants
from rig.analysis.session.estimate import Estimate
from rig.analysis.session.page import notes, write_page
from rig.analysis.session.points import Session, open_session, session_of
from rig.analysis.session.result import Picture, Result, words
from rig.analysis.session.tables import as_json, write_tables
from rig.analysis.stop_reason import Ending, LostTicks, ending_of, stop_of
from rig.recording.runs import RunError
from rig.recording.runs.folder import Facts, facts, list_runs
from rig.recording.runs.state import RecordState

_ALONE: dict[str, Callable[[Session], Result]] = {
    "torque_constant": torque_report.result,
    "velocity_constant": velocity_report.result,
    "brake_map": brake_report.result,
    "flap_hydrostatic": flap_stiffness_report.result,
    "flap_rao": flap_rao_report.result,
    "flap_pto_sweep": flap_pto_report.result,
}
_AGAINST: dict[str, Callable[[Session, Session | None], Result]] = {
    "driveline": driveline_report.result,
    "torque_tracking": tracking_report.result,
}
_WITH: dict[str, tuple[Callable[[Session, Estimate | None], Result], str, str]] = {
    "losses": (losses_report.result, "torque_constant", "torque_constant_motor"),
    "flap_free_decay": (flap_decay_report.result, "flap_hydrostatic", "flap_stiffness"),
}
KINDS = (*_ALONE, *_AGAINST, *_WITH)
"""Sessions that have an analysis."""


class Summary(NamedTuple):
    """What came of it, for a terminal and for programs."""

    session: str
    run: str
    ending: Ending
    lost_ticks: LostTicks | None  # before a trip, where they may be its cause
    record: RecordState
    result: Result
    notes: tuple[str, ...]
    written: tuple[Path, ...]

    @property
    def held(self) -> bool:
        """Whether everything that was asked of the run holds."""
        return all(each.held is not False for each in self.result.compared)

    def as_text(self) -> str:
        """Lines for a terminal."""
        marks = {True: "ok  ", False: "NOT ", None: "    "}
        wide = max((len(each.quantity) for each in self.result.compared), default=0)
        lines = [
            f"session {self.session}, run {self.run}",
            f"{self.ending.description}.",
            f"{self.record.sentence}.",
        ]
        for each in self.result.compared:
            told = [f"{each.found}"]
            told += [f"thesis: {each.thesis}"] if each.thesis else []
            told += [f"wanted: {each.wanted}"] if each.wanted else []
            lines.append(f"  {marks[each.held]}{each.quantity:<{wide}}  {'; '.join(told)}")
        lines += [f"  {name} = {words(c)}" for name, c in self.result.constants.items()]
        lines += [f"  note: {note}" for note in self.notes]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """The same as JSON can hold it, without tables' columns."""
        told = as_json(self.result)
        told.pop("tables")
        return {
            "session": self.session,
            "run": self.run,
            "ending": self.ending.description,
            "lost_ticks": self.lost_ticks and self.lost_ticks._asdict(),
            "record": self.record.as_dict(),
            "held": self.held,
            **told,
            "notes": list(self.notes),
            "written": [str(path) for path in self.written],
        }


def analyse(
    run_folder: str | os.PathLike[str], against: str | os.PathLike[str] | None = None
) -> Summary:
    """Analyse a session's run and write everything into its folder.

    ``against``: the run without correction, or in open loop, by which a corrected or closed-loop
    one is judged; for losses, the analysed torque constant run whose constant of the motor they
    rest on; for a free decay, the analysed hydrostatic run whose spring makes moments of it. If not
    given, the newest such run beside it. RunError for a run that is no
    session's, or of which nothing can be made; the message says why.
    """
    run = Path(run_folder)
    session = open_session(run)
    try:
        result = _result(session, run, against)
    except ValueError as error:
        raise RunError(f"{run}: {error}") from error
    folder = run if run.is_dir() else run.parent
    lost = stop_of(run, session.known.status).lost
    ending = ending_of(session.known.status, lost)
    told = {
        "session": session.kind,
        **session.known.attributes(),
        "ending": ending.description,
        **session.record.attributes(),
    }
    pictures = [_draw(each, told, folder) for each in result.pictures]
    written = [
        *write_tables(result, told, folder),
        *write_constants(result, session, folder),
        *pictures,
        write_page(result, session, ending, pictures, folder),
    ]
    said = tuple(notes(result, session))
    return Summary(
        session.kind,
        session.known.run,
        ending,
        lost,
        session.record,
        result,
        said,
        tuple(written),
    )


def _result(session: Session, run: Path, against: str | os.PathLike[str] | None) -> Result:
    if session.kind in _ALONE:
        if against is not None:
            raise ValueError(f"a session {session.kind} is not judged against another run")
        return _ALONE[session.kind](session)
    if session.kind in _WITH:
        make, kind, constant = _WITH[session.kind]
        other = Path(against) if against is not None else _with_constants(run, kind)
        return make(session, known_constant(other, constant) if other else None)
    if session.kind not in _AGAINST:
        raise ValueError(f"session {session.kind!r} has no analysis; there are {', '.join(KINDS)}")
    if against is not None:
        return _AGAINST[session.kind](session, open_session(against))
    other = None if _plain(session_of(session.known)) else _beside(session, run)
    return _AGAINST[session.kind](session, open_session(other) if other else None)


def _plain(told: dict[str, Any]) -> bool:
    """Whether a session file asks for neither correction nor feedback."""
    correction = told.get("correction") or "none"
    kind = correction.get("kind") if isinstance(correction, dict) else correction
    return kind == "none" and told.get("control", "open loop") == "open loop"


def _beside(session: Session, run: Path) -> Path | None:
    """The plain run of this kind that a run is judged by, of those beside it.

    One whose drive was commanded by the same constants, or a better constant would be taken for a
    correction; else the one that the correction was made from; else the newest.
    """
    mine = session_of(session.known)
    named = (session.known.config.get("calibration_runs") or {}).values()
    regular = mine.get("irregular") is None
    found = []
    for each in list_runs(run.resolve().parent)[::-1]:
        if each.status != "complete" or each.path.resolve() == run.resolve():
            continue
        other = facts(each.path, ())
        told = session_of(other)
        same = told.get("session") == session.kind and (told.get("irregular") is None) == regular
        if same and _plain(told):
            driven = _scales(facts(each.path)) == _scales(session.known)
            found.append((not driven, each.run not in named, each.path))
    found.sort(key=lambda each: each[:2])
    return found[0][2] if found else None


def _scales(known: Facts) -> dict[str, Any]:
    """The constants that a run's drive was commanded by."""
    told = known.plan.get("scales") or {}
    return {key: value for key, value in told.items() if key != "origin"}


def _with_constants(run: Path, kind: str) -> Path | None:
    """The newest analysed run of a kind of session beside a run."""
    for each in list_runs(run.resolve().parent)[::-1]:
        if (each.path / FILE).is_file():
            told = session_of(facts(each.path, ()))
            if told.get("session") == kind:
                return each.path
    return None


def _draw(of: Picture, told: dict[str, Any], folder: Path) -> Path:
    figure, body = picture.framed(*of.size, of.title, told, "", of.caption)
    of.draw(body)
    return picture.save(figure, folder / f"{of.name}.png")
