"""The torque constant session: Table 3.1 and Figures 3.1 to 3.3 of the OSWEC thesis."""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.patches import Rectangle

from rig.analysis.session import thesis, torque_constant
from rig.analysis.session.drawing import BLUE, CLOCKWISE, COUNTER, RED, axes_of, note, shade
from rig.analysis.session.estimate import Floats, mean
from rig.analysis.session.linear_fit import at
from rig.analysis.session.periods import Cut
from rig.analysis.session.points import Point, Session
from rig.analysis.session.quarters import Domain
from rig.analysis.session.result import Column, Compared, Picture, Result, Table, number, words
from rig.analysis.session.torque_constant import Constants, Ramps

WAYS = ((1, "clockwise", CLOCKWISE), (-1, "counter-clockwise", COUNTER))


class Locked(NamedTuple):
    """A set point of the locked shaft."""

    point: Point
    of: Cut
    current: Floats  # A, commanded
    torque: Floats  # N*m
    ramps: Ramps


def result(session: Session) -> Result:
    """Analyse a run."""
    points = [_locked(point) for point in session.whole]
    points = sorted((p for p in points if p.ramps.up), key=lambda each: each.ramps.rms_torque)
    if not points:
        raise ValueError("no set point has a ramp of torque")
    found = torque_constant.constants([each.ramps for each in points])
    named = {
        "torque_constant": found.both,
        "torque_constant_positive": found.positive,
        "torque_constant_negative": found.negative,
        "torque_constant_motor": found.motor,
        "torque_hysteresis": mean(
            [each.ramps.hysteresis for each in points],
            "N*m",
            "torque at half the current, falling less growing; by scatter of set points",
        ),
    }
    return Result(
        (_table(points, session.torque_constant),),
        _compared(found, named["torque_hysteresis"].value),
        named,
        _pictures(points),
        (
            "Clockwise is positive torque. The torque constant is the thesis's, of ramps: gearbox "
            "friction is in it. torque_constant_motor has it taken out, by the hysteresis.",
        ),
    )


def _locked(point: Point) -> Locked:
    of = point.cut()
    current = point.over(point.current_command, of)
    torque = point.over(point.torque, of)
    return Locked(point, of, current, torque, torque_constant.ramps(current, torque, of))


def _table(points: Sequence[Locked], in_use: float) -> Table:
    currents = [each.ramps.current_amplitude for each in points]
    columns = [
        Column("row", "", tuple(each.point.row for each in points)),
        Column("current amplitude", "A", tuple(currents)),
        Column(
            "torque, nominal (eq. 3.1)", "N*m", tuple(11.54 / 11.173 * 15.0 * i for i in currents)
        ),
        Column(
            "torque, thesis nominal",
            "N*m",
            tuple(thesis.beside(i, thesis.CURRENTS, thesis.TORQUES) for i in currents),
        ),
        Column("torque by constant in use", "N*m", tuple(in_use * i for i in currents)),
        Column("rms torque", "N*m", tuple(each.ramps.rms_torque for each in points)),
    ]
    for sign, way, _ in WAYS:
        slopes = [each.ramps.slopes(sign) for each in points]
        fits = [[d.fitted.r_squared for d in p.ramps.up if d.quarter.sign == sign] for p in points]
        for name, of in (("mean", np.mean), ("min", np.min), ("max", np.max)):
            values = tuple(float(of(s)) if len(s) else float("nan") for s in slopes)
            columns.append(Column(f"{way} {name}", "N*m/A", values))
        columns.append(Column(f"{way} R² min", "", tuple(min(f, default=np.nan) for f in fits)))
    columns.append(Column("hysteresis", "N*m", tuple(p.ramps.hysteresis for p in points)))
    title = "Table 3.1: torque constants of ramps by set point"
    return Table("torque_constants", title, tuple(columns))


def _compared(found: Constants, hysteresis: float) -> tuple[Compared, ...]:
    off = found.both.value / thesis.TORQUE_CONSTANT - 1.0
    low, high = thesis.TORQUE_CONSTANTS
    spread = (found.most - found.least) / found.both.value
    theirs = (high - low) / thesis.TORQUE_CONSTANT
    ways = thesis.TORQUE_SPREADS
    return (
        Compared("torque constant, mean of ramps", f"{thesis.TORQUE_CONSTANT} N·m/A",
                 "within 2 %", f"{words(found.both)} ({100.0 * off:+z.1f} %)", abs(off) <= 0.02),
        Compared("single ramps", f"{low} to {high} N·m/A", "spread of the same order",
                 f"{found.least:.2f} to {found.most:.2f} N·m/A", 0.5 <= spread / theirs <= 2.0),
        Compared("clockwise", "trends higher", "", words(found.positive), None),
        Compared("counter-clockwise", "", "", words(found.negative), None),
        Compared("spread, clockwise and counter-clockwise",
                 f"{100 * ways[0]:.0f} and {100 * ways[1]:.0f} %", "",
                 f"{100 * found.spread_positive:.0f} and "
                 f"{100 * found.spread_negative:.0f} %", None),
        Compared("motor's own constant, friction out", f"specified {thesis.TORQUE_SPECIFIED} N·m/A",
                 "", words(found.motor), None),
        Compared("torque on back-off less torque on ramp, at half current", "hysteresis",
                 "visible", f"{number(hysteresis, 3)} N·m", hysteresis > 0.5),
    )  # fmt: skip


def _pictures(points: Sequence[Locked]) -> tuple[Picture, ...]:
    middle = points[len(points) // 2]
    told = f"Current amplitude {middle.ramps.current_amplitude:.2f} A"
    return (
        Picture("fig_3_1", "Fig. 3.1: commanded and measured torque over time",
                f"{told}; boxes: domains of the fits, black clockwise, grey counter-clockwise.",
                (7.6, 4.4), partial(_over_time, middle)),
        Picture("fig_3_2", "Fig. 3.2: fits of the largest set point",
                "One domain each way, every fifth sample.", (7.2, 5.8), partial(_fits, points[-1])),
        Picture("fig_3_3", "Fig. 3.3: torque constants over torque",
                "Mean, least and largest of the ramps of each set point.", (7.2, 5.8),
                partial(_constants, points)),
        Picture("hysteresis", "Torque over current: ramp and back-off",
                "All set points; darker: larger amplitude.", (7.2, 5.0),
                partial(_hysteresis, points)),
    )  # fmt: skip


def boxes(axes: Axes, domains: Sequence[Domain], dt: float, values: Floats) -> None:
    """Rectangles around the domains of fits."""
    for each in domains:
        low, high = values[each.where].min(), values[each.where].max()
        room = 0.03 * np.ptp(values)
        x, wide = dt * each.where.start, dt * (each.where.stop - each.where.start)
        colour = CLOCKWISE if each.quarter.sign > 0 else COUNTER
        style: dict[str, Any] = {"fill": False, "ec": colour, "lw": 1.6, "zorder": 4}
        axes.add_patch(Rectangle((x, low - room), wide, high - low + 2.0 * room, **style))


def _over_time(one: Locked, body: SubFigure) -> None:
    axes = axes_of(body, "time, s", "torque, N·m")
    slope = np.mean([d.fitted.slope for d in one.ramps.up])
    t = one.of.dt * np.arange(len(one.torque))
    axes.plot(t, slope * one.current, "--", color=RED, lw=1.1, label="command × mean constant")
    axes.plot(t, one.torque, color=BLUE, lw=1.1, label="measured")
    boxes(axes, one.ramps.up, one.of.dt, one.torque)
    axes.margins(x=0.0)
    axes.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)


def _fits(one: Locked, body: SubFigure) -> None:
    panels: Any = body.subplots(2, 1)
    for (sign, way, colour), place in zip(WAYS, panels, strict=True):
        axes = axes_of(body, "current command, A", "torque, N·m", place)
        mine = [d for d in one.ramps.up if d.quarter.sign == sign]
        if not mine:
            continue
        x = one.current[mine[0].where]
        axes.plot(x[::5], one.torque[mine[0].where][::5], ".", ms=2.5, color=BLUE, alpha=0.5)
        axes.plot(x, at(mine[0].fitted, x), color=colour, lw=1.6)
        said = f"{way}\n{mine[0].fitted.slope:.2f} N·m/A, R² {mine[0].fitted.r_squared:.4f}"
        note(axes, said, "upper left" if sign > 0 else "lower right")


def _constants(points: Sequence[Locked], body: SubFigure) -> None:
    upper, lower = body.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
    upper = axes_of(body, "", "torque constant, N·m/A", upper)
    lower = axes_of(body, "rms torque, N·m", "R²", lower)
    for sign, way, colour in WAYS:
        fits = [[d.fitted for d in p.ramps.up if d.quarter.sign == sign] for p in points]
        places = [p.ramps.rms_torque for p in points]
        bars(upper, places, [[f.slope for f in each] for each in fits], colour, way, 0.15 * sign)
        bars(lower, places, [[f.r_squared for f in e] for e in fits], colour, way, 0.15 * sign)
    upper.axhline(thesis.TORQUE_CONSTANT, color=RED, lw=0.9, ls="--")
    upper.axhspan(*thesis.TORQUE_CONSTANTS, color=RED, alpha=0.07, lw=0)
    note(upper, "red: thesis, mean and range", "lower right")
    upper.legend(frameon=False, fontsize=8, loc="upper right")


def bars(
    axes: Axes, x: Sequence[float], sets: Sequence[Any], colour: str, label: str, aside: float
) -> None:
    """Mean with bars to the least and largest of each set."""
    first: str | None = label
    for place, values in zip(x, sets, strict=True):
        if len(values):
            mid = float(np.mean(values))
            reach = [[mid - min(values)], [max(values) - mid]]
            axes.errorbar(
                place + aside, mid, reach, fmt="o", ms=4, color=colour, capsize=3, label=first
            )
            first = None


def _hysteresis(points: Sequence[Locked], body: SubFigure) -> None:
    axes = axes_of(body, "current command, A", "torque, N·m")
    for i, each in enumerate(points):
        last = slice(each.of.edges[-2] - each.of.edges[0], None)
        axes.plot(
            each.current[last], each.torque[last], color=shade(i + 1, len(points) + 1), lw=0.9
        )
