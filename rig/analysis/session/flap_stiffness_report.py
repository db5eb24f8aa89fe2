"""The hydrostatic session of the flap: moment over angle, turned slowly."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure
from scipy.ndimage import uniform_filter1d

from rig.analysis.session import flap_stiffness, losses, periods
from rig.analysis.session.drawing import RED, axes_of, note, shade
from rig.analysis.session.estimate import Floats
from rig.analysis.session.flap_stiffness import Spring, Turned
from rig.analysis.session.periods import Cut
from rig.analysis.session.points import Point, Session
from rig.analysis.session.result import Column, Compared, Picture, Result, Table, words

WINDOW = 0.03
"""Of the period: over so long signals are averaged, so that the flap's ringing on its coupling
(some 7 Hz, from the gap at each reversal of the load) is not taken for motion."""

SLOWEST = 0.25
"""Share of the top speed: below, ringing makes friction change its sign."""


class Slow(NamedTuple):
    """A set point, cut to its whole periods."""

    point: Point
    of: Cut
    angle: Floats  # rad
    torque: Floats  # N*m
    groups: list[Turned]  # its periods, while it turns

    @property
    def whole(self) -> Turned:
        """All periods as one group."""
        return Turned(*(np.concatenate(each) for each in zip(*self.groups, strict=True)))


def result(session: Session) -> Result:
    """Analyse a run."""
    points = [_slow(point) for point in session.whole]
    groups = [group for each in points for group in each.groups]
    found = flap_stiffness.spring(groups, "periods")
    named = {
        "flap_stiffness": found.stiffness,
        "flap_rest": found.rest,
        "flap_dry_friction_behind": found.dry,
        "flap_viscous_slow": found.viscous,
        "flap_inertia_slow": found.inertia,
    }
    return Result(
        (_table(points, found),),
        _compared(found),
        named,
        (
            Picture("flap_moment", "Moment over angle, turned slowly",
                    "Averaged, faint as measured; darker: later. Red: the spring.", (7.2, 4.8),
                    partial(_draw, points, found)),
            Picture("flap_moment_rest", "What the spring does not explain",
                    "Cell less spring and inertia: friction behind the cell changes its sign with "
                    "the motion.",
                    (7.2, 4.4), partial(_draw_rest, points, found)),
        ),
        (
            "The load cell sees what is behind it: the flap, and the bearing and seal on its far "
            "side, not those before the cell. Angles are the shaft encoder's.",
        ),
    )  # fmt: skip


def _window(point: Point) -> int:
    """Samples over which signals are averaged."""
    return 2 * round(0.5 * WINDOW * point.period / point.dt) + 1


def _slow(point: Point) -> Slow:
    of = point.cut()
    count = _window(point)
    angle, torque = (
        uniform_filter1d(each, count, mode="nearest") for each in (point.shaft, point.torque)
    )
    speed = np.gradient(angle, point.dt)
    rate = np.gradient(uniform_filter1d(speed, count, mode="nearest"), point.dt)
    time = point.start + point.dt * np.arange(len(angle))
    good = losses.moving(speed, count, SLOWEST).astype(np.float64)
    parts = [
        periods.pieces(point.over(np.asarray(each, np.float64), of), of)
        for each in (angle, speed, rate, torque, time, good)
    ]
    groups = [
        Turned(*(each[turns > 0.5] for each in piece)) for *piece, turns in zip(*parts, strict=True)
    ]
    shaft, cell = (point.over(each, of) for each in (point.shaft, point.torque))
    return Slow(point, of, shaft, cell, [each for each in groups if len(each.angle) > 100])


def _table(points: list[Slow], found: Spring) -> Table:
    return Table(
        "flap_slow",
        "Slow motion by set point",
        (
            Column("row", "", tuple(each.point.row for each in points)),
            Column("amplitude asked", "deg",
                   tuple(each.point.number("amplitude_deg") for each in points)),
            Column("period", "s", tuple(each.point.period for each in points)),
            Column("amplitude", "deg",
                   tuple(float(np.degrees(0.5 * np.ptp(each.angle))) for each in points)),
            Column("slope of moment over angle", "N*m/rad", tuple(_slope(e.whole) for e in points)),
            Column("spring less inertia", "N*m/rad", tuple(
                found.stiffness.value - found.inertia.value * each.of.omega**2 for each in points)),
        ),
    )  # fmt: skip


def _slope(of: Turned) -> float:
    """Moment over angle, friction taken as told by the sign of the motion."""
    design = np.stack([of.angle, np.ones(len(of.angle)), np.sign(of.velocity)], axis=1)
    return float(np.linalg.lstsq(design, of.torque)[0][0])


def _compared(found: Spring) -> tuple[Compared, ...]:
    return (
        Compared("buoyant spring", "not run", "", words(found.stiffness), None),
        Compared("angle of rest", "", "", words(found.rest, "deg", 180.0 / np.pi), None),
        Compared("dry friction behind the cell", "", "", words(found.dry), None),
        Compared("viscous, slow motion", "", "", words(found.viscous), None),
        Compared("inertia with added inertia, slow motion", "", "", words(found.inertia), None),
    )


def _draw(points: list[Slow], found: Spring, body: SubFigure) -> None:
    axes = axes_of(body, "angle of the shaft, deg", "moment at the load cell, N·m")
    for i, each in enumerate(points):
        last = slice(each.of.edges[-2] - each.of.edges[0], None, 20)
        label = f"{each.point.number('amplitude_deg'):g} deg, {each.point.period:g} s"
        colour = shade(i + 1, len(points) + 1)
        axes.plot(np.degrees(each.angle[last]), each.torque[last], lw=0.4, alpha=0.2, color=colour)
        smooth = [uniform_filter1d(s, _window(each.point)) for s in (each.angle, each.torque)]
        axes.plot(np.degrees(smooth[0][last]), smooth[1][last], lw=1.0, label=label, color=colour)
    top = max(float(np.abs(each.angle).max()) for each in points)
    x = np.array([-top, top])
    line = found.stiffness.value * (x - found.rest.value)
    axes.plot(np.degrees(x), line, "--", color=RED, lw=1.2)
    note(axes, words(found.stiffness), "lower right")
    axes.legend(frameon=False, fontsize=8, loc="upper left")


def _draw_rest(points: list[Slow], found: Spring, body: SubFigure) -> None:
    axes = axes_of(body, "angle of the shaft, deg", "moment less spring and inertia, N·m")
    for i, each in enumerate(points):
        w = each.whole
        explained = found.stiffness.value * (w.angle - found.rest.value)
        explained = explained + found.inertia.value * w.acceleration + found.drift.value * w.time
        pick = slice(None, None, max(1, len(w.angle) // 1500))
        axes.plot(np.degrees(w.angle[pick]), (w.torque - explained)[pick], ".", ms=1.5, alpha=0.5,
                  color=shade(i + 1, len(points) + 1))  # fmt: skip
    for sign in (1.0, -1.0):
        axes.axhline(sign * found.dry.value, color=RED, lw=1.0, ls="--")
    note(axes, f"dry friction {words(found.dry)}", "upper right")
