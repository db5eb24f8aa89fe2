"""The response session of the flap: its response amplitude operator over period or frequency."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.kinds.oswec_bench.products import flap_rao, periods
from rig.kinds.oswec_bench.products.drawing import RED, annotate_corner, prepare_axes, shade
from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.flap_rao import Resonance, ResponseLine
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import (
    Column,
    Comparison,
    FigureSpec,
    Result,
    Table,
    format_estimate,
    format_number,
)


class ResponseCurve(NamedTuple):
    """All lines of one wave amplitude (regular), or of one row (irregular), by frequency."""

    label: str
    suffix: str  # of the names of its constants
    lines: list[ResponseLine]
    resonance: Resonance | None


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run in regular waves, or in an irregular sea."""
    responses_by_point = [
        (point, setpoint_response(point))
        for point in session.complete_points
        if point.plan_row.get("sea")
    ]
    if not responses_by_point:
        raise ValueError("no set point with waves was measured completely")
    curves = (
        _curves_by_row(responses_by_point)
        if session.irregular
        else _curves_by_amplitude(responses_by_point)
    )
    constants: dict[str, Estimate] = {}
    for each in curves:
        if each.resonance is not None:
            constants[f"flap_rao_period{each.suffix}"] = each.resonance.period
            constants[f"flap_rao_top{each.suffix}"] = each.resonance.peak
    return Result(
        (_table(curves),),
        _comparisons(curves),
        constants,
        (
            FigureSpec(
                "flap_rao",
                "Response amplitude operator of the flap",
                "Points with 95 % intervals; lines: the fitted resonance.",
                (7.4, 5.8),
                partial(_draw_response, curves),
            ),
        ),
        (
            "Waves are those requested from the wave maker, calibrated without the flap; a "
            "positive phase leads the crest at the hinge.",
        ),
    )


def setpoint_response(point: SetpointData) -> list[ResponseLine]:
    """Return the response at the lines of a set point's sea, drift removed."""
    cut = point.whole_periods()
    edges = cut.edges - cut.edges[0]
    angle = periods.detrend(point.shaft, cut)
    return flap_rao.response_lines(
        angle, edges, point.plan_row["sea"], point.wave_clock - point.encoder_age, point.dt
    )


def _curves_by_amplitude(
    responses: list[tuple[SetpointData, list[ResponseLine]]],
) -> list[ResponseCurve]:
    lines_by_amplitude: dict[float, list[ResponseLine]] = {}
    for point, lines in responses:
        lines_by_amplitude.setdefault(point.plan_value("wave_amplitude_m"), []).extend(lines)
    curves = []
    for wave, lines in sorted(lines_by_amplitude.items()):
        lines.sort(key=lambda each: each.frequency)
        suffix = "" if len(lines_by_amplitude) == 1 else f"_{round(1e3 * wave)}mm"
        curves.append(
            ResponseCurve(f"{1e3 * wave:g} mm", suffix, lines, flap_rao.fit_resonance(lines))
        )
    return curves


def _curves_by_row(responses: list[tuple[SetpointData, list[ResponseLine]]]) -> list[ResponseCurve]:
    curves = []
    for point, lines in responses:
        suffix = "" if len(responses) == 1 else f"_row{point.row}"
        crest = 1e3 * point.plan_value("wave_amplitude_m")
        curves.append(
            ResponseCurve(
                f"irregular, crest {crest:g} mm", suffix, lines, flap_rao.fit_resonance(lines)
            )
        )
    return curves


def _table(curves: list[ResponseCurve]) -> Table:
    rows = [(each, line) for each in curves for line in each.lines]
    lines = [line for _, line in rows]
    return Table(
        "flap_rao",
        "Response amplitude operator",
        (
            Column("waves", "", tuple(each.label for each, _ in rows)),
            Column("frequency", "Hz", tuple(line.frequency for line in lines)),
            Column("period", "s", tuple(1.0 / line.frequency for line in lines)),
            Column("wave amplitude", "m", tuple(line.wave_amplitude for line in lines)),
            Column(
                "amplitude of the flap",
                "deg",
                tuple(
                    float(np.degrees(line.wave_amplitude * line.magnitude.value)) for line in lines
                ),
            ),
            Column("response", "rad/m", tuple(line.magnitude.value for line in lines)),
            Column("response ±", "rad/m", tuple(line.magnitude.uncertainty for line in lines)),
            Column("phase", "deg", tuple(float(np.degrees(np.angle(e.response))) for e in lines)),
        ),
    )


def _comparisons(curves: list[ResponseCurve]) -> tuple[Comparison, ...]:
    comparisons = []
    for each in curves:
        if each.resonance is None:
            continue
        resonance = each.resonance
        measured = f"{format_estimate(resonance.peak)} at {format_estimate(resonance.period)}"
        measured += f"; rms error of points {format_number(100.0 * resonance.relative_rms, 2)} %"
        comparisons.append(
            Comparison(f"peak of the response, waves {each.label}", "not run", "", measured, None)
        )
    return tuple(comparisons)


def _draw_response(curves: list[ResponseCurve], body: SubFigure) -> None:
    upper, lower = body.subplots(2, 1, sharex=True, height_ratios=[1.7, 1.0])
    upper = prepare_axes(body, "", "response, rad/m", upper)
    lower = prepare_axes(body, "frequency, Hz", "phase, deg", lower)
    for i, each in enumerate(curves):
        colour = shade(i + 1, len(curves) + 1) if len(curves) > 1 else "#0b6e99"
        f = np.array([line.frequency for line in each.lines])
        magnitude = [line.magnitude.value for line in each.lines]
        half_widths = np.nan_to_num([line.magnitude.uncertainty for line in each.lines])
        upper.errorbar(
            f, magnitude, half_widths, fmt="o", ms=4, capsize=2.5, color=colour, label=each.label
        )
        phase = np.degrees(np.unwrap([np.angle(line.response) for line in each.lines]))
        lower.plot(f, phase - 360.0 * np.round(phase[0] / 360.0), "o-", ms=4, lw=0.8, color=colour)
        if each.resonance is not None:
            frequency_grid = np.linspace(f.min(), f.max(), 400)
            y = flap_rao.fitted_magnitude(each.resonance.unknowns, 2.0 * np.pi * frequency_grid)
            upper.plot(frequency_grid, y, color=RED if len(curves) == 1 else colour, lw=1.2)
    peaks = [
        f"{each.label}: peak {format_estimate(each.resonance.peak)} "
        f"at {format_estimate(each.resonance.period)}"
        for each in curves
        if each.resonance is not None
    ]
    annotate_corner(upper, "\n".join(peaks), "upper right")
    upper.set_ylim(0.0, None)
    upper.legend(frameon=False, fontsize=8, title="waves", title_fontsize=8, loc="lower left")
