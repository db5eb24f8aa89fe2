"""The velocity constant session: Table 3.2, Figures 2.6 and 3.5 to 3.8 of the OSWEC thesis."""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import SubFigure
from scipy.ndimage import uniform_filter1d

from rig.kinds.oswec_bench.products import periods, thesis, velocity_constant
from rig.kinds.oswec_bench.products.deflection import Motion, ShaftLag, shaft_lag
from rig.kinds.oswec_bench.products.drawing import (
    BLUE,
    CLOCKWISE,
    COUNTER,
    RED,
    annotate_corner,
    prepare_axes,
    shade,
)
from rig.kinds.oswec_bench.products.driveline import DEGREE
from rig.kinds.oswec_bench.products.estimate import Estimate, mean
from rig.kinds.oswec_bench.products.linear_fit import value_at
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import (
    Column,
    Comparison,
    FigureSpec,
    Result,
    Table,
    format_estimate,
)
from rig.kinds.oswec_bench.products.torque_report import (
    DIRECTIONS,
    draw_domain_boxes,
    draw_ranges,
)
from rig.kinds.oswec_bench.products.velocity_constant import Deceleration, VelocityConstants

NOMINAL = 37.5 * 2.0 * np.pi / 10.0 / 15.0  # rad/s/V, equation 3.2


class UnloadedPoint(NamedTuple):
    """A set point of the unloaded shaft."""

    point: SetpointData
    cut: PeriodCut
    deceleration: Deceleration
    motion: Motion
    lag: ShaftLag


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run of the session."""
    points = [_unloaded_point(point) for point in session.complete_points]
    points = sorted(
        (p for p in points if p.deceleration.thesis_fits), key=lambda p: p.deceleration.rms_velocity
    )
    if not points:
        raise ValueError("no set point has a deceleration")
    velocity_constants = velocity_constant.velocity_constants(
        [each.deceleration for each in points]
    )
    amplitude_loss = mean(
        [each.lag.amplitude_difference.mean() / DEGREE for each in points],
        "deg",
        "half strokes of motor minus shaft, unloaded; by scatter of set points",
    )
    constants = {
        "velocity_constant": velocity_constants.constant,
        "velocity_constant_deceleration": velocity_constants.thesis,
        "velocity_constant_fastest": velocity_constants.fastest,
        "velocity_lag": velocity_constants.lag,
        "velocity_droop": velocity_constants.droop,
        "amplitude_difference_unloaded": amplitude_loss,
    }
    return Result(
        (_table(points),),
        _comparisons(velocity_constants, amplitude_loss, points),
        constants,
        _figures(points, velocity_constants.constant.value),
        (
            "velocity_constant holds while the motor follows its command, after the wait at the "
            "start of each deceleration, without lag and droop of the drive; the thesis's lines "
            "include them. velocity_droop is the value without load; the load of the bearing "
            "reduces it.",
        ),
    )


def _unloaded_point(point: SetpointData) -> UnloadedPoint:
    cut = point.aligned_periods(point.volts)
    motion = point.motion()
    deceleration = velocity_constant.fit_decelerations(point.motor, point.volts, point.torque, cut)
    return UnloadedPoint(point, cut, deceleration, motion, shaft_lag(motion))


def _table(points: Sequence[UnloadedPoint]) -> Table:
    volts = [each.deceleration.voltage_amplitude for each in points]
    columns = [
        Column("row", "", tuple(each.point.row for each in points)),
        Column("voltage amplitude", "V", tuple(volts)),
        Column("velocity, nominal (eq. 3.2)", "rad/s", tuple(NOMINAL * v for v in volts)),
        Column("velocity, thesis nominal", "rad/s",
               tuple(thesis.matching_value(v, thesis.VOLTS, thesis.SPEEDS) for v in volts)),
        Column("rms velocity", "rad/s", tuple(each.deceleration.rms_velocity for each in points)),
    ]  # fmt: skip
    for sign, direction, _ in DIRECTIONS:
        slopes = [each.deceleration.slopes(sign) for each in points]
        fits = [
            [d.line.r_squared for d in p.deceleration.thesis_fits if d.quarter.sign == sign]
            for p in points
        ]
        for name, statistic in (("mean", np.mean), ("min", np.min), ("max", np.max)):
            values = tuple(float(statistic(s)) if len(s) else float("nan") for s in slopes)
            columns.append(Column(f"{direction} {name}", "rad/s/V", values))
        columns.append(
            Column(f"{direction} R² min", "", tuple(min(f, default=np.nan) for f in fits))
        )
    columns += [
        Column("amplitude difference", "deg",
               tuple(float(p.lag.amplitude_difference.mean()) / DEGREE for p in points)),
    ]  # fmt: skip
    title = "Table 3.2: velocity constants of decelerations by set point"
    return Table("velocity_constants", title, tuple(columns))


def _comparisons(
    constants: VelocityConstants, amplitude_loss: Estimate, points: Sequence[UnloadedPoint]
) -> tuple[Comparison, ...]:
    deviation = constants.thesis.value / thesis.VELOCITY_CONSTANT - 1.0
    fastest_deviation = constants.fastest.value / thesis.VELOCITY_FASTEST - 1.0
    low, high = thesis.VELOCITY_CONSTANTS
    mid, half_width = thesis.UNLOADED_DIFFERENCE
    slowest = float(np.mean([d.line.slope for d in points[0].deceleration.thesis_fits]))
    torque = max(float(np.abs(p.motion.torque).max()) for p in points)
    return (
        Comparison(
            "velocity constant, mean",
            f"{thesis.VELOCITY_CONSTANT} rad/s/V",
            "within 2 %",
            f"{format_estimate(constants.thesis)} ({100 * deviation:+z.1f} %)",
            abs(deviation) <= 0.02,
        ),
        Comparison(
            "mean of the three fastest",
            f"{thesis.VELOCITY_FASTEST} rad/s/V",
            "within 2 %",
            f"{format_estimate(constants.fastest)} ({100 * fastest_deviation:+z.1f} %)",
            abs(fastest_deviation) <= 0.02,
        ),
        Comparison(
            "spread of the three fastest",
            f"{100 * thesis.VELOCITY_SPREAD:.1f} %",
            "",
            f"{100 * constants.spread:.1f} %",
            None,
        ),
        Comparison(
            "single lines",
            f"{low} to {high} rad/s/V",
            "",
            f"{constants.smallest:.2f} to {constants.largest:.2f} rad/s/V",
            None,
        ),
        Comparison(
            "slowest set point",
            "lower",
            "low-amplitude bias visible",
            f"{slowest:.3f} rad/s/V",
            slowest < 0.99 * constants.fastest.value,
        ),
        Comparison(
            "motor following its command",
            "trends towards 1.5 rad/s/V",
            "",
            format_estimate(constants.constant),
            None,
        ),
        Comparison(
            "amplitude difference, unloaded",
            f"{mid} ± {half_width} deg",
            "within",
            format_estimate(amplitude_loss),
            abs(amplitude_loss.value - mid) <= half_width,
        ),
        Comparison("largest torque of the bearing", "under 0.4 N·m", "", f"{torque:.2f} N·m", None),
    )


def _figures(points: Sequence[UnloadedPoint], constant: float) -> tuple[FigureSpec, ...]:
    domains_caption = "boxes: domains of the fits, black clockwise, grey counter-clockwise."
    return (
        FigureSpec(
            "fig_2_6",
            "Fig. 2.6: amplitude difference, unloaded",
            "Mean of the periods with 5th and 95th percentile; red: thesis 0.025 ± 0.015°.",
            (7.2, 4.2),
            partial(_draw_unloaded, points),
        ),
        FigureSpec(
            "fig_3_5",
            "Fig. 3.5: commanded and measured velocity",
            f"Slowest set point above, fastest below; {domains_caption}",
            (7.6, 5.8),
            partial(_draw_over_time, (points[0], points[-1]), constant),
        ),
        FigureSpec(
            "fig_3_6",
            "Fig. 3.6: fits of the fastest set point",
            "One deceleration per direction.",
            (7.2, 5.8),
            partial(_draw_fits, points[-1]),
        ),
        FigureSpec(
            "fig_3_7",
            "Fig. 3.7: velocity constants over velocity",
            "Mean, smallest and largest of the decelerations of each set point.",
            (7.2, 5.8),
            partial(_draw_constants, points, constant),
        ),
        FigureSpec(
            "fig_3_8",
            "Fig. 3.8: torque of the bearing over the phase",
            "Means over periods and 15 ms; darker: faster.",
            (7.2, 4.4),
            partial(_draw_bearing_torque, points),
        ),
    )


def _draw_unloaded(points: Sequence[UnloadedPoint], body: SubFigure) -> None:
    axes = prepare_axes(body, "rms motor velocity, rad/s", "amplitude difference, deg")
    mid, half_width = thesis.UNLOADED_DIFFERENCE
    axes.axhspan(mid - half_width, mid + half_width, color=RED, alpha=0.1, lw=0)
    axes.axhline(mid, color=RED, lw=0.9, ls="--")
    for each in points:
        values = each.lag.amplitude_difference / DEGREE
        low, high = np.percentile(values, [5, 95])
        error_bar = [[values.mean() - low], [high - values.mean()]]
        position = (each.lag.rms_velocity, values.mean())
        axes.errorbar(*position, error_bar, fmt="o", ms=5, color=BLUE, capsize=3)
    axes.set_ylim(0.0, None)


def _draw_over_time(
    pair: tuple[UnloadedPoint, UnloadedPoint], constant: float, body: SubFigure
) -> None:
    panels: Any = body.subplots(2, 1, sharex=True)
    for each, panel in zip(pair, panels, strict=True):
        axes = prepare_axes(
            body, "time, s" if panel is panels[-1] else "", "velocity, rad/s", panel
        )
        count = min(len(each.deceleration.velocity), round(2.0 * each.cut.period / each.cut.dt))
        t = each.cut.dt * np.arange(count)
        expected = constant * each.deceleration.volts[:count]
        axes.plot(t, expected, "--", color=RED, lw=1.1, label="command × constant")
        axes.plot(t, each.deceleration.velocity[:count], color=BLUE, lw=1.2, label="measured")
        shown = [d for d in each.deceleration.thesis_fits if d.samples.stop <= count]
        draw_domain_boxes(axes, shown, each.cut.dt, each.deceleration.velocity)
        axes.margins(x=0.0)
    panels[0].legend(
        frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2
    )


def _draw_fits(point: UnloadedPoint, body: SubFigure) -> None:
    panels: Any = body.subplots(2, 1)
    for (sign, direction, colour), panel in zip(DIRECTIONS, panels, strict=True):
        axes = prepare_axes(body, "voltage command, V", "velocity, rad/s", panel)
        domains = [d for d in point.deceleration.thesis_fits if d.quarter.sign == sign]
        if not domains:
            continue
        x = point.deceleration.volts[domains[0].samples]
        axes.plot(
            x, point.deceleration.velocity[domains[0].samples], ".", ms=3, color=BLUE, alpha=0.5
        )
        axes.plot(x, value_at(domains[0].line, x), color=colour, lw=1.4)
        text = (
            f"{direction}\n{domains[0].line.slope:.3f} rad/s/V, R² {domains[0].line.r_squared:.5f}"
        )
        annotate_corner(axes, text, "upper left" if sign > 0 else "lower right")


def _draw_constants(points: Sequence[UnloadedPoint], constant: float, body: SubFigure) -> None:
    upper, lower = body.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
    upper = prepare_axes(body, "", "velocity constant, rad/s/V", upper)
    lower = prepare_axes(body, "rms motor velocity, rad/s", "R²", lower)
    for sign, direction, colour in DIRECTIONS:
        fits = [
            [d.line for d in p.deceleration.thesis_fits if d.quarter.sign == sign] for p in points
        ]
        velocities = [p.deceleration.rms_velocity for p in points]
        draw_ranges(
            upper,
            velocities,
            [[f.slope for f in each] for each in fits],
            colour,
            direction,
            0.004 * sign,
        )
        draw_ranges(
            lower,
            velocities,
            [[f.r_squared for f in e] for e in fits],
            colour,
            direction,
            0.004 * sign,
        )
    upper.axhline(constant, color=BLUE, lw=0.9, label="following its command")
    upper.axhline(
        thesis.VELOCITY_FASTEST, color=RED, lw=0.9, ls="--", label="thesis, three fastest"
    )
    upper.legend(frameon=False, fontsize=8, loc="lower right")


def _draw_bearing_torque(points: Sequence[UnloadedPoint], body: SubFigure) -> None:
    axes = prepare_axes(body, "phase of the oscillation, share of a period", "torque, N·m")
    for i, each in enumerate(points):
        torque = periods.mean_period(each.motion.torque, each.motion.cut)
        share = np.arange(len(torque)) / len(torque)
        smooth = uniform_filter1d(torque, 15, mode="wrap")
        axes.plot(share, smooth, color=shade(i + 1, len(points) + 1), lw=1.0)
    axes.axhline(0.0, color=COUNTER, lw=0.6)
    axes.axhline(0.4, color=CLOCKWISE, lw=0.6, ls=":")
    axes.axhline(-0.4, color=CLOCKWISE, lw=0.6, ls=":")
    axes.margins(x=0.0)
