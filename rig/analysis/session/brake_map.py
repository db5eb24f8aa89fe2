"""The brake's torque over current: a rising and a falling branch, each point with its interval."""

from typing import NamedTuple

import numpy as np

from rig.analysis.session import periods
from rig.analysis.session.deflection import WINDOW, Motion
from rig.analysis.session.estimate import CELL, Estimate, Floats, mean, with_floor


class Held(NamedTuple):
    """One set point: a current, and the torque that the brake held the moving shaft with."""

    current: float  # A, measured
    torque: Estimate  # N*m, both directions in one
    rising: bool  # reached from a smaller current


class Branch(NamedTuple):
    """Torque over current, rising strictly."""

    current: Floats  # A
    torque: Floats  # N*m
    uncertainty: Floats  # N*m


class BrakeMap(NamedTuple):
    """Both branches; a falling one that was not measured is empty."""

    rising: Branch
    falling: Branch
    hysteresis: Estimate  # N*m, falling less rising at one current, mean


def torque_of(of: Motion) -> Estimate:
    """The torque against which the shaft turns at speed, half the difference of both directions.

    Where the shaft has at least half of its largest speed: there the magnetisation has settled and
    no gap is crossed. The interval is by scatter of the periods.
    """
    speed = periods.velocity(of.shaft, of.of.dt, WINDOW)
    fast = 0.5 * np.abs(speed).max()
    found = []
    cuts = [periods.pieces(each, of.of) for each in (speed, of.torque)]
    for v, torque in zip(*cuts, strict=True):
        ways = [torque[v > fast], torque[v < -fast]]
        if all(len(way) for way in ways):
            found.append(0.5 * (ways[0].mean() - ways[1].mean()))
    return with_floor(mean(found, "N*m", f"{len(found)} periods, by their scatter"), CELL)


def held(points: list[Motion], currents: list[float]) -> list[Held]:
    """The points in the order of time; the first counts as reached from below."""
    out = []
    before = -np.inf
    way = True
    for point, current in zip(points, currents, strict=True):
        if abs(current - before) > 1e-3:
            way = current > before
        out.append(Held(current, torque_of(point), way))
        before = current
    return out


def brake_map(points: list[Held]) -> BrakeMap:
    """Branches of the points: equal currents of one branch are averaged.

    The largest current stands on both branches: from there the falling one sets out.
    """
    if len(points) < 2:
        raise ValueError(f"{len(points)} set points; a brake map needs at least 2")
    up = [each for each in points if each.rising]
    down = [each for each in points if not each.rising]
    if down:
        top = max(each.current for each in down)
        down += [each for each in up if each.current > top + 1e-3][-1:]
    rising, falling = _branch(up), _branch(down)
    return BrakeMap(rising, falling, _hysteresis(rising, falling))


def _branch(points: list[Held]) -> Branch:
    rows: list[tuple[float, float, float]] = []
    for each in sorted(points, key=lambda point: point.current):
        here = (each.current, each.torque.value, each.torque.uncertainty)
        if rows and here[0] - rows[-1][0] < 1e-3:
            last = rows.pop()
            here = tuple(0.5 * (a + b) for a, b in zip(last, here, strict=True))  # type: ignore[assignment]
        rows.append(here)
    columns = np.array(rows, np.float64).reshape(-1, 3).T
    return Branch(*columns)


def _hysteresis(rising: Branch, falling: Branch) -> Estimate:
    how = "falling less rising branch, by scatter between currents"
    if len(falling.current) < 2 or len(rising.current) < 2:
        return Estimate(float("nan"), float("nan"), "N*m", how)
    low = max(rising.current[0], falling.current[0])
    high = min(rising.current[-1], falling.current[-1])
    at = falling.current[(falling.current > low + 1e-3) & (falling.current < high - 1e-3)]
    width = np.interp(at, falling.current, falling.torque) - np.interp(
        at, rising.current, rising.torque
    )
    return mean(width, "N*m", how)
