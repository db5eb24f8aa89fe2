"""The brake map session: torque over current, both branches."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import SubFigure

from rig.kinds.oswec_bench.products import brake_map
from rig.kinds.oswec_bench.products.brake_map import BrakeMap, BrakePoint
from rig.kinds.oswec_bench.products.drawing import BLUE, RED, annotate_corner, prepare_axes
from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.points import SessionRun
from rig.kinds.oswec_bench.products.result import (
    Column,
    Comparison,
    FigureSpec,
    Result,
    Table,
    format_estimate,
    format_number,
)

THESIS_RANGE = (2.0, 95.0)
"""Torque range of the brake, N*m: OSWEC thesis, section 2.1."""


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run of the session."""
    points = session.complete_points
    brake_points = brake_map.brake_points(
        [point.motion() for point in points],
        [float(np.median(point.brake_current)) for point in points],
    )
    measured_map = brake_map.brake_map(brake_points)
    idle = brake_points[int(np.argmin([each.current for each in brake_points]))]
    constants = {"brake_residual": idle.torque, "brake_hysteresis": measured_map.hysteresis}
    return Result(
        (_table(brake_points, [point.row for point in points]),),
        _comparisons(brake_points, measured_map, idle.torque),
        constants,
        (
            FigureSpec(
                "brake_map",
                "The brake's torque over current",
                "Points with 95 % intervals.",
                (7.2, 4.8),
                partial(_draw, measured_map),
            ),
        ),
        (
            "Torque is the load cell's, so the bearing's (below 0.4 N·m) is in it. The branch "
            "of a point follows from the current of the previous set point.",
        ),
        _maps(measured_map),
    )


def _table(brake_points: Sequence[BrakePoint], rows: list[int]) -> Table:
    return Table(
        "brake_points",
        "Brake: torque by set point",
        (
            Column("row", "", tuple(rows)),
            Column("current", "A", tuple(each.current for each in brake_points)),
            Column("branch", "", tuple("rising" if e.rising else "falling" for e in brake_points)),
            Column("torque", "N*m", tuple(each.torque.value for each in brake_points)),
            Column("torque ±", "N*m", tuple(each.torque.uncertainty for each in brake_points)),
        ),
    )


def _comparisons(
    brake_points: Sequence[BrakePoint], measured_map: BrakeMap, idle: Estimate
) -> tuple[Comparison, ...]:
    max_torque = max(each.torque.value for each in brake_points)
    return (
        Comparison("residual torque", f"{THESIS_RANGE[0]:g} N·m", "", format_estimate(idle), None),
        Comparison(
            "largest torque",
            f"{THESIS_RANGE[1]:g} N·m",
            "",
            f"{format_number(max_torque, 4)} N·m",
            None,
        ),
        Comparison(
            "falling less rising branch", "", "", format_estimate(measured_map.hysteresis), None
        ),
    )


def _maps(measured_map: BrakeMap) -> dict[str, Any]:
    branches = {}
    for name in ("rising", "falling"):
        branch = getattr(measured_map, name)
        strictly_rising = np.append(True, np.diff(np.maximum.accumulate(branch.torque)) > 1e-6)
        if strictly_rising.sum() < 2:
            return {}
        branches[name] = {
            "current_a": branch.current[strictly_rising].tolist(),
            "torque_n_m": branch.torque[strictly_rising].tolist(),
            "uncertainty_n_m": branch.uncertainty[strictly_rising].tolist(),
        }
    return {"brake_map": branches}


def _draw(measured_map: BrakeMap, body: SubFigure) -> None:
    axes = prepare_axes(body, "brake current, A", "torque, N·m")
    for name, colour, mark in (("rising", BLUE, "o-"), ("falling", RED, "s--")):
        branch = getattr(measured_map, name)
        if len(branch.current):
            half = np.nan_to_num(branch.uncertainty)
            axes.errorbar(branch.current, branch.torque, half, fmt=mark, ms=4, lw=1.2,
                          color=colour, capsize=2.5, label=name)  # fmt: skip
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False, fontsize=8, loc="upper left")
    annotate_corner(
        axes, f"falling less rising {format_estimate(measured_map.hysteresis)}", "lower right"
    )
