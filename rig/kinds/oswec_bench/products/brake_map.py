"""The brake map session: brake torque over current, rising and falling, each with its interval."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from rig.kinds.oswec_bench.products import figures, periods
from rig.kinds.oswec_bench.products.deflection import WINDOW, Motion
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, format_number, mean
from rig.kinds.oswec_bench.products.points import SessionRun
from rig.kinds.oswec_bench.products.result import Columns, Result, compare, table

THESIS_RANGE = (2.0, 95.0)
"""Torque range of the brake, N*m: OSWEC thesis, section 2.1."""


class BrakePoint(NamedTuple):
    """One set point: a brake current, and the brake's torque on the moving shaft."""

    current: float  # A, measured
    torque: Estimate  # N*m, mean of both directions
    rising: bool  # reached from a smaller current


class Branch(NamedTuple):
    """Torque over current; currents are strictly rising."""

    current: Floats  # A
    torque: Floats  # N*m
    uncertainty: Floats  # N*m


class BrakeMap(NamedTuple):
    """Both branches; a falling branch that was not measured is empty."""

    rising: Branch
    falling: Branch
    hysteresis: Estimate  # N*m, falling less rising branch at equal current, mean


def brake_torque(motion: Motion) -> Estimate:
    """Return the torque against the rotation at speed: half the difference of both directions.

    Only samples with at least half of the shaft's top speed count: there the magnetisation has
    settled and the driveline's gap is closed. The interval rests on the scatter of the periods.
    """
    velocity = periods.velocity(motion.shaft, motion.cut.dt, WINDOW)
    fast = 0.5 * np.abs(velocity).max()
    torques = []
    signals = [periods.split_periods(each, motion.cut) for each in (velocity, motion.torque)]
    for v, torque in zip(*signals, strict=True):
        directions = [torque[v > fast], torque[v < -fast]]
        if all(len(direction) for direction in directions):
            torques.append(0.5 * (directions[0].mean() - directions[1].mean()))
    method = f"{len(torques)} periods, by their scatter"
    return mean(torques, "N*m", method).with_cell_error()


def brake_points(points: list[Motion], currents: list[float]) -> list[BrakePoint]:
    """Return the points in the order of time; the first one counts as reached from below."""
    points_with_torque = []
    previous = -np.inf
    rising = True
    for point, current in zip(points, currents, strict=True):
        if abs(current - previous) > 1e-3:
            rising = current > previous
        points_with_torque.append(BrakePoint(current, brake_torque(point), rising))
        previous = current
    return points_with_torque


def brake_map(points: list[BrakePoint]) -> BrakeMap:
    """Return the branches of the points; points of a branch with equal current are averaged.

    The largest current is part of both branches: the falling one starts there.
    """
    if len(points) < 2:
        raise ValueError(f"{len(points)} set points; a brake map needs at least 2")
    rising_points = [each for each in points if each.rising]
    falling_points = [each for each in points if not each.rising]
    if falling_points:
        max_current = max(each.current for each in falling_points)
        falling_points += [each for each in rising_points if each.current > max_current + 1e-3][-1:]
    rising, falling = _branch(rising_points), _branch(falling_points)
    return BrakeMap(rising, falling, _hysteresis(rising, falling))


def _branch(points: list[BrakePoint]) -> Branch:
    rows: list[tuple[float, float, float]] = []
    for each in sorted(points, key=lambda point: point.current):
        row = (each.current, each.torque.value, each.torque.uncertainty)
        if rows and row[0] - rows[-1][0] < 1e-3:
            last = rows.pop()
            row = tuple(0.5 * (a + b) for a, b in zip(last, row, strict=True))  # type: ignore[assignment]
        rows.append(row)
    columns = np.array(rows, np.float64).reshape(-1, 3).T
    return Branch(*columns)


def _hysteresis(rising: Branch, falling: Branch) -> Estimate:
    method = "falling less rising branch, by scatter between currents"
    if len(falling.current) < 2 or len(rising.current) < 2:
        return mean([], "N*m", method)
    low = max(rising.current[0], falling.current[0])
    high = min(rising.current[-1], falling.current[-1])
    currents = falling.current[(falling.current > low + 1e-3) & (falling.current < high - 1e-3)]
    width = np.interp(currents, falling.current, falling.torque) - np.interp(
        currents, rising.current, rising.torque
    )
    return mean(width, "N*m", method)


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run of the session."""
    setpoints = session.complete_points
    points = brake_points(
        [each.motion() for each in setpoints],
        [float(np.median(each.brake_current)) for each in setpoints],
    )
    measured_map = brake_map(points)
    idle = min(points, key=lambda each: each.current).torque
    max_torque = max(each.torque.value for each in points)
    rows = zip([each.row for each in setpoints], points, strict=True)
    low, high = THESIS_RANGE
    return Result(
        (table("brake_points", "Brake: torque by set point", rows, COLUMNS),),
        (
            compare("residual torque", idle, f"{low:g} N·m"),
            compare("largest torque", f"{format_number(max_torque)} N·m", f"{high:g} N·m"),
            compare("falling less rising branch", measured_map.hysteresis),
        ),
        {"brake_residual": idle, "brake_hysteresis": measured_map.hysteresis},
        (draw_map(measured_map),),
        (
            "Torque is the load cell's, so the bearing's (below 0.4 N·m) is in it. The branch "
            "of a point follows from the current of the previous set point.",
        ),
        _calibration_maps(measured_map),
    )


COLUMNS: Columns[tuple[int, BrakePoint]] = {
    "row": lambda r: r[0],
    "current [A]": lambda r: r[1].current,
    "branch": lambda r: "rising" if r[1].rising else "falling",
    "torque [N*m]": lambda r: r[1].torque,
}


def _calibration_maps(measured_map: BrakeMap) -> dict[str, Any]:
    branches = {}
    for name, branch in (("rising", measured_map.rising), ("falling", measured_map.falling)):
        strictly_rising = np.append(True, np.diff(np.maximum.accumulate(branch.torque)) > 1e-6)
        if strictly_rising.sum() < 2:
            return {}
        branches[name] = {
            "current_a": branch.current[strictly_rising].tolist(),
            "torque_n_m": branch.torque[strictly_rising].tolist(),
            "uncertainty_n_m": branch.uncertainty[strictly_rising].tolist(),
        }
    return {"brake_map": branches}


@figures.figure(
    "The brake's torque over current",
    "Points with 95 % intervals.",
    axes=("brake current, A", "torque, N·m"),
    size=(7.2, 4.8),
    name="brake_map",
)
def draw_map(axes: Axes, measured_map: BrakeMap) -> None:
    for name, branch, colour, mark in (
        ("rising", measured_map.rising, figures.BLUE, "o-"),
        ("falling", measured_map.falling, figures.RED, "s--"),
    ):
        if len(branch.current):
            half_widths = np.nan_to_num(branch.uncertainty)
            style: dict[str, Any] = {"fmt": mark, "ms": 4, "lw": 1.2, "capsize": 2.5}
            axes.errorbar(
                branch.current, branch.torque, half_widths, color=colour, label=name, **style
            )
    axes.set_ylim(0.0, None)
    figures.legend(axes, "upper left")
    figures.annotate_corner(axes, f"falling less rising {measured_map.hysteresis}", "lower right")
