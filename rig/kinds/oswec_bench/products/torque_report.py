"""The torque constant session: Table 3.1 and Figures 3.1 to 3.3 of the OSWEC thesis."""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.patches import Rectangle

from rig.kinds.oswec_bench.products import thesis, torque_constant
from rig.kinds.oswec_bench.products.drawing import (
    BLUE,
    CLOCKWISE,
    COUNTER,
    RED,
    annotate_corner,
    prepare_axes,
    shade,
)
from rig.kinds.oswec_bench.products.estimate import Floats, mean
from rig.kinds.oswec_bench.products.linear_fit import value_at
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.quarters import FitDomain
from rig.kinds.oswec_bench.products.result import (
    Column,
    Comparison,
    FigureSpec,
    Result,
    Table,
    format_estimate,
    format_number,
)
from rig.kinds.oswec_bench.products.torque_constant import RampFits, TorqueConstants

DIRECTIONS = ((1, "clockwise", CLOCKWISE), (-1, "counter-clockwise", COUNTER))


class LockedPoint(NamedTuple):
    """A set point of the locked shaft."""

    point: SetpointData
    cut: PeriodCut
    current: Floats  # A, commanded
    torque: Floats  # N*m
    ramps: RampFits


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run of the session."""
    points = [_locked_point(point) for point in session.complete_points]
    points = sorted((p for p in points if p.ramps.ramp_up), key=lambda each: each.ramps.rms_torque)
    if not points:
        raise ValueError("no set point has a ramp of torque")
    torque_constants = torque_constant.torque_constants([each.ramps for each in points])
    constants = {
        "torque_constant": torque_constants.both,
        "torque_constant_positive": torque_constants.positive,
        "torque_constant_negative": torque_constants.negative,
        "torque_constant_motor": torque_constants.motor,
        "torque_hysteresis": mean(
            [each.ramps.hysteresis for each in points],
            "N*m",
            "torque at half the current, falling less rising; by scatter of set points",
        ),
    }
    return Result(
        (_table(points, session.torque_constant),),
        _comparisons(torque_constants, constants["torque_hysteresis"].value),
        constants,
        _figures(points),
        (
            "Clockwise is positive torque. torque_constant is the thesis's, from ramps, and "
            "includes gearbox friction. torque_constant_motor excludes it, by the hysteresis.",
        ),
    )


def _locked_point(point: SetpointData) -> LockedPoint:
    cut = point.whole_periods()
    current = point.trim(point.current_command, cut)
    torque = point.trim(point.torque, cut)
    return LockedPoint(point, cut, current, torque, torque_constant.fit_ramps(current, torque, cut))


def _table(points: Sequence[LockedPoint], constant_in_use: float) -> Table:
    currents = [each.ramps.current_amplitude for each in points]
    columns = [
        Column("row", "", tuple(each.point.row for each in points)),
        Column("current amplitude", "A", tuple(currents)),
        Column(
            "torque, nominal (eq. 3.1)", "N*m", tuple(11.54 / 11.173 * 15.0 * i for i in currents)
        ),
        Column(
            "torque, thesis nominal",
            "N*m",
            tuple(thesis.matching_value(i, thesis.CURRENTS, thesis.TORQUES) for i in currents),
        ),
        Column("torque by constant in use", "N*m", tuple(constant_in_use * i for i in currents)),
        Column("rms torque", "N*m", tuple(each.ramps.rms_torque for each in points)),
    ]
    for sign, direction, _ in DIRECTIONS:
        slopes = [each.ramps.slopes(sign) for each in points]
        fits = [
            [d.line.r_squared for d in p.ramps.ramp_up if d.quarter.sign == sign] for p in points
        ]
        for name, statistic in (("mean", np.mean), ("min", np.min), ("max", np.max)):
            values = tuple(float(statistic(s)) if len(s) else float("nan") for s in slopes)
            columns.append(Column(f"{direction} {name}", "N*m/A", values))
        columns.append(
            Column(f"{direction} R² min", "", tuple(min(f, default=np.nan) for f in fits))
        )
    columns.append(Column("hysteresis", "N*m", tuple(p.ramps.hysteresis for p in points)))
    title = "Table 3.1: torque constants of ramps by set point"
    return Table("torque_constants", title, tuple(columns))


def _comparisons(constants: TorqueConstants, hysteresis: float) -> tuple[Comparison, ...]:
    deviation = constants.both.value / thesis.TORQUE_CONSTANT - 1.0
    low, high = thesis.TORQUE_CONSTANTS
    spread = (constants.largest - constants.smallest) / constants.both.value
    thesis_spread = (high - low) / thesis.TORQUE_CONSTANT
    direction_spreads = thesis.TORQUE_SPREADS
    return (
        Comparison(
            "torque constant, mean of ramps",
            f"{thesis.TORQUE_CONSTANT} N·m/A",
            "within 2 %",
            f"{format_estimate(constants.both)} ({100.0 * deviation:+z.1f} %)",
            abs(deviation) <= 0.02,
        ),
        Comparison(
            "single ramps",
            f"{low} to {high} N·m/A",
            "spread of the same order",
            f"{constants.smallest:.2f} to {constants.largest:.2f} N·m/A",
            0.5 <= spread / thesis_spread <= 2.0,
        ),
        Comparison("clockwise", "trends higher", "", format_estimate(constants.positive), None),
        Comparison("counter-clockwise", "", "", format_estimate(constants.negative), None),
        Comparison(
            "spread, clockwise and counter-clockwise",
            f"{100 * direction_spreads[0]:.0f} and {100 * direction_spreads[1]:.0f} %",
            "",
            f"{100 * constants.spread_positive:.0f} and {100 * constants.spread_negative:.0f} %",
            None,
        ),
        Comparison(
            "motor's own constant, without friction",
            f"specified {thesis.TORQUE_SPECIFIED} N·m/A",
            "",
            format_estimate(constants.motor),
            None,
        ),
        Comparison(
            "torque on back-off minus torque on ramp, at half current",
            "hysteresis",
            "visible",
            f"{format_number(hysteresis, 3)} N·m",
            hysteresis > 0.5,
        ),
    )


def _figures(points: Sequence[LockedPoint]) -> tuple[FigureSpec, ...]:
    example = points[len(points) // 2]
    setpoint = f"Current amplitude {example.ramps.current_amplitude:.2f} A"
    return (
        FigureSpec(
            "fig_3_1",
            "Fig. 3.1: commanded and measured torque over time",
            f"{setpoint}; boxes: domains of the fits, black clockwise, grey counter-clockwise.",
            (7.6, 4.4),
            partial(_draw_over_time, example),
        ),
        FigureSpec(
            "fig_3_2",
            "Fig. 3.2: fits of the largest set point",
            "One domain per direction, every fifth sample.",
            (7.2, 5.8),
            partial(_draw_fits, points[-1]),
        ),
        FigureSpec(
            "fig_3_3",
            "Fig. 3.3: torque constants over torque",
            "Mean, smallest and largest of the ramps of each set point.",
            (7.2, 5.8),
            partial(_draw_constants, points),
        ),
        FigureSpec(
            "hysteresis",
            "Torque over current: ramp and back-off",
            "All set points; darker: larger amplitude.",
            (7.2, 5.0),
            partial(_draw_hysteresis, points),
        ),
    )


def draw_domain_boxes(axes: Axes, domains: Sequence[FitDomain], dt: float, values: Floats) -> None:
    """Draw rectangles around the domains of fits."""
    for each in domains:
        low, high = values[each.samples].min(), values[each.samples].max()
        margin = 0.03 * np.ptp(values)
        x, width = dt * each.samples.start, dt * (each.samples.stop - each.samples.start)
        colour = CLOCKWISE if each.quarter.sign > 0 else COUNTER
        style: dict[str, Any] = {"fill": False, "ec": colour, "lw": 1.6, "zorder": 4}
        axes.add_patch(Rectangle((x, low - margin), width, high - low + 2.0 * margin, **style))


def _draw_over_time(point: LockedPoint, body: SubFigure) -> None:
    axes = prepare_axes(body, "time, s", "torque, N·m")
    slope = np.mean([d.line.slope for d in point.ramps.ramp_up])
    t = point.cut.dt * np.arange(len(point.torque))
    axes.plot(t, slope * point.current, "--", color=RED, lw=1.1, label="command × mean constant")
    axes.plot(t, point.torque, color=BLUE, lw=1.1, label="measured")
    draw_domain_boxes(axes, point.ramps.ramp_up, point.cut.dt, point.torque)
    axes.margins(x=0.0)
    axes.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)


def _draw_fits(point: LockedPoint, body: SubFigure) -> None:
    panels: Any = body.subplots(2, 1)
    for (sign, direction, colour), panel in zip(DIRECTIONS, panels, strict=True):
        axes = prepare_axes(body, "current command, A", "torque, N·m", panel)
        domains = [d for d in point.ramps.ramp_up if d.quarter.sign == sign]
        if not domains:
            continue
        x = point.current[domains[0].samples]
        axes.plot(x[::5], point.torque[domains[0].samples][::5], ".", ms=2.5, color=BLUE, alpha=0.5)
        axes.plot(x, value_at(domains[0].line, x), color=colour, lw=1.6)
        text = f"{direction}\n{domains[0].line.slope:.2f} N·m/A, R² {domains[0].line.r_squared:.4f}"
        annotate_corner(axes, text, "upper left" if sign > 0 else "lower right")


def _draw_constants(points: Sequence[LockedPoint], body: SubFigure) -> None:
    upper, lower = body.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
    upper = prepare_axes(body, "", "torque constant, N·m/A", upper)
    lower = prepare_axes(body, "rms torque, N·m", "R²", lower)
    for sign, direction, colour in DIRECTIONS:
        fits = [[d.line for d in p.ramps.ramp_up if d.quarter.sign == sign] for p in points]
        torques = [p.ramps.rms_torque for p in points]
        draw_ranges(
            upper,
            torques,
            [[f.slope for f in each] for each in fits],
            colour,
            direction,
            0.15 * sign,
        )
        draw_ranges(
            lower, torques, [[f.r_squared for f in e] for e in fits], colour, direction, 0.15 * sign
        )
    upper.axhline(thesis.TORQUE_CONSTANT, color=RED, lw=0.9, ls="--")
    upper.axhspan(*thesis.TORQUE_CONSTANTS, color=RED, alpha=0.07, lw=0)
    annotate_corner(upper, "red: thesis, mean and range", "lower right")
    upper.legend(frameon=False, fontsize=8, loc="upper right")


def draw_ranges(
    axes: Axes, x: Sequence[float], sets: Sequence[Any], colour: str, label: str, offset: float
) -> None:
    """Draw the mean of each set, with bars to its smallest and largest value."""
    legend_label: str | None = label
    for position, values in zip(x, sets, strict=True):
        if len(values):
            mean = float(np.mean(values))
            error_bar = [[mean - min(values)], [max(values) - mean]]
            axes.errorbar(
                position + offset,
                mean,
                error_bar,
                fmt="o",
                ms=4,
                color=colour,
                capsize=3,
                label=legend_label,
            )
            legend_label = None


def _draw_hysteresis(points: Sequence[LockedPoint], body: SubFigure) -> None:
    axes = prepare_axes(body, "current command, A", "torque, N·m")
    for i, each in enumerate(points):
        last = slice(each.cut.edges[-2] - each.cut.edges[0], None)
        axes.plot(
            each.current[last], each.torque[last], color=shade(i + 1, len(points) + 1), lw=0.9
        )
