"""Tables, comparisons and calibration of the driveline session."""

from typing import Any

import numpy as np

from rig.analysis.session.deflection import judged, pooled
from rig.analysis.session.driveline import DEGREE, Driven, Found, highest
from rig.analysis.session.estimate import Estimate, mean, with_floor
from rig.analysis.session.linear_fit import Line, intercept, slope
from rig.analysis.session.regressions import explained
from rig.analysis.session.result import Column, Compared, Table, number, words

TICKED = 0.0005
"""Share of a velocity constant that commands held from tick to tick leave unknown."""
LEAST_TORQUE = 1.0  # N*m: within it the map goes from one flank's gap to the other's


def tables(found: Found) -> tuple[Table, ...]:
    """Set points, trends, corrections judged, and the map, as far as the run gives them."""
    made = [_points(found)]
    if found.trends is not None:
        made.append(_trends(found))
    if found.schemes:
        made.append(_schemes(found))
    if found.known is not None:
        made.append(_map(found))
    return tuple(made)


def _points(found: Found) -> Table:
    every = [*found.plain, *found.corrected]

    def column(name: str, unit: str, of: Any) -> Column:
        return Column(name, unit, tuple(of(each) for each in every))

    def spread(values: Any, times: float) -> tuple[float, float]:
        told = mean(values, "", "")
        return times * told.value, times * told.uncertainty

    offline = found.offline
    by_row = {}
    if offline is not None:
        for i, each in enumerate(found.plain):
            sets = (offline.by_all, offline.by_others, offline.by_torque)
            by_row[each.point.row] = [judged(errors[i]) / DEGREE for errors in sets]
    blank = [float("nan")] * 3
    phase = [spread(e.behind.phase_shift, 100.0) for e in every]
    loss = [spread(e.behind.amplitude_difference, 1.0 / DEGREE) for e in every]
    columns = [
        column("row", "", lambda e: e.point.row),
        column("amplitude", "deg", lambda e: e.point.number("amplitude_deg")),
        column("R", "N*m*s/rad", lambda e: e.point.number("damping_n_m_s_per_rad")),
        column("period", "s", lambda e: e.point.period),
        column("correction", "", lambda e: e.point.correction_name),
        column("periods", "", lambda e: e.motion.of.whole),
        column("rms velocity", "rad/s", lambda e: e.behind.rms_velocity),
        column("rms torque", "N*m", lambda e: e.behind.rms_torque),
        Column("phase shift", "% of period", tuple(p[0] for p in phase)),
        Column("phase shift ±", "% of period", tuple(p[1] for p in phase)),
        Column("amplitude difference", "deg", tuple(p[0] for p in loss)),
        Column("amplitude difference ±", "deg", tuple(p[1] for p in loss)),
        column("deflection mean", "deg", lambda e: e.behind.deflection_mean / DEGREE),
        column("deflection 5th", "deg", lambda e: e.behind.deflection_low / DEGREE),
        column("deflection 95th", "deg", lambda e: e.behind.deflection_high / DEGREE),
    ]
    if offline is not None:
        names = ("offline 95th", "offline 95th, left out", "offline 95th, delay over torque")
        columns += [
            Column(name, "deg", tuple(by_row.get(e.point.row, blank)[i] for e in every))
            for i, name in enumerate(names)
        ]
    columns += [
        column("reference − shaft 95th", "deg", lambda e: judged(e.error) / DEGREE),
        column("reference − motor 95th", "deg", lambda e: judged(e.following) / DEGREE),
        column("drift", "deg/min", lambda e: 60.0 * e.drift / DEGREE),
    ]
    return Table("driveline_points", "Table 2.1: set points and what they gave", tuple(columns))


def _trends(found: Found) -> Table:
    assert found.trends is not None
    rows = []
    for name, fitted, times, unit, per, thesis in (
        ("amplitude difference over rms torque", found.trends.amplitude, 1 / DEGREE, "deg", "N*m",
         "rises, R² 0.97"),
        ("phase shift over rms velocity", found.trends.phase, 100.0, "% of period", "rad/s",
         "falls, R² 0.81"),
        ("phase shift over rms torque", found.trends.delay, 100.0, "% of period", "N*m", ""),
    ):  # fmt: skip
        steep, level = slope(fitted, "", ""), intercept(fitted, "", "")
        numbers = (steep.value, steep.uncertainty, level.value, level.uncertainty)
        scaled = (times * x for x in numbers)
        rows.append((name, *scaled, fitted.r_squared, unit, f"{unit} per {per}", thesis))
    heads = ("trend", "slope", "slope ±", "at zero", "at zero ±", "R²", "unit", "unit of slope")
    columns = zip(*rows, strict=True)
    return Table(
        "driveline_trends",
        "Trends between set points (± 95 %)",
        tuple(Column(h, "", c) for h, c in zip((*heads, "thesis"), columns, strict=True)),
    )


def _schemes(found: Found) -> Table:
    rows = []
    for scheme in found.schemes:
        for one, other in scheme.pairs:
            a, b = judged(one.error) / DEGREE, judged(other.error) / DEGREE
            rows.append((scheme.name, *one.place, b, a, a / b))
        a, b = scheme.corrected / DEGREE, scheme.uncorrected / DEGREE
        rows.append((f"{scheme.name}, pooled", float("nan"), float("nan"), b, a, a / b))
    heads = (
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
        "Corrections in the loop: detrended reference less shaft",
        tuple(Column(*head, values) for head, values in zip(heads, columns, strict=True)),
    )


def map_points(found: Found) -> tuple[list[float], list[float]]:
    """Torque (N*m, rising) and deflection (deg) of the map, in lines between them."""
    assert found.known is not None
    known = found.known
    top = max(float(np.abs(each.motion.torque).max()) for each in found.plain)
    sides = [LEAST_TORQUE, known.knee.value, max(top, 1.5 * known.knee.value)]
    torques = np.array([*(-x for x in sides[::-1]), *sides])
    size = np.abs(torques)
    bent = known.half_gap.value + known.soft_zone.value * np.minimum(size / known.knee.value, 1.0)
    bent += size / known.stiffness.value
    return torques.tolist(), (np.sign(torques) * bent / DEGREE).tolist()


def _map(found: Found) -> Table:
    torque, bent = map_points(found)
    columns = (Column("torque", "N*m", tuple(torque)), Column("deflection", "deg", tuple(bent)))
    return Table("deflection_map", "Fig. 2.9: deflection over torque, in lines between", columns)


def constants(found: Found) -> dict[str, Estimate]:
    """Gap, stiffness and the trends, for the calibration file."""
    out: dict[str, Estimate] = {}
    if found.trends is not None:
        how = f"fundamentals under load, mean of {len(found.plain)} set points, by their scatter"
        gain = mean([e.gain for e in found.plain], "rad/s/V", how)
        out["velocity_constant_loaded"] = with_floor(gain, TICKED)
        out["velocity_loop_lag"] = mean([e.lag for e in found.plain], "s", how)
    if found.known is not None:
        known = found.known
        out["half_gap"] = _degrees(known.half_gap)
        out["soft_zone"] = _degrees(known.soft_zone)
        out["soft_zone_torque"] = known.knee
        out["stiffness"] = known.stiffness
    if found.trends is not None:
        how = f"line through {found.trends.phase.points} set points, by their scatter"

        def add(name: str, fitted: Line, unit: str, per: str, times: float) -> None:
            steep, level = slope(fitted, "", how), intercept(fitted, "", how)
            for key, of, said in (("slope", steep, f"{unit}/({per})"), ("at_zero", level, unit)):
                scaled = Estimate(times * of.value, times * of.uncertainty, said, how)
                out[f"{name}_{key}"] = scaled

        add("amplitude_difference", found.trends.amplitude, "deg", "N*m", 1 / DEGREE)
        add("phase_shift", found.trends.phase, "%", "rad/s", 100.0)
        add("phase_shift_over_torque", found.trends.delay, "%", "N*m", 100.0)
    return out


def _degrees(of: Estimate) -> Estimate:
    return of._replace(value=of.value / DEGREE, uncertainty=of.uncertainty / DEGREE, unit="deg")


def maps(found: Found) -> dict[str, Any]:
    """Further parts of the calibration file: what corrections are made of."""
    out: dict[str, Any] = {}
    if found.known is not None:
        torque, bent = map_points(found)
        out["deflection_map"] = {"torque_n_m": torque, "deflection_deg": bent}
    if found.plain:
        out["driveline"] = [_line_of(each) for each in found.plain]
    return out


def _line_of(each: Driven) -> dict[str, float]:
    return {
        "row": each.point.row,
        "amplitude_deg": each.point.number("amplitude_deg"),
        "period_s": each.point.period,
        "damping_n_m_s_per_rad": each.point.number("damping_n_m_s_per_rad"),
        "rms_velocity_rad_per_s": each.behind.rms_velocity,
        "rms_torque_n_m": each.behind.rms_torque,
        "amplitude_difference_deg": float(each.behind.amplitude_difference.mean()) / DEGREE,
        "phase_shift_percent": 100.0 * float(each.behind.phase_shift.mean()),
    }


def compared(found: Found) -> tuple[Compared, ...]:
    """The evidence of chapter 2 beside the thesis's."""
    out = []
    if found.plain:
        most = highest(found) / DEGREE
        out.append(
            Compared("deflection before correction, largest 95th percentile", "within 0.25 deg",
                     "≤ 0.26 deg", f"{number(most, 3)} deg", most <= 0.26)
        )  # fmt: skip
    if found.trends is not None:
        out += _compared_trends(found)
    if found.offline is not None:
        out += _compared_offline(found)
    for scheme in found.schemes:
        ratio = scheme.corrected / scheme.uncorrected
        said = f"{scheme.corrected / DEGREE:.3f} of {scheme.uncorrected / DEGREE:.3f} deg"
        out.append(
            Compared(f"reference less shaft, {scheme.name} correction", "not run",
                     "≤ half of uncorrected", f"{said} ({100.0 * ratio:.0f} %)", ratio <= 0.5)
        )  # fmt: skip
    return tuple(out)


def _compared_trends(found: Found) -> list[Compared]:
    assert found.trends is not None
    amplitude, phase, delay = found.trends
    steep = slope(phase, "% per rad/s", "")
    both = explained([each.behind for each in found.plain])
    return [
        Compared("amplitude difference over rms torque", "linear, R² 0.97", "R² ≥ 0.95",
                 f"R² {amplitude.r_squared:.3f}", amplitude.r_squared >= 0.95),
        Compared("phase shift over rms velocity", "falls, R² 0.81", "falls",
                 f"{words(steep, times=100.0)}, R² {phase.r_squared:.2f}",
                 phase.slope < 0.0),
        Compared("phase shift over rms torque", "", "", f"R² {delay.r_squared:.2f}", None),
        Compared("phase shift over 1/velocity and torque/velocity (gap and compliance)", "", "",
                 f"R² {both:.3f}: what velocity alone leaves is the torque", None),
    ]  # fmt: skip


def _compared_offline(found: Found) -> list[Compared]:
    assert found.offline is not None
    limit = 0.12
    out = []
    for name, errors in (
        ("regressions of all set points", found.offline.by_all),
        ("without the judged one", found.offline.by_others),
        ("without it, delay over torque", found.offline.by_torque),
    ):
        value = pooled(errors) / DEGREE
        worst = max(judged(each) for each in errors) / DEGREE
        first = errors is found.offline.by_all
        out.append(
            Compared(
                f"after offline correction (eq. 2.6), {name}",
                "< 0.12 deg" if first else "",
                "pooled < 0.12 deg" if first else "",
                f"{value:.3f} deg pooled, worst set point {worst:.3f}",
                value < limit if first else None,
            )
        )
    return out
