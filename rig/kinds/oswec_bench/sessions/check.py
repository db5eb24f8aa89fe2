"""The report of `rig check SESSION`: every problem, or rows, phases and duration of the session."""

import json
from pathlib import Path
from typing import Any, NamedTuple

from rig.config.problems import ConfigError, Problem, display_path, problems_text
from rig.kinds.oswec_bench.config.session_file import SESSION_COLUMNS, SESSION_KINDS, SessionFile
from rig.kinds.oswec_bench.sessions.files import FurtherCheck, Session, open_session
from rig.kinds.oswec_bench.sessions.plan import SessionPlan, plan_session
from rig.presentation.phrases import format_duration


class SessionReport(NamedTuple):
    """Outcome of checking a session file; without problems it holds session and plan."""

    path: Path
    problems: tuple[Problem, ...]
    checked: Session | None
    plan: SessionPlan | None
    warnings: tuple[Problem, ...] = ()  # there are none about a session that can be run
    unchecked: tuple[str, ...] = ()  # checks that the problems prevented

    @property
    def ok(self) -> bool:
        """True if the session can be run."""
        return not self.problems

    def summary(self) -> list[tuple[str, str]]:
        """Return the summary as pairs of label and text; it is empty if the files have problems."""
        if self.checked is None or self.plan is None:
            return []
        session, plan = self.checked, self.plan
        file, rig, constants = session.file, session.rig, session.constants
        phases = (f"{name} {s:.6g} s" for name, s in plan.phases.items())
        return [
            ("session", f"{file.name} ({file.session}) on {rig.name}, {rig.rate_hz} Hz"),
            ("drive", _describe_drive(session)),
            ("rows", f"{len(plan.rows)}: {_describe_columns(session)}"),
            (
                "measured",
                f"{plan.rows[0].periods} periods a row, {plan.phases['measure']:.6g} s in all",
            ),
            ("duration", f"{format_duration(plan.duration)} and waiting for the drive"),
            ("phases", ", ".join(phases)),
            (
                "constants",
                f"torque {constants.torque_positive:g} / {constants.torque_negative:g} N*m/A, "
                f"velocity {constants.velocity:g} rad/s/V",
            ),
            *[("", f"{name}: {run}") for name, run in constants.origin.items()],
            *[
                ("by", f"correction.{key}: run {run}")
                for key, run in session.correction.runs.items()
            ],
        ]

    def text(self) -> str:
        """Return the report for people: one problem a line, or the summary."""
        if self.problems:
            return problems_text(self.problems, self.unchecked)
        sources = (
            [(f.role, display_path(f.path)) for f in self.checked.files] if self.checked else []
        )
        return "\n".join(f"{label:11} {text}" for label, text in [*self.summary(), *sources])

    def to_json(self) -> str:
        """Return the report for programs: `ok`, `problems`, rows, phases, duration and files."""
        document: dict[str, Any] = {
            "file": display_path(self.path),
            "ok": self.ok,
            "problems": [problem.as_dict() for problem in self.problems],
            "unchecked": list(self.unchecked),
        }
        if self.checked is not None and self.plan is not None:
            file, plan = self.checked.file, self.plan
            document |= {
                "name": file.name,
                "session": file.session,
                "rig": self.checked.rig.name,
                "rate_hz": self.checked.rig.rate_hz,
                "loop": file.loop,
                "correction": file.correction.kind,
                "rows": [row.values for row in plan.rows],
                "periods_per_row": file.timing.periods,
                "measured_s": plan.phases["measure"],
                "duration_s": plan.duration,
                "phases_s": plan.phases,
                "constants": self.checked.constants.origin,
                "files": [file.as_dict() for file in self.checked.files],
            }
        return json.dumps(document, ensure_ascii=False, allow_nan=False)


def check_session(
    path: Path, further_check: FurtherCheck | None = None, rig: Path | None = None
) -> SessionReport:
    """Check a session file and all files that it refers to.

    No hardware is needed, and no error is raised for the contents of a file. ``further_check`` adds
    the problems of a further check, such as that of the simulated plant; ``rig`` replaces the rig
    that the session names.
    """
    path = Path(path)
    try:
        session = open_session(path, further_check, rig)
    except ConfigError as error:
        return SessionReport(path, error.problems, None, None, unchecked=error.unchecked)
    return SessionReport(path, (), session, plan_session(session))


_COUPLING = {"free": "removed", "coupled": "installed"}


def _describe_drive(session: Session) -> str:
    file: SessionFile = session.file
    demand = SESSION_KINDS[file.session]
    if demand.flap_coupling and file.loop == "torque":
        drive = "as a damper" if demand.required_columns else "without torque"
        flap_motion = "by hand" if not demand.needs_waves else "in waves"
        flap_motion += "" if file.irregular is None else ", irregular"
        coupling = _COUPLING[demand.flap_coupling]
        return f"torque loop, {drive}; flap moved {flap_motion}, rigid coupling {coupling}"
    if file.loop == "torque":
        return f"torque loop, {file.control}, shaft {file.shaft}"
    motion = "sine" if file.irregular is None else "irregular"
    return f"velocity loop, {motion}, correction: {file.correction.kind}"


def _describe_columns(session: Session) -> str:
    descriptions = []
    for column in SESSION_COLUMNS:
        values = [p.values[column.name] for p in session.points if column.name in p.values]
        if values:
            low, high = min(values), max(values)
            span = f"{low:g}" if low == high else f"{low:g} .. {high:g}"
            descriptions.append(f"{column.label} {span} {column.unit}")
    return ", ".join(descriptions)
