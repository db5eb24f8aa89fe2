"""The power take-off session of the flap: power over the motor's damping, and its optimum."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.kinds.oswec_bench.products import flap_pto
from rig.kinds.oswec_bench.products.drawing import RED, prepare_axes, shade
from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.flap_pto import OptimalDamping, PtoPoint
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import (
    Column,
    Comparison,
    FigureSpec,
    Result,
    Table,
    format_estimate,
)

IDEAL_DAMPING = (42.0, 104.0)
"""N*m*s/rad: ideal dampings in waves of 1 to 2 s and 0.1 m (OSWEC thesis, section 2.1)."""

WINDOW = 0.02
"""Window of the moving-window differentiator, s."""


class DampingPoint(NamedTuple):
    """A set point and its results."""

    point: SetpointData
    pto: PtoPoint


class DampingSweep(NamedTuple):
    """All dampings in one sea."""

    label: str
    suffix: str  # of the names of its constants
    rows: list[DampingPoint]  # in the order of damping
    optimum: OptimalDamping | None


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run of the session."""
    rows = [_damping_point(point, session.torque_constant) for point in session.complete_points]
    if not rows:
        raise ValueError("no set point was measured completely")
    sweeps = _damping_sweeps(rows, irregular=session.irregular)
    constants: dict[str, Estimate] = {}
    for each in sweeps:
        if each.optimum is not None:
            constants[f"flap_best_damping{each.suffix}"] = each.optimum.damping
            constants[f"flap_best_power{each.suffix}"] = each.optimum.power
    return Result(
        (_table(sweeps),),
        tuple(_comparison(each) for each in sweeps),
        constants,
        (
            FigureSpec(
                "flap_power",
                "Power of the flap over the damping at the load cell",
                "Points: measured at the load cell, 95 %; lines: the fit; crosses: power at "
                "the motor.",
                (7.4, 4.8),
                partial(_draw_power, sweeps),
            ),
            FigureSpec(
                "flap_damping",
                "Damping at the load cell over requested damping",
                "Above the dashed line the gearbox's friction adds to the motor.",
                (6.4, 4.2),
                partial(_draw_damping, sweeps),
            ),
        ),
        (
            "Positive power is absorbed from the waves. The motor's power follows from its "
            "measured current and the constant in use, before electrical losses.",
            "The optimal damping is the one at the load cell; the motor's inertia is part of the "
            "flap's impedance.",
        ),
    )


def _damping_point(point: SetpointData, constant: float) -> DampingPoint:
    pto = flap_pto.pto_point(
        point.shaft,
        point.motor,
        point.torque,
        constant * point.current,
        point.whole_periods(),
        WINDOW,
    )
    return DampingPoint(point, pto)


def _damping_sweeps(rows: list[DampingPoint], *, irregular: bool) -> list[DampingSweep]:
    seas: dict[tuple[float, float], list[DampingPoint]] = {}
    for each in rows:
        seas.setdefault((each.point.plan_value("wave_amplitude_m"), each.point.period), []).append(
            each
        )
    sweeps = []
    for (wave, period), sweep_rows in sorted(seas.items()):
        sweep_rows.sort(key=lambda each: each.pto.damping)
        label = f"{1e3 * wave:g} mm, " + ("irregular" if irregular else f"{period:g} s")
        suffix = "" if len(seas) == 1 else f"_{round(1e3 * wave)}mm_{round(1e3 * period)}ms"
        sweeps.append(
            DampingSweep(
                label,
                suffix,
                sweep_rows,
                flap_pto.optimal_damping([each.pto for each in sweep_rows]),
            )
        )
    return sweeps


def _table(sweeps: list[DampingSweep]) -> Table:
    rows = [(each.label, row.point, row.pto) for each in sweeps for row in each.rows]
    return Table(
        "flap_power",
        "Power by set point",
        (
            Column("row", "", tuple(point.row for _, point, _ in rows)),
            Column("waves", "", tuple(label for label, _, _ in rows)),
            Column("requested damping", "N*m*s/rad",
                   tuple(p.plan_value("pto_damping_n_m_s_per_rad") for _, p, _ in rows)),
            Column("measured damping", "N*m*s/rad", tuple(t.damping for *_, t in rows)),
            Column("reactance", "N*m*s/rad", tuple(t.reactance for *_, t in rows)),
            Column("amplitude", "deg", tuple(float(np.degrees(t.amplitude)) for *_, t in rows)),
            Column("power of the flap", "W", tuple(t.power.value for *_, t in rows)),
            Column("power of the flap ±", "W", tuple(t.power.uncertainty for *_, t in rows)),
            Column("power of the motor", "W", tuple(t.motor_power.value for *_, t in rows)),
        ),
    )  # fmt: skip


def _comparison(sweep: DampingSweep) -> Comparison:
    if sweep.optimum is None:
        measured = f"too few dampings for a fit ({len(sweep.rows)} of {flap_pto.MIN_DAMPINGS})"
    else:
        measured = (
            f"{format_estimate(sweep.optimum.damping)}, {format_estimate(sweep.optimum.power)}"
        )
    thesis_range = f"{IDEAL_DAMPING[0]:g} to {IDEAL_DAMPING[1]:g} N·m·s/rad in waves of 1 to 2 s"
    return Comparison(
        f"optimal damping and its power, waves {sweep.label}", thesis_range, "", measured, None
    )


def _draw_power(sweeps: list[DampingSweep], body: SubFigure) -> None:
    axes = prepare_axes(body, "damping at the load cell, N·m·s/rad", "mean power, W")
    max_power = 0.0
    for i, each in enumerate(sweeps):
        colour = shade(i + 1, len(sweeps) + 1)
        damping = [row.pto.damping for row in each.rows]
        power = [row.pto.power.value for row in each.rows]
        half_widths = np.nan_to_num([row.pto.power.uncertainty for row in each.rows])
        max_power = max(max_power, *power)
        label = each.label
        if each.optimum is not None:
            label += (
                f": {format_estimate(each.optimum.damping)}, {format_estimate(each.optimum.power)}"
            )
            damping_grid = np.linspace(0.0, 1.05 * max(damping), 300)
            axes.plot(
                damping_grid,
                flap_pto.expected_power(each.optimum.unknowns, damping_grid),
                lw=1.2,
                color=colour,
            )
            optimum = each.optimum.damping.value, each.optimum.power.value
            axes.plot(*optimum, "*", ms=11, color=RED, zorder=5)
        axes.errorbar(
            damping, power, half_widths, fmt="o", ms=4, capsize=2.5, color=colour, label=label
        )
        axes.plot(
            damping, [row.pto.motor_power.value for row in each.rows], "x", ms=4, color=colour
        )
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, 1.35 * max_power)
    axes.legend(frameon=False, fontsize=8, title="waves: optimal damping and its power (stars)",
                title_fontsize=8, loc="upper right")  # fmt: skip


def _draw_damping(sweeps: list[DampingSweep], body: SubFigure) -> None:
    axes = prepare_axes(
        body, "requested damping of the motor, N·m·s/rad", "measured damping, N·m·s/rad"
    )
    max_requested = 0.0
    for i, each in enumerate(sweeps):
        requested = [row.point.plan_value("pto_damping_n_m_s_per_rad") for row in each.rows]
        measured = [row.pto.damping for row in each.rows]
        max_requested = max(max_requested, *requested)
        axes.plot(
            requested, measured, "o", ms=4, color=shade(i + 1, len(sweeps) + 1), label=each.label
        )
    axes.plot([0.0, max_requested], [0.0, max_requested], "k--", lw=0.9)
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False, fontsize=8, title="waves", title_fontsize=8)
