"""Tables, comparisons and calibration of the driveline session."""

from collections.abc import Callable
from typing import Any

import numpy as np

from rig.kinds.oswec_bench.products.deflection import error_percentile, pooled_percentile
from rig.kinds.oswec_bench.products.driveline import (
    DEGREE,
    DrivelineResult,
    DrivelineSetpoint,
    max_deflection,
)
from rig.kinds.oswec_bench.products.estimate import Estimate, mean, with_floor
from rig.kinds.oswec_bench.products.linear_fit import Line, intercept, slope
from rig.kinds.oswec_bench.products.regressions import explained_variance
from rig.kinds.oswec_bench.products.result import (
    Column,
    Comparison,
    Table,
    format_estimate,
    format_number,
)

SAMPLE_HOLD_UNCERTAINTY = 0.0005
"""Relative uncertainty of a velocity constant due to commands that are constant during a tick."""
MIN_MAP_TORQUE = 1.0  # N*m, below it the map crosses the gap from flank to flank


def tables(result: DrivelineResult) -> tuple[Table, ...]:
    """Return set points, trends, rated corrections and the map, as far as the run has data for
    them.
    """
    result_tables = [_setpoint_table(result)]
    if result.regressions is not None:
        result_tables.append(_trend_table(result))
    if result.schemes:
        result_tables.append(_scheme_table(result))
    if result.torque_map is not None:
        result_tables.append(_map_table(result))
    return tuple(result_tables)


def _setpoint_table(result: DrivelineResult) -> Table:
    points = [*result.uncorrected, *result.corrected]

    def column(name: str, unit: str, value_of: Callable[[DrivelineSetpoint], Any]) -> Column:
        return Column(name, unit, tuple(value_of(each) for each in points))

    def mean_with_interval(values: Any, factor: float) -> tuple[float, float]:
        estimate = mean(values, "", "")
        return factor * estimate.value, factor * estimate.uncertainty

    offline = result.offline
    errors_by_row = {}
    if offline is not None:
        for i, each in enumerate(result.uncorrected):
            sets = (offline.all_points, offline.leave_one_out, offline.delay_over_torque)
            errors_by_row[each.point.row] = [
                error_percentile(errors[i]) / DEGREE for errors in sets
            ]
    missing = [float("nan")] * 3
    phase = [mean_with_interval(e.lag.phase_shift, 100.0) for e in points]
    loss = [mean_with_interval(e.lag.amplitude_difference, 1.0 / DEGREE) for e in points]
    columns = [
        column("row", "", lambda e: e.point.row),
        column("amplitude", "deg", lambda e: e.point.plan_value("amplitude_deg")),
        column("R", "N*m*s/rad", lambda e: e.point.plan_value("damping_n_m_s_per_rad")),
        column("period", "s", lambda e: e.point.period),
        column("correction", "", lambda e: e.point.correction_name),
        column("periods", "", lambda e: e.motion.cut.period_count),
        column("rms velocity", "rad/s", lambda e: e.lag.rms_velocity),
        column("rms torque", "N*m", lambda e: e.lag.rms_torque),
        Column("phase shift", "% of period", tuple(p[0] for p in phase)),
        Column("phase shift ±", "% of period", tuple(p[1] for p in phase)),
        Column("amplitude difference", "deg", tuple(p[0] for p in loss)),
        Column("amplitude difference ±", "deg", tuple(p[1] for p in loss)),
        column("deflection mean", "deg", lambda e: e.lag.deflection_mean / DEGREE),
        column("deflection 5th", "deg", lambda e: e.lag.deflection_low / DEGREE),
        column("deflection 95th", "deg", lambda e: e.lag.deflection_high / DEGREE),
    ]
    if offline is not None:
        names = ("offline 95th", "offline 95th, leave one out", "offline 95th, delay over torque")
        columns += [
            Column(name, "deg", tuple(errors_by_row.get(e.point.row, missing)[i] for e in points))
            for i, name in enumerate(names)
        ]
    columns += [
        column("reference − shaft 95th", "deg", lambda e: error_percentile(e.error) / DEGREE),
        column(
            "reference − motor 95th", "deg", lambda e: error_percentile(e.following_error) / DEGREE
        ),
        column("drift", "deg/min", lambda e: 60.0 * e.drift / DEGREE),
    ]
    return Table("driveline_points", "Table 2.1: set points and results", tuple(columns))


def _trend_table(result: DrivelineResult) -> Table:
    trends = result.regressions
    assert trends is not None
    rows = []
    for name, line, factor, unit, per, thesis in (
        ("amplitude difference over rms torque", trends.amplitude, 1 / DEGREE, "deg", "N*m",
         "rises, R² 0.97"),
        ("phase shift over rms velocity", trends.velocity_phase, 100.0, "% of period", "rad/s",
         "falls, R² 0.81"),
        ("phase shift over rms torque", trends.torque_phase, 100.0, "% of period", "N*m", ""),
    ):  # fmt: skip
        slope_estimate, intercept_estimate = slope(line, "", ""), intercept(line, "", "")
        numbers = (
            slope_estimate.value,
            slope_estimate.uncertainty,
            intercept_estimate.value,
            intercept_estimate.uncertainty,
        )
        scaled = (factor * x for x in numbers)
        rows.append((name, *scaled, line.r_squared, unit, f"{unit} per {per}", thesis))
    headings = ("trend", "slope", "slope ±", "at zero", "at zero ±", "R²", "unit", "unit of slope")
    columns = zip(*rows, strict=True)
    return Table(
        "driveline_trends",
        "Trends between set points (± 95 %)",
        tuple(Column(h, "", c) for h, c in zip((*headings, "thesis"), columns, strict=True)),
    )


def _scheme_table(result: DrivelineResult) -> Table:
    rows = []
    for scheme in result.schemes:
        for corrected, uncorrected in scheme.pairs:
            corrected_error, uncorrected_error = (
                error_percentile(corrected.error) / DEGREE,
                error_percentile(uncorrected.error) / DEGREE,
            )
            rows.append(
                (
                    scheme.name,
                    *corrected.setpoint,
                    uncorrected_error,
                    corrected_error,
                    corrected_error / uncorrected_error,
                )
            )
        corrected_error, uncorrected_error = (
            scheme.corrected_error / DEGREE,
            scheme.uncorrected_error / DEGREE,
        )
        rows.append(
            (
                f"{scheme.name}, pooled",
                float("nan"),
                float("nan"),
                uncorrected_error,
                corrected_error,
                corrected_error / uncorrected_error,
            )
        )
    headings = (
        ("correction", ""),
        ("amplitude", "deg"),
        ("R", "N*m*s/rad"),
        ("uncorrected 95th", "deg"),
        ("corrected 95th", "deg"),
        ("corrected / uncorrected", ""),
    )
    columns = zip(*rows, strict=True)
    return Table(
        "driveline_corrections",
        "Corrections in the loop: detrended reference minus shaft",
        tuple(Column(*head, values) for head, values in zip(headings, columns, strict=True)),
    )


def map_points(result: DrivelineResult) -> tuple[list[float], list[float]]:
    """Return torque (N*m, rising) and deflection (deg) at the corners of the map."""
    assert result.torque_map is not None
    torque_map = result.torque_map
    max_torque = max(float(np.abs(each.motion.torque).max()) for each in result.uncorrected)
    sides = [MIN_MAP_TORQUE, torque_map.knee.value, max(max_torque, 1.5 * torque_map.knee.value)]
    torques = np.array([*(-x for x in sides[::-1]), *sides])
    magnitude = np.abs(torques)
    deflection = torque_map.half_gap.value + torque_map.soft_zone.value * np.minimum(
        magnitude / torque_map.knee.value, 1.0
    )
    deflection += magnitude / torque_map.stiffness.value
    return torques.tolist(), (np.sign(torques) * deflection / DEGREE).tolist()


def _map_table(result: DrivelineResult) -> Table:
    torque, deflection = map_points(result)
    columns = (
        Column("torque", "N*m", tuple(torque)),
        Column("deflection", "deg", tuple(deflection)),
    )
    return Table("deflection_map", "Fig. 2.9: deflection over torque, linear in between", columns)


def constants(result: DrivelineResult) -> dict[str, Estimate]:
    """Return gap, stiffness and the trends, for the calibration file."""
    estimates: dict[str, Estimate] = {}
    if result.regressions is not None:
        count = len(result.uncorrected)
        method = f"fundamentals under load, mean of {count} set points, by their scatter"
        gain = mean([e.drive_gain for e in result.uncorrected], "rad/s/V", method)
        estimates["velocity_constant_loaded"] = with_floor(gain, SAMPLE_HOLD_UNCERTAINTY)
        estimates["velocity_loop_lag"] = mean(
            [e.drive_lag for e in result.uncorrected], "s", method
        )
    if result.torque_map is not None:
        torque_map = result.torque_map
        estimates["half_gap"] = _in_degrees(torque_map.half_gap)
        estimates["soft_zone"] = _in_degrees(torque_map.soft_zone)
        estimates["soft_zone_torque"] = torque_map.knee
        estimates["stiffness"] = torque_map.stiffness
    if result.regressions is not None:
        count = result.regressions.velocity_phase.point_count
        method = f"line through {count} set points, by their scatter"

        def add_line(name: str, line: Line, unit: str, per: str, factor: float) -> None:
            slope_estimate, intercept_estimate = (
                slope(line, "", method),
                intercept(line, "", method),
            )
            for key, estimate, estimate_unit in (
                ("slope", slope_estimate, f"{unit}/({per})"),
                ("at_zero", intercept_estimate, unit),
            ):
                scaled = Estimate(
                    factor * estimate.value, factor * estimate.uncertainty, estimate_unit, method
                )
                estimates[f"{name}_{key}"] = scaled

        add_line("amplitude_difference", result.regressions.amplitude, "deg", "N*m", 1 / DEGREE)
        add_line("phase_shift", result.regressions.velocity_phase, "%", "rad/s", 100.0)
        add_line("phase_shift_over_torque", result.regressions.torque_phase, "%", "N*m", 100.0)
    return estimates


def _in_degrees(estimate: Estimate) -> Estimate:
    return estimate._replace(
        value=estimate.value / DEGREE, uncertainty=estimate.uncertainty / DEGREE, unit="deg"
    )


def calibration_maps(result: DrivelineResult) -> dict[str, Any]:
    """Return further parts of the calibration file, from which corrections are computed."""
    parts: dict[str, Any] = {}
    if result.torque_map is not None:
        torque, deflection = map_points(result)
        parts["deflection_map"] = {"torque_n_m": torque, "deflection_deg": deflection}
    if result.uncorrected:
        parts["driveline"] = [_driveline_entry(each) for each in result.uncorrected]
    return parts


def _driveline_entry(point: DrivelineSetpoint) -> dict[str, float]:
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


def comparisons(result: DrivelineResult) -> tuple[Comparison, ...]:
    """Return the results of chapter 2, compared with those of the thesis."""
    items = []
    if result.uncorrected:
        largest = max_deflection(result) / DEGREE
        items.append(
            Comparison("deflection before correction, largest 95th percentile", "within 0.25 deg",
                     "≤ 0.26 deg", f"{format_number(largest, 3)} deg", largest <= 0.26)
        )  # fmt: skip
    if result.regressions is not None:
        items += _trend_comparisons(result)
    if result.offline is not None:
        items += _offline_comparisons(result)
    for scheme in result.schemes:
        ratio = scheme.corrected_error / scheme.uncorrected_error
        errors = (
            f"{scheme.corrected_error / DEGREE:.3f} of {scheme.uncorrected_error / DEGREE:.3f} deg"
        )
        items.append(
            Comparison(f"reference minus shaft, {scheme.name} correction", "not run",
                     "≤ half of uncorrected", f"{errors} ({100.0 * ratio:.0f} %)", ratio <= 0.5)
        )  # fmt: skip
    return tuple(items)


def _trend_comparisons(result: DrivelineResult) -> list[Comparison]:
    assert result.regressions is not None
    amplitude, phase, delay = result.regressions
    slope_estimate = slope(phase, "% per rad/s", "")
    combined_r_squared = explained_variance([each.lag for each in result.uncorrected])
    return [
        Comparison(
            "amplitude difference over rms torque",
            "linear, R² 0.97",
            "R² ≥ 0.95",
            f"R² {amplitude.r_squared:.3f}",
            amplitude.r_squared >= 0.95,
        ),
        Comparison(
            "phase shift over rms velocity",
            "falls, R² 0.81",
            "falls",
            f"{format_estimate(slope_estimate, factor=100.0)}, R² {phase.r_squared:.2f}",
            phase.slope < 0.0,
        ),
        Comparison("phase shift over rms torque", "", "", f"R² {delay.r_squared:.2f}", None),
        Comparison(
            "phase shift over 1/velocity and torque/velocity (gap and compliance)",
            "",
            "",
            f"R² {combined_r_squared:.3f}: torque explains the rest of the velocity trend",
            None,
        ),
    ]


def _offline_comparisons(result: DrivelineResult) -> list[Comparison]:
    assert result.offline is not None
    limit = 0.12
    comparisons = []
    for name, errors in (
        ("regressions of all set points", result.offline.all_points),
        ("without the rated set point", result.offline.leave_one_out),
        ("without it, delay over torque", result.offline.delay_over_torque),
    ):
        pooled_error = pooled_percentile(errors) / DEGREE
        worst = max(error_percentile(each) for each in errors) / DEGREE
        has_target = errors is result.offline.all_points
        comparisons.append(
            Comparison(
                f"after offline correction (eq. 2.6), {name}",
                "< 0.12 deg" if has_target else "",
                "pooled < 0.12 deg" if has_target else "",
                f"{pooled_error:.3f} deg pooled, worst set point {worst:.3f}",
                pooled_error < limit if has_target else None,
            )
        )
    return comparisons
