"""The driveline session's results: tables, comparisons, constants and the figures of chapter 2."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from rig.kinds.oswec_bench.products import figures, periods, torque_map
from rig.kinds.oswec_bench.products.deflection import (
    DEGREE,
    ShaftLag,
    error_percentile,
    pooled_percentile,
)
from rig.kinds.oswec_bench.products.driveline import (
    CorrectionScheme,
    DrivelineResult,
    DrivelineSetpoint,
    OfflineErrors,
    Regressions,
    analyse_driveline,
    correct_offline,
    explained_variance,
    predict_correction,
)
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, Line, format_number, mean
from rig.kinds.oswec_bench.products.points import SessionRun
from rig.kinds.oswec_bench.products.result import (
    Columns,
    Comparison,
    Result,
    Table,
    compare,
    table,
)
from rig.kinds.oswec_bench.products.torque_map import TorqueMap
from rig.presentation.picture import ACCENT, DARK, MUTED

SAMPLE_HOLD_UNCERTAINTY = 0.0005
"""Relative uncertainty of a velocity constant due to commands that are constant during a tick."""
MIN_MAP_TORQUE = 1.0  # N*m, below it the map crosses the gap from flank to flank
OFFLINE = (
    ("offline 95th", "regressions of all set points", "< 0.12 deg", "pooled < 0.12 deg"),
    ("offline 95th, leave one out", "without the rated set point", "", ""),
    ("offline 95th, delay over torque", "without it, delay over torque", "", ""),
)
"""Column, comparison, thesis's value and target of each of the `OfflineErrors`."""
SETPOINT_LABEL = "amplitude, deg   /   R, N·m·s/rad"
SCHEME_STYLES = ((figures.BLUE, "s"), (figures.RED, "D"), (figures.GREEN, "^"))


class Trend(NamedTuple):
    """A line through the set points in the report."""

    line: str  # field of Regressions
    y: str  # field of ShaftLag
    unit: str  # of y in the report
    factor: float  # from the unit of y in a `ShaftLag`
    x: str  # field of ShaftLag
    suffix: str  # of the names of its constants
    thesis: str


_ANGLE = "amplitude_difference", "deg", 1.0 / DEGREE
_SHARE = "phase_shift", "% of period", 100.0
X_LABELS = {"rms_torque": "rms torque, N·m", "rms_velocity": "rms motor velocity, rad/s"}
X_UNITS = {"rms_torque": "N*m", "rms_velocity": "rad/s"}
AMPLITUDE, PHASE, DELAY = TRENDS = (
    Trend("amplitude", *_ANGLE, "rms_torque", "", "rises, R² 0.97"),
    Trend("velocity_phase", *_SHARE, "rms_velocity", "", "falls, R² 0.81"),
    Trend("torque_phase", *_SHARE, "rms_torque", "_over_torque", ""),
)


def analyse_session(session: SessionRun, baseline: SessionRun | None = None) -> Result:
    """Analyse a run; ``baseline`` is a run of the same rows without correction."""
    result = analyse_driveline(session, baseline)
    if not (result.uncorrected or result.corrected):
        raise ValueError("no set point was measured completely")
    maps: dict[str, Any] = {}
    if result.torque_map is not None:
        torque, deflection = map_points(result, result.torque_map)
        maps["deflection_map"] = {"torque_n_m": torque, "deflection_deg": deflection}
    if result.uncorrected:
        maps["driveline"] = [_calibration_entry(each) for each in result.uncorrected]
    return Result(
        tuple(_tables(result)),
        tuple(_comparisons(result)),
        _constants(result),
        tuple(_figures(result)),
        tuple(_notes(session, baseline, result)),
        maps,
        {"position_error": _position_error([*result.uncorrected, *result.corrected])},
    )


def _notes(
    session: SessionRun, baseline: SessionRun | None, result: DrivelineResult
) -> Iterator[str]:
    yield (
        "The phase shift compares fundamentals, the amplitude difference half strokes, "
        "period by period. Drift is the slope of period means."
    )
    if baseline is not None:
        yield f"Uncorrected set points are those of run {baseline.metadata.run}."
    elif result.corrected and not result.schemes:
        reason = "there is no uncorrected run to compare them with"
        yield f"Corrected set points are not rated: {reason}."
    if saturated := [str(p.row) for p in session.points if p.limited_ticks]:
        yield f"Commands were limited in rows {', '.join(saturated)}."
    if result.torque_map is not None:
        residual_mdeg = 1e3 * result.torque_map.residual / DEGREE
        yield f"The map leaves {residual_mdeg:.2f} mdeg rms of the binned deflection unexplained."


def _tables(result: DrivelineResult) -> Iterator[Table]:
    """Yield set points, trends, rated corrections and the map, as far as the run has data."""
    points = [*result.uncorrected, *result.corrected]
    columns = _setpoint_columns(result)
    yield table("driveline_points", "Table 2.1: set points and results", points, columns)
    if result.regressions is not None:
        trends = [(each, getattr(result.regressions, each.line)) for each in TRENDS]
        title = "Trends between set points (± 95 %)"
        yield table("driveline_trends", title, trends, TREND_COLUMNS)
    if result.schemes:
        title = "Corrections in the loop: detrended reference minus shaft"
        yield table("driveline_corrections", title, _correction_rows(result), CORRECTION_COLUMNS)
    if result.torque_map is not None:
        corners = zip(*map_points(result, result.torque_map), strict=True)
        title = "Fig. 2.9: deflection over torque, linear in between"
        yield table("deflection_map", title, corners, MAP_COLUMNS)


def _setpoint_columns(result: DrivelineResult) -> Columns[DrivelineSetpoint]:
    def mean_of(values: Floats, factor: float) -> Estimate:
        return mean(values, "", "").scaled(factor, "")

    columns: dict[str, Callable[[DrivelineSetpoint], Any]] = {
        "row": lambda e: e.point.row,
        "amplitude [deg]": lambda e: e.point.plan_value("amplitude_deg"),
        "R [N*m*s/rad]": lambda e: e.point.plan_value("damping_n_m_s_per_rad"),
        "period [s]": lambda e: e.point.period,
        "correction": lambda e: e.point.correction_name,
        "periods": lambda e: e.motion.cut.period_count,
        "rms velocity [rad/s]": lambda e: e.lag.rms_velocity,
        "rms torque [N*m]": lambda e: e.lag.rms_torque,
        "phase shift [% of period]": lambda e: mean_of(e.lag.phase_shift, 100.0),
        "amplitude difference [deg]": lambda e: mean_of(e.lag.amplitude_difference, 1.0 / DEGREE),
        "deflection mean [deg]": lambda e: e.lag.deflection_mean / DEGREE,
        "deflection 5th [deg]": lambda e: e.lag.deflection_low / DEGREE,
        "deflection 95th [deg]": lambda e: e.lag.deflection_high / DEGREE,
    }
    if result.offline is not None:
        rows = [each.point.row for each in result.uncorrected]
        for (name, _, _, _), errors in zip(OFFLINE, result.offline, strict=True):
            by_row = dict(zip(rows, map(error_percentile, errors), strict=True))
            columns[f"{name} [deg]"] = partial(_of_row, by_row)
    return columns | {
        "reference − shaft 95th [deg]": lambda e: error_percentile(e.error) / DEGREE,
        "reference − motor 95th [deg]": lambda e: error_percentile(e.following_error) / DEGREE,
        "drift [deg/min]": lambda e: 60.0 * e.drift / DEGREE,
    }


def _of_row(errors: dict[int, float], point: DrivelineSetpoint) -> float:
    return errors.get(point.point.row, float("nan")) / DEGREE


TREND_COLUMNS: Columns[tuple[Trend, Line]] = {
    "trend": lambda r: f"{r[0].y} over {r[0].x}".replace("_", " "),
    "slope": lambda r: r[1].slope_estimate().scaled(r[0].factor, ""),
    "at zero": lambda r: r[1].intercept_estimate().scaled(r[0].factor, ""),
    "R²": lambda r: r[1].r_squared,
    "unit": lambda r: r[0].unit,
    "unit of slope": lambda r: f"{r[0].unit} per {X_UNITS[r[0].x]}",
    "thesis": lambda r: r[0].thesis,
}


RatedCorrection = tuple[str, tuple[float, float], float, float]
"""Name, set point, and the errors (deg, 95th percentile) without and with a correction."""
CORRECTION_COLUMNS: Columns[RatedCorrection] = {
    "correction": lambda r: r[0],
    "amplitude [deg]": lambda r: r[1][0],
    "R [N*m*s/rad]": lambda r: r[1][1],
    "uncorrected 95th [deg]": lambda r: r[2],
    "corrected 95th [deg]": lambda r: r[3],
    "corrected / uncorrected": lambda r: r[3] / r[2],
}
MAP_COLUMNS: Columns[tuple[float, float]] = {
    "torque [N*m]": lambda corner: corner[0],
    "deflection [deg]": lambda corner: corner[1],
}


def _correction_rows(result: DrivelineResult) -> Iterator[RatedCorrection]:
    for scheme in result.schemes:
        for corrected, other in scheme.pairs:
            before, after = (error_percentile(e.error) / DEGREE for e in (other, corrected))
            yield scheme.name, corrected.setpoint, before, after
        after, before = (each / DEGREE for each in scheme.errors)
        yield f"{scheme.name}, pooled", (float("nan"), float("nan")), before, after


def map_points(result: DrivelineResult, fitted: TorqueMap) -> tuple[list[float], list[float]]:
    """Return torque (N*m, rising) and deflection (deg) at the corners of the map."""
    knee = fitted.knee.value
    max_torque = max(float(np.abs(each.motion.torque).max()) for each in result.uncorrected)
    sides = [MIN_MAP_TORQUE, knee, max(max_torque, 1.5 * knee)]
    torques = np.array([*(-x for x in sides[::-1]), *sides])
    deflection = torque_map.map_deflection(fitted, torques) / DEGREE
    return torques.tolist(), deflection.tolist()


def _constants(result: DrivelineResult) -> dict[str, Estimate]:
    """Return gap, stiffness and the trends, for the calibration file."""
    estimates: dict[str, Estimate] = {}
    points, trends, fitted = result.uncorrected, result.regressions, result.torque_map
    if trends is not None:
        method = f"fundamentals under load, mean of {len(points)} set points, by their scatter"
        gain = mean([e.drive_gain for e in points], "rad/s/V", method)
        estimates["velocity_constant_loaded"] = gain.widened(SAMPLE_HOLD_UNCERTAINTY * gain.value)
        estimates["velocity_loop_lag"] = mean([e.drive_lag for e in points], "s", method)
    if fitted is not None:
        estimates["half_gap"] = _in_degrees(fitted.half_gap)
        estimates["soft_zone"] = _in_degrees(fitted.soft_zone)
        estimates["soft_zone_torque"] = fitted.knee
        estimates["stiffness"] = fitted.stiffness
    if trends is not None:
        method = f"line through {trends.velocity_phase.point_count} set points, by their scatter"
        for each in TRENDS:
            line, unit = getattr(trends, each.line), each.unit.split()[0]
            slope, at_zero = line.slope_estimate("", method), line.intercept_estimate("", method)
            name, slope_unit = each.y + each.suffix, f"{unit}/({X_UNITS[each.x]})"
            estimates[f"{name}_slope"] = slope.scaled(each.factor, slope_unit)
            estimates[f"{name}_at_zero"] = at_zero.scaled(each.factor, unit)
    return estimates


def _position_error(points: list[DrivelineSetpoint]) -> Estimate:
    """Return the error of the shaft against its reference."""
    method = f"95th percentile, mean of {len(points)} set points, by their scatter"
    return mean([error_percentile(each.error) / DEGREE for each in points], "deg", method)


def _in_degrees(estimate: Estimate) -> Estimate:
    value, half_width = estimate.value / DEGREE, estimate.uncertainty / DEGREE
    return estimate._replace(value=value, uncertainty=half_width, unit="deg")


def _calibration_entry(point: DrivelineSetpoint) -> dict[str, float]:
    """Return a set point's part of the calibration file, from which corrections are computed."""
    return {
        "row": point.point.row,
        "amplitude_deg": point.point.plan_value("amplitude_deg"),
        "period_s": point.point.period,
        "damping_n_m_s_per_rad": point.point.plan_value("damping_n_m_s_per_rad"),
        "rms_velocity_rad_per_s": point.lag.rms_velocity,
        "rms_torque_n_m": point.lag.rms_torque,
        "amplitude_difference_deg": float(point.lag.amplitude_difference.mean()) / DEGREE,
        "phase_shift_percent": 100.0 * float(point.lag.phase_shift.mean()),
    }


def _comparisons(result: DrivelineResult) -> Iterator[Comparison]:
    """Yield the results of chapter 2, compared with those of the thesis."""
    if result.uncorrected:
        largest = max(error_percentile(e.motion.deflection) for e in result.uncorrected) / DEGREE
        name = "deflection before correction, largest 95th percentile"
        text = f"{format_number(largest, 3)} deg"
        yield compare(name, text, "within 0.25 deg", "≤ 0.26 deg", largest <= 0.26)
    if result.regressions is not None:
        yield from _trend_comparisons(result.regressions, [e.lag for e in result.uncorrected])
    if result.offline is not None:
        for (_, name, thesis, target), offline in zip(OFFLINE, result.offline, strict=True):
            pooled = pooled_percentile(offline) / DEGREE
            worst = max(error_percentile(each) for each in offline) / DEGREE
            text = f"{pooled:.3f} deg pooled, worst set point {worst:.3f}"
            label = f"after offline correction (eq. 2.6), {name}"
            yield compare(label, text, thesis, target, pooled < 0.12 if target else None)
    for scheme in result.schemes:
        corrected, uncorrected = scheme.errors
        ratio = corrected / uncorrected
        errors = f"{corrected / DEGREE:.3f} of {uncorrected / DEGREE:.3f} deg"
        name, text = f"reference minus shaft, {scheme.name} correction", f"{100.0 * ratio:.0f} %"
        target = "≤ half of uncorrected"
        yield compare(name, f"{errors} ({text})", "not run", target, ratio <= 0.5)


def _trend_comparisons(trends: Regressions, lags: list[ShaftLag]) -> Iterator[Comparison]:
    amplitude, phase, delay = trends
    name, text = "amplitude difference over rms torque", f"R² {amplitude.r_squared:.3f}"
    yield compare(name, text, "linear, R² 0.97", "R² ≥ 0.95", amplitude.r_squared >= 0.95)
    slope = phase.slope_estimate().scaled(100.0, "% per rad/s")
    name, text = "phase shift over rms velocity", f"{slope}, R² {phase.r_squared:.2f}"
    yield compare(name, text, "falls, R² 0.81", "falls", slope.is_negative)
    yield compare("phase shift over rms torque", f"R² {delay.r_squared:.2f}")
    name = "phase shift over 1/velocity and torque/velocity (gap and compliance)"
    explained = explained_variance(lags)
    yield compare(name, f"R² {explained:.3f}: torque explains the rest of the velocity trend")


def _figures(result: DrivelineResult) -> Iterator[figures.FigureSpec]:
    """Yield the figures that the run has data for."""
    if result.regressions is not None:
        example = _nearest_setpoint(result.uncorrected, 15.0, 83.3)
        yield fig_2_2(example)
        yield fig_2_3(example)
        comparison = "Phase shift over torque, for comparison with Fig. 2.4"
        for trend, name, title, thesis in (
            (PHASE, "fig_2_4", "Fig. 2.4: phase shift over velocity", "thesis 0.81"),
            (DELAY, "fig_2_4_torque", comparison, "not in the thesis"),
            (AMPLITUDE, "fig_2_5", "Fig. 2.5: amplitude difference over torque", "thesis 0.97"),
        ):
            line = getattr(result.regressions, trend.line)
            caption = (
                "Mean of the periods with 5th and 95th percentile; line with its 95 % band. "
                f"R² {line.r_squared:.3f}; {thesis}."
            )
            axes = (X_LABELS[trend.x], f"{trend.y.replace('_', ' ')}, {trend.unit}")
            declare = figures.figure(title, caption, axes=axes, name=name)
            yield declare(_draw_trend_points)(trend, result.uncorrected, line)
        if result.offline is not None:
            example = _nearest_setpoint(result.uncorrected, 20.0, 104.0)
            yield fig_2_7(example, result.regressions)
            yield fig_2_8(result.uncorrected, result.offline)
    if result.uncorrected:
        yield fig_2_9(result.uncorrected, result.torque_map)
    if result.schemes:
        others = [other for scheme in result.schemes for _, other in scheme.pairs]
        if len({other.setpoint for other in others}) > 1:
            yield corrections(result.schemes)
        yield corrections_in_time(_nearest_setpoint(others, 15.0, 83.3), result.schemes)


def _nearest_setpoint(
    points: list[DrivelineSetpoint], amplitude: float, damping: float
) -> DrivelineSetpoint:
    def distance(each: DrivelineSetpoint) -> float:
        a, r = each.setpoint
        return abs(a / amplitude - 1.0) + abs(r / damping - 1.0)

    return min(points, key=distance)


def _setpoint_text(point: DrivelineSetpoint) -> str:
    return f"{point.setpoint[0]:g}°, R = {point.setpoint[1]:g} N·m·s/rad"


def _mean_angle(point: DrivelineSetpoint, angle: Floats) -> tuple[Any, Floats]:
    """Return time (s) and the mean period (deg) of an angle (rad)."""
    cut = point.motion.cut
    mean_angle = periods.mean_period(angle, cut) / DEGREE
    return cut.dt * np.arange(len(mean_angle)), mean_angle


@figures.figure(
    "Fig. 2.2: motor and shaft over a period",
    lambda point: f"{_setpoint_text(point)}; their difference is drawn 10 times as large.",
    axes=("time, s", "angle, deg"),
)
def fig_2_2(axes: Axes, point: DrivelineSetpoint) -> None:
    t, motor = _mean_angle(point, point.motion.motor)
    _, shaft = _mean_angle(point, point.motion.shaft)
    exaggerated = motor - 10.0 * (motor - shaft)
    axes.plot(t, motor, color=figures.BLUE, lw=1.8, label="motor")
    axes.plot(t, exaggerated, color=figures.RED, lw=1.8, label="shaft")
    axes.axhline(motor.max(), color=MUTED, lw=0.6, ls=":")
    axes.axhline(exaggerated.max(), color=MUTED, lw=0.6, ls=":")
    shift = 100.0 * point.lag.phase_shift.mean()
    loss = point.lag.amplitude_difference.mean() / DEGREE
    text = f"phase shift {shift:.3f} % of period\namplitude difference {loss:.4f}°"
    figures.annotate_corner(axes, text, "upper center")
    axes.margins(x=0.0)
    figures.legend(axes, "lower left")


@figures.figure(
    "Fig. 2.3: deflection and torque, period by period",
    lambda point: f"{_setpoint_text(point)}; later periods darker.",
    axes=("time in the period, s", "deflection, deg", "torque, N·m"),
    size=(7.2, 5.6),
)
def fig_2_3(panels: list[Axes], point: DrivelineSetpoint) -> None:
    cut = point.motion.cut
    signals = (point.motion.deflection / DEGREE, point.motion.torque)
    for axes, values in zip(panels, signals, strict=True):
        for i, period in enumerate(periods.split_periods(values, cut)):
            t = cut.dt * np.arange(len(period))
            axes.plot(t, period, color=figures.shade(i, cut.period_count), lw=0.7)
        axes.axhline(0.0, color=MUTED, lw=0.5)
    panels[-1].margins(x=0.0)


def _draw_trend_points(
    axes: Axes, trend: Trend, points: list[DrivelineSetpoint], line: Line
) -> None:
    figures.draw_trend(axes, line, [getattr(each.lag, trend.x) for each in points], trend.factor)
    shades = dict(figures.shaded(sorted({each.setpoint[1] for each in points})))
    for each in points:
        x, values = getattr(each.lag, trend.x), trend.factor * getattr(each.lag, trend.y)
        figures.draw_percentiles(axes, x, values, ms=5, color=shades[each.setpoint[1]], capsize=3)
    for damping, colour in shades.items():
        axes.plot([], [], "o", color=colour, label=f"R = {damping:g}")
    figures.legend(axes)


@figures.figure(
    "Fig. 2.7: motor corrected by equation 2.6",
    lambda point, trends: f"{_setpoint_text(point)}; below: difference from the shaft.",
    axes=("time, s", "angle, deg", "minus shaft, deg"),
    size=(7.2, 5.4),
    height_ratios=(1.2, 1.0),
)
def fig_2_7(panels: list[Axes], point: DrivelineSetpoint, trends: Regressions) -> None:
    upper, lower = panels
    correction = predict_correction(trends, point.lag)
    corrected = correct_offline(point.motion, correction, point.lag.amplitude)
    t, shaft = _mean_angle(point, point.motion.shaft)
    for values, colour, name, style in (
        (point.motion.motor, figures.BLUE, "motor", "-"),
        (corrected, figures.GREEN, "corrected motor", "--"),
    ):
        _, angle = _mean_angle(point, values)
        upper.plot(t, angle, style, color=colour, lw=1.6, label=name)
        lower.plot(t, angle - shaft, style, color=colour, lw=1.4)
    upper.plot(t, shaft, color=figures.RED, lw=1.2, label="shaft")
    lower.axhline(0.0, color=MUTED, lw=0.6)
    figures.legend(upper, "upper center")
    lower.margins(x=0.0)


@figures.figure(
    "Fig. 2.8: deflection, offline correction",
    "Mean, 5th and 95th percentile of each set point; thesis: within 0.25° before, below 0.12° "
    "after.",
    axes=(SETPOINT_LABEL, "deflection, deg"),
    size=(7.6, 4.6),
)
def fig_2_8(axes: Axes, points: list[DrivelineSetpoint], offline: OfflineErrors) -> None:
    before = [each.motion.deflection for each in points]
    for errors, colour, name, offset in (
        (before, figures.BLUE, "before", -0.15),
        (offline[0], figures.RED, "after", 0.15),
    ):
        style: dict[str, Any] = {"ms": 4, "color": colour, "capsize": 2.5}
        for i, error in enumerate(errors):
            label = name if i == 0 else None
            figures.draw_percentiles(axes, i + offset, np.abs(error) / DEGREE, label=label, **style)
    for level in (0.25, 0.12):
        axes.axhline(level, color=MUTED, lw=0.8, ls="--")
        axes.annotate(f"{level:g}°", (1.0, level), xycoords=("axes fraction", "data"), ha="right",
                      va="bottom", fontsize=7.5, color=MUTED)  # fmt: skip
    _label_setpoints(axes, [each.setpoint for each in points])
    axes.set_ylim(0.0, 1.15 * max(0.25, axes.get_ylim()[1]))  # room for the legend
    figures.legend(axes, "upper left", ncols=2)


def _label_setpoints(axes: Axes, setpoints: list[tuple[float, float]]) -> None:
    axes.set_xticks(range(len(setpoints)), [f"{a:g}\n{r:g}" for a, r in setpoints])


@figures.figure(
    "Fig. 2.9: deflection over torque",
    lambda points, fitted: (
        "Means over periods, darker for larger damping"
        + ("." if fitted is None else "; dashed: the fitted map.")
    ),
    axes=("driveline torque, N·m", "deflection, deg"),
    size=(7.2, 5.0),
)
def fig_2_9(axes: Axes, points: list[DrivelineSetpoint], fitted: TorqueMap | None) -> None:
    for each, colour in figures.shaded(sorted(points, key=lambda each: each.lag.rms_torque)):
        torque = periods.mean_period(each.motion.torque, each.motion.cut)
        _, deflection = _mean_angle(each, each.motion.deflection)
        axes.plot(torque, deflection, color=colour, lw=1.0)
    if fitted is not None:
        max_torque = max(np.abs(each.motion.torque).max() for each in points)
        for sign, label in ((1.0, "fitted map"), (-1.0, None)):
            x = sign * np.linspace(0.3, max_torque, 200)
            y = torque_map.map_deflection(fitted, x) / DEGREE
            axes.plot(x, y, "--", color=ACCENT, lw=1.6, label=label)
        figures.legend(axes, "upper left")
        figures.annotate_corner(
            axes,
            f"half gap {fitted.half_gap.value / DEGREE:.4f}°\n"
            f"soft zone {fitted.soft_zone.value / DEGREE:.3f}° to {fitted.knee.value:.1f} N·m\n"
            f"stiffness {fitted.stiffness.value:.0f} N·m/rad",
            "lower right",
        )
    axes.axhline(0.0, color=MUTED, lw=0.5)
    axes.axvline(0.0, color=MUTED, lw=0.5)


@figures.figure(
    "Corrections in the loop: reference minus shaft",
    "95th percentile of each set point, drift removed.",
    axes=(SETPOINT_LABEL, "reference minus shaft, 95th percentile, deg"),
    size=(7.2, 4.6),
)
def corrections(axes: Axes, schemes: list[CorrectionScheme]) -> None:
    pairs = [pair for scheme in schemes for pair in scheme.pairs]
    uncorrected = {other.setpoint: error_percentile(other.error) / DEGREE for _, other in pairs}
    setpoints = sorted(uncorrected)
    errors = np.array([uncorrected[each] for each in setpoints])
    x = range(len(setpoints))
    axes.plot(x, errors, "o", ms=6, color=DARK, label="uncorrected")
    axes.plot(x, errors / 2.0, "_", ms=12, color=MUTED, label="half of uncorrected")
    for scheme, (colour, mark) in zip(schemes, SCHEME_STYLES, strict=False):
        positions = [setpoints.index(corrected.setpoint) for corrected, _ in scheme.pairs]
        corrected_errors = [error_percentile(e.error) / DEGREE for e, _ in scheme.pairs]
        axes.plot(positions, corrected_errors, mark, ms=5, color=colour, label=scheme.name)
    _label_setpoints(axes, setpoints)
    axes.set_ylim(0.0, None)
    figures.legend(axes, ncols=2)


@figures.figure(
    "Corrections in the loop, over time",
    lambda uncorrected, schemes: f"{_setpoint_text(uncorrected)}, mean of the periods.",
    axes=("time in the period, s", "reference, deg", "minus shaft, deg"),
    size=(7.2, 5.4),
    height_ratios=(1.0, 1.2),
)
def corrections_in_time(
    panels: list[Axes], uncorrected: DrivelineSetpoint, schemes: list[CorrectionScheme]
) -> None:
    upper, lower = panels
    reference = uncorrected.error + uncorrected.motion.shaft
    upper.plot(*_mean_angle(uncorrected, reference), color=DARK, lw=1.2)
    lower.plot(*_mean_angle(uncorrected, uncorrected.error), color=DARK, label="uncorrected")
    for scheme, (colour, _) in zip(schemes, SCHEME_STYLES, strict=False):
        for corrected, other in scheme.pairs:
            if other.setpoint == uncorrected.setpoint:
                curve = _mean_angle(corrected, corrected.error)
                lower.plot(*curve, color=colour, label=scheme.name)
    lower.axhline(0.0, color=MUTED, lw=0.5)
    low, high = lower.get_ylim()
    lower.set_ylim(low, high + 0.2 * (high - low))  # room for the legend
    figures.legend(lower, "upper right", ncols=2)
    lower.margins(x=0.0)
