"""The driveline session: everything of it in one result."""

from rig.analysis.session import driveline, driveline_figures, driveline_tables
from rig.analysis.session.points import Session
from rig.analysis.session.result import Result


def result(session: Session, against: Session | None = None) -> Result:
    """Analyse a run; ``against`` is a run of the same rows without correction."""
    found = driveline.find(session, against)
    if not (found.plain or found.corrected):
        raise ValueError("no set point was measured to its end")
    return Result(
        driveline_tables.tables(found),
        driveline_tables.compared(found),
        driveline_tables.constants(found),
        driveline_figures.pictures(found),
        _notes(session, against, found),
        driveline_tables.maps(found),
    )


def _notes(session: Session, against: Session | None, found: driveline.Found) -> tuple[str, ...]:
    out = [
        "Phase shift is that of the fundamentals, amplitude difference that of half strokes, "
        "period by period. Drift is the slope of period means.",
    ]
    if against is not None:
        out.append(f"Uncorrected set points are those of run {against.known.run}.")
    elif found.corrected and not found.schemes:
        out.append("Corrected set points stand alone: no uncorrected run to judge them by.")
    saturated = [p.row for p in session.points if p.limited]
    if saturated:
        out.append(f"Commands were limited in rows {', '.join(map(str, saturated))}.")
    if found.known is not None:
        rest = 1e3 * found.known.residual / driveline.DEGREE
        out.append(f"The map leaves {rest:.2f} mdeg rms of the binned deflection unexplained.")
    return tuple(out)
