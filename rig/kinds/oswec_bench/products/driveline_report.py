"""The driveline session: tables, comparisons, constants and figures in one result."""

from rig.kinds.oswec_bench.products import driveline, driveline_figures, driveline_tables
from rig.kinds.oswec_bench.products.points import SessionRun
from rig.kinds.oswec_bench.products.result import Result


def analyse_session(session: SessionRun, baseline: SessionRun | None = None) -> Result:
    """Analyse a run; ``baseline`` is a run of the same rows without correction."""
    result = driveline.analyse_driveline(session, baseline)
    if not (result.uncorrected or result.corrected):
        raise ValueError("no set point was measured completely")
    return Result(
        driveline_tables.tables(result),
        driveline_tables.comparisons(result),
        driveline_tables.constants(result),
        driveline_figures.figures(result),
        _notes(session, baseline, result),
        driveline_tables.calibration_maps(result),
    )


def _notes(
    session: SessionRun, baseline: SessionRun | None, result: driveline.DrivelineResult
) -> tuple[str, ...]:
    lines = [
        "The phase shift compares fundamentals, the amplitude difference half strokes, "
        "period by period. Drift is the slope of period means.",
    ]
    if baseline is not None:
        lines.append(f"Uncorrected set points are those of run {baseline.metadata.run}.")
    elif result.corrected and not result.schemes:
        lines.append(
            "Corrected set points are not rated: there is no uncorrected run to compare them with."
        )
    saturated = [p.row for p in session.points if p.limited_ticks]
    if saturated:
        lines.append(f"Commands were limited in rows {', '.join(map(str, saturated))}.")
    if result.torque_map is not None:
        residual_mdeg = 1e3 * result.torque_map.residual / driveline.DEGREE
        lines.append(
            f"The map leaves {residual_mdeg:.2f} mdeg rms of the binned deflection unexplained."
        )
    return tuple(lines)
