"""Figures 2.2 to 2.5 and 2.7 to 2.9 of the OSWEC thesis, redrawn from a driveline run."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import SubFigure

from rig.kinds.oswec_bench.products import periods, regressions, torque_map
from rig.kinds.oswec_bench.products.deflection import ShaftLag
from rig.kinds.oswec_bench.products.drawing import (
    BLUE,
    GREEN,
    RED,
    annotate_corner,
    draw_trend,
    prepare_axes,
    shade,
)
from rig.kinds.oswec_bench.products.driveline import (
    DEGREE,
    DrivelineResult,
    DrivelineSetpoint,
)
from rig.kinds.oswec_bench.products.linear_fit import Line
from rig.kinds.oswec_bench.products.result import FigureSpec
from rig.presentation.picture import ACCENT, DARK, MUTED

FIGURE_SIZE = (7.2, 4.4)


def figures(result: DrivelineResult) -> tuple[FigureSpec, ...]:
    """Return the figures that the run has data for."""
    figure_specs = []
    if result.regressions is not None:
        example = _nearest_setpoint(result.uncorrected, 15.0, 83.3)
        setpoint = f"{example.setpoint[0]:g}°, R = {example.setpoint[1]:g} N·m·s/rad"
        figure_specs += [
            FigureSpec(
                "fig_2_2",
                "Fig. 2.2: motor and shaft over a period",
                f"{setpoint}; their difference is drawn 10 times as large.",
                FIGURE_SIZE,
                partial(_draw_lag_parameters, example),
            ),
            FigureSpec(
                "fig_2_3",
                "Fig. 2.3: deflection and torque, period by period",
                f"{setpoint}; later periods darker.",
                (7.2, 5.6),
                partial(_draw_by_period, example),
            ),
        ]
        figure_specs += _trend_figures(result)
    if result.offline is not None:
        figure_specs += _offline_figures(result)
    if result.uncorrected:
        caption = "Means over periods, darker for larger damping"
        caption += "." if result.torque_map is None else "; dashed: the fitted map."
        figure_specs.append(
            FigureSpec("fig_2_9", "Fig. 2.9: deflection over torque", caption, (7.2, 5.0),
                    partial(_draw_deflection_over_torque, result))
        )  # fmt: skip
    if result.schemes:
        figure_specs += _correction_figures(result)
    return tuple(figure_specs)


def _correction_figures(result: DrivelineResult) -> list[FigureSpec]:
    pairs = [pair for scheme in result.schemes for pair in scheme.pairs]
    example = _nearest_setpoint([other for _, other in pairs], 15.0, 83.3)
    caption = (
        f"{example.setpoint[0]:g}°, R = {example.setpoint[1]:g} N·m·s/rad, mean of the periods."
    )
    figures = [
        FigureSpec("corrections_in_time", "Corrections in the loop, over time", caption, (7.2, 5.4),
                partial(_draw_corrections_in_time, result, example)),
    ]  # fmt: skip
    if len({other.setpoint for _, other in pairs}) > 1:
        figures.insert(0, FigureSpec(
            "corrections", "Corrections in the loop: reference minus shaft",
            "95th percentile of each set point, drift removed.", (7.2, 4.6),
            partial(_draw_schemes, result),
        ))  # fmt: skip
    return figures


def _draw_corrections_in_time(
    result: DrivelineResult, uncorrected: DrivelineSetpoint, body: SubFigure
) -> None:
    upper, lower = body.subplots(2, 1, sharex=True, height_ratios=[1.0, 1.2])
    upper = prepare_axes(body, "", "reference, deg", upper)
    lower = prepare_axes(body, "time in the period, s", "minus shaft, deg", lower)
    cut = uncorrected.motion.cut
    reference = periods.mean_period(uncorrected.error + uncorrected.motion.shaft, cut) / DEGREE
    t = cut.dt * np.arange(len(reference))
    upper.plot(t, reference, color=DARK, lw=1.2)
    lower.plot(
        t, periods.mean_period(uncorrected.error, cut) / DEGREE, color=DARK, label="uncorrected"
    )
    for scheme, colour in zip(result.schemes, (BLUE, RED, GREEN), strict=False):
        for corrected, other in scheme.pairs:
            if other.setpoint == uncorrected.setpoint:
                error = periods.mean_period(corrected.error, corrected.motion.cut) / DEGREE
                times = corrected.motion.cut.dt * np.arange(len(error))
                lower.plot(times, error, color=colour, label=scheme.name)
    lower.axhline(0.0, color=MUTED, lw=0.5)
    low, high = lower.get_ylim()
    lower.set_ylim(low, high + 0.2 * (high - low))  # room for the legend
    lower.legend(frameon=False, fontsize=8, loc="upper right", ncols=2)
    lower.margins(x=0.0)


def _nearest_setpoint(
    points: Sequence[DrivelineSetpoint], amplitude: float, damping: float
) -> DrivelineSetpoint:
    def distance(each: DrivelineSetpoint) -> float:
        a, r = each.setpoint
        return abs(a / amplitude - 1.0) + abs(r / damping - 1.0)

    return min(points, key=distance)


def _draw_lag_parameters(point: DrivelineSetpoint, body: SubFigure) -> None:
    axes = prepare_axes(body, "time, s", "angle, deg")
    cut = point.motion.cut
    mean = {
        n: periods.mean_period(getattr(point.motion, n), cut) / DEGREE for n in ("motor", "shaft")
    }
    t = cut.dt * np.arange(len(mean["motor"]))
    exaggerated = mean["motor"] - 10.0 * (mean["motor"] - mean["shaft"])
    axes.plot(t, mean["motor"], color=BLUE, lw=1.8, label="motor")
    axes.plot(t, exaggerated, color=RED, lw=1.8, label="shaft")
    axes.axhline(mean["motor"].max(), color=MUTED, lw=0.6, ls=":")
    axes.axhline(exaggerated.max(), color=MUTED, lw=0.6, ls=":")
    shift = 100.0 * point.lag.phase_shift.mean()
    loss = point.lag.amplitude_difference.mean() / DEGREE
    annotate_corner(
        axes,
        f"phase shift {shift:.3f} % of period\namplitude difference {loss:.4f}°",
        "upper center",
    )
    axes.margins(x=0.0)
    axes.legend(frameon=False, fontsize=8, loc="lower left")


def _draw_by_period(point: DrivelineSetpoint, body: SubFigure) -> None:
    upper, lower = body.subplots(2, 1, sharex=True)
    upper = prepare_axes(body, "", "deflection, deg", upper)
    lower = prepare_axes(body, "time in the period, s", "torque, N·m", lower)
    cut = point.motion.cut
    for axes, values in ((upper, point.motion.deflection / DEGREE), (lower, point.motion.torque)):
        for i, period in enumerate(periods.split_periods(values, cut)):
            t = cut.dt * np.arange(len(period))
            axes.plot(t, period, color=shade(i, cut.period_count), lw=0.7)
        axes.axhline(0.0, color=MUTED, lw=0.5)
    lower.margins(x=0.0)


def _draw_trend_points(
    result: DrivelineResult,
    line: Line,
    coordinates: Callable[[ShaftLag], tuple[float, Any]],
    labels: tuple[str, str],
    body: SubFigure,
) -> None:
    axes = prepare_axes(body, *labels)
    draw_trend(
        axes,
        line,
        [coordinates(each.lag)[0] for each in result.uncorrected],
        _label_factor(labels[1]),
    )
    dampings = sorted({each.setpoint[1] for each in result.uncorrected})
    for each in result.uncorrected:
        x, values = coordinates(each.lag)
        values = _label_factor(labels[1]) * values
        low, mid, high = np.percentile(values, 5), values.mean(), np.percentile(values, 95)
        colour = shade(dampings.index(each.setpoint[1]) + 1, len(dampings) + 1)
        axes.errorbar(x, mid, [[mid - low], [high - mid]], fmt="o", ms=5, color=colour, capsize=3)
    for i, damping in enumerate(dampings):
        axes.plot([], [], "o", color=shade(i + 1, len(dampings) + 1), label=f"R = {damping:g}")
    axes.legend(frameon=False, fontsize=8)


def _label_factor(label: str) -> float:
    return 100.0 if "%" in label else 1.0 / DEGREE


def _trend_figures(result: DrivelineResult) -> list[FigureSpec]:
    assert result.regressions is not None
    caption = (
        "Mean of the periods with 5th and 95th percentile; line with its 95 % band. R² {:.3f}; "
    )
    amplitude, phase, delay = result.regressions
    phase_label, loss_label = "phase shift, % of period", "amplitude difference, deg"
    speed, load = "rms motor velocity, rad/s", "rms torque, N·m"
    return [
        FigureSpec("fig_2_4", "Fig. 2.4: phase shift over velocity",
                caption.format(phase.r_squared) + "thesis 0.81.", FIGURE_SIZE,
                partial(_draw_trend_points, result, phase,
                        lambda b: (b.rms_velocity, b.phase_shift), (speed, phase_label))),
        FigureSpec("fig_2_4_torque", "Phase shift over torque, for comparison with Fig. 2.4",
                caption.format(delay.r_squared) + "not in the thesis.", FIGURE_SIZE,
                partial(_draw_trend_points, result, delay,
                        lambda b: (b.rms_torque, b.phase_shift), (load, phase_label))),
        FigureSpec("fig_2_5", "Fig. 2.5: amplitude difference over torque",
                caption.format(amplitude.r_squared) + "thesis 0.97.", FIGURE_SIZE,
                partial(_draw_trend_points, result, amplitude,
                        lambda b: (b.rms_torque, b.amplitude_difference), (load, loss_label))),
    ]  # fmt: skip


def _offline_figures(result: DrivelineResult) -> list[FigureSpec]:
    example = _nearest_setpoint(result.uncorrected, 20.0, 104.0)
    caption = (
        f"{example.setpoint[0]:g}°, R = {example.setpoint[1]:g} N·m·s/rad; "
        "below: difference from the shaft."
    )
    return [
        FigureSpec("fig_2_7", "Fig. 2.7: motor corrected by equation 2.6", caption,
                (7.2, 5.4), partial(_draw_offline_correction, result, example)),
        FigureSpec("fig_2_8", "Fig. 2.8: deflection, offline correction",
                "Mean, 5th and 95th percentile of each set point; thesis: within 0.25° "
                "before, below 0.12° after.", (7.6, 4.6), partial(_draw_before_after, result)),
    ]  # fmt: skip


def _draw_offline_correction(
    result: DrivelineResult, point: DrivelineSetpoint, body: SubFigure
) -> None:
    assert result.regressions is not None
    upper, lower = body.subplots(2, 1, sharex=True, height_ratios=[1.2, 1.0])
    upper = prepare_axes(body, "", "angle, deg", upper)
    lower = prepare_axes(body, "time, s", "minus shaft, deg", lower)
    correction = regressions.predict_correction(result.regressions, point.lag)
    cut = point.motion.cut
    corrected = regressions.correct_offline(point.motion, correction, point.lag.amplitude)
    curves = ((point.motion.motor, BLUE, "motor", "-"), (corrected, GREEN, "corrected motor", "--"))
    shaft = periods.mean_period(point.motion.shaft, cut) / DEGREE
    t = cut.dt * np.arange(len(shaft))
    for values, colour, name, style in curves:
        angle = periods.mean_period(values, cut) / DEGREE
        upper.plot(t, angle, style, color=colour, lw=1.6, label=name)
        lower.plot(t, angle - shaft, style, color=colour, lw=1.4)
    upper.plot(t, shaft, color=RED, lw=1.2, label="shaft")
    lower.axhline(0.0, color=MUTED, lw=0.6)
    upper.legend(frameon=False, fontsize=8, loc="upper center")
    lower.margins(x=0.0)


def _draw_before_after(result: DrivelineResult, body: SubFigure) -> None:
    assert result.offline is not None
    axes = prepare_axes(body, "amplitude, deg   /   R, N·m·s/rad", "deflection, deg")
    sets = (
        ([each.motion.deflection for each in result.uncorrected], BLUE, "before", -0.15),
        (result.offline.all_points, RED, "after", 0.15),
    )
    for errors, colour, name, offset in sets:
        for i, error in enumerate(errors):
            magnitude = np.abs(error) / DEGREE
            low, high = np.percentile(magnitude, [5, 95])
            mid = magnitude.mean()
            error_bar = [[mid - low], [high - mid]]
            label = name if i == 0 else None
            axes.errorbar(
                i + offset, mid, error_bar, fmt="o", ms=4, color=colour, capsize=2.5, label=label
            )
    for level, name in ((0.25, "0.25°"), (0.12, "0.12°")):
        axes.axhline(level, color=MUTED, lw=0.8, ls="--")
        axes.annotate(name, (1.0, level), xycoords=("axes fraction", "data"), ha="right",
                      va="bottom", fontsize=7.5, color=MUTED)  # fmt: skip
    ticks = [f"{a:g}\n{r:g}" for a, r in (each.setpoint for each in result.uncorrected)]
    axes.set_xticks(range(len(ticks)), ticks)
    axes.set_ylim(0.0, 1.15 * max(0.25, axes.get_ylim()[1]))  # room for the legend
    axes.legend(frameon=False, fontsize=8, loc="upper left", ncols=2)


def _draw_deflection_over_torque(result: DrivelineResult, body: SubFigure) -> None:
    axes = prepare_axes(body, "driveline torque, N·m", "deflection, deg")
    ordered = sorted(result.uncorrected, key=lambda each: each.lag.rms_torque)
    for i, each in enumerate(ordered):
        cut = each.motion.cut
        torque = periods.mean_period(each.motion.torque, cut)
        deflection = periods.mean_period(each.motion.deflection, cut) / DEGREE
        axes.plot(torque, deflection, color=shade(i + 1, len(ordered) + 1), lw=1.0)
    if result.torque_map is not None:
        max_torque = max(np.abs(each.motion.torque).max() for each in result.uncorrected)
        for sign in (1.0, -1.0):
            x = sign * np.linspace(0.3, max_torque, 200)
            label = "fitted map" if sign > 0 else None
            y = torque_map.map_deflection(result.torque_map, x) / DEGREE
            axes.plot(x, y, "--", color=ACCENT, lw=1.6, label=label)
        axes.legend(frameon=False, fontsize=8, loc="upper left")
        fitted_map = result.torque_map
        annotate_corner(
            axes,
            f"half gap {fitted_map.half_gap.value / DEGREE:.4f}°\n"
            f"soft zone {fitted_map.soft_zone.value / DEGREE:.3f}° "
            f"to {fitted_map.knee.value:.1f} N·m\n"
            f"stiffness {fitted_map.stiffness.value:.0f} N·m/rad",
            "lower right",
        )
    axes.axhline(0.0, color=MUTED, lw=0.5)
    axes.axvline(0.0, color=MUTED, lw=0.5)


def _draw_schemes(result: DrivelineResult, body: SubFigure) -> None:
    axes = prepare_axes(
        body, "amplitude, deg   /   R, N·m·s/rad", "reference minus shaft, 95th percentile, deg"
    )
    setpoints = sorted(
        {corrected.setpoint for scheme in result.schemes for corrected, _ in scheme.pairs}
    )
    uncorrected: dict[tuple[float, float], DrivelineSetpoint] = {}
    for scheme in result.schemes:
        uncorrected |= {other.setpoint: other for _, other in scheme.pairs}
    uncorrected_errors = [
        np.percentile(np.abs(uncorrected[p].error), 95) / DEGREE for p in setpoints
    ]
    axes.plot(range(len(setpoints)), uncorrected_errors, "o", ms=6, color=DARK, label="uncorrected")
    axes.plot(
        range(len(setpoints)),
        np.array(uncorrected_errors) / 2.0,
        "_",
        ms=12,
        color=MUTED,
        label="half of uncorrected",
    )
    for scheme, colour, mark in zip(result.schemes, (BLUE, RED, GREEN), "sD^", strict=False):
        positions = [setpoints.index(corrected.setpoint) for corrected, _ in scheme.pairs]
        errors = [
            np.percentile(np.abs(corrected.error), 95) / DEGREE for corrected, _ in scheme.pairs
        ]
        axes.plot(positions, errors, mark, ms=5, color=colour, label=scheme.name)
    axes.set_xticks(range(len(setpoints)), [f"{a:g}\n{r:g}" for a, r in setpoints])
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False, fontsize=8, ncols=2)
