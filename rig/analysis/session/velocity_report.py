"""The velocity constant session: Table 3.2, Figures 2.6 and 3.5 to 3.8 of the OSWEC thesis."""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import SubFigure
from scipy.ndimage import uniform_filter1d

from rig.analysis.session import periods, thesis, velocity_constant
from rig.analysis.session.deflection import Behind, Motion, behind
from rig.analysis.session.drawing import BLUE, CLOCKWISE, COUNTER, RED, axes_of, note, shade
from rig.analysis.session.driveline import DEGREE
from rig.analysis.session.estimate import Estimate, mean
from rig.analysis.session.linear_fit import at
from rig.analysis.session.periods import Cut
from rig.analysis.session.points import Point, Session
from rig.analysis.session.result import Column, Compared, Picture, Result, Table, words
from rig.analysis.session.torque_report import WAYS, bars, boxes
from rig.analysis.session.velocity_constant import Constants, Slowing

NOMINAL = 37.5 * 2.0 * np.pi / 10.0 / 15.0  # rad/s/V, equation 3.2


class Free(NamedTuple):
    """A set point of the freely turning shaft."""

    point: Point
    of: Cut
    slowing: Slowing
    motion: Motion
    behind: Behind


def result(session: Session) -> Result:
    """Analyse a run."""
    points = [_free(point) for point in session.whole]
    points = sorted((p for p in points if p.slowing.down), key=lambda p: p.slowing.rms_velocity)
    if not points:
        raise ValueError("no set point has a deceleration")
    found = velocity_constant.constants([each.slowing for each in points])
    loss = mean(
        [each.behind.amplitude_difference.mean() / DEGREE for each in points],
        "deg",
        "half strokes of motor less shaft, unloaded; by scatter of set points",
    )
    named = {
        "velocity_constant": found.constant,
        "velocity_constant_deceleration": found.thesis,
        "velocity_constant_fastest": found.fastest,
        "velocity_lag": found.lag,
        "velocity_droop": found.droop,
        "amplitude_difference_unloaded": loss,
    }
    return Result(
        (_table(points),),
        _compared(found, loss, points),
        named,
        _pictures(points, found.constant.value),
        (
            "velocity_constant is that of the motor going as told, behind the wait at the begin of "
            "each deceleration, lag and droop of the drive apart; the thesis's lines take them in. "
            "velocity_droop is that without any load; the bearing's takes some of it away.",
        ),
    )


def _free(point: Point) -> Free:
    of = point.aligned(point.volts)
    motion = point.motion()
    slow = velocity_constant.slowing(point.motor, point.volts, point.torque, of)
    return Free(point, of, slow, motion, behind(motion))


def _table(points: Sequence[Free]) -> Table:
    volts = [each.slowing.volts_amplitude for each in points]
    columns = [
        Column("row", "", tuple(each.point.row for each in points)),
        Column("voltage amplitude", "V", tuple(volts)),
        Column("velocity, nominal (eq. 3.2)", "rad/s", tuple(NOMINAL * v for v in volts)),
        Column("velocity, thesis nominal", "rad/s",
               tuple(thesis.beside(v, thesis.VOLTS, thesis.SPEEDS) for v in volts)),
        Column("rms velocity", "rad/s", tuple(each.slowing.rms_velocity for each in points)),
    ]  # fmt: skip
    for sign, way, _ in WAYS:
        slopes = [each.slowing.slopes(sign) for each in points]
        fits = [
            [d.fitted.r_squared for d in p.slowing.down if d.quarter.sign == sign] for p in points
        ]
        for name, of in (("mean", np.mean), ("min", np.min), ("max", np.max)):
            values = tuple(float(of(s)) if len(s) else float("nan") for s in slopes)
            columns.append(Column(f"{way} {name}", "rad/s/V", values))
        columns.append(Column(f"{way} R² min", "", tuple(min(f, default=np.nan) for f in fits)))
    columns += [
        Column("amplitude difference", "deg",
               tuple(float(p.behind.amplitude_difference.mean()) / DEGREE for p in points)),
    ]  # fmt: skip
    title = "Table 3.2: velocity constants of decelerations by set point"
    return Table("velocity_constants", title, tuple(columns))


def _compared(found: Constants, loss: Estimate, points: Sequence[Free]) -> tuple[Compared, ...]:
    off = found.thesis.value / thesis.VELOCITY_CONSTANT - 1.0
    top = found.fastest.value / thesis.VELOCITY_FASTEST - 1.0
    low, high = thesis.VELOCITY_CONSTANTS
    mid, half = thesis.UNLOADED_DIFFERENCE
    slowest = float(np.mean([d.fitted.slope for d in points[0].slowing.down]))
    torque = max(float(np.abs(p.motion.torque).max()) for p in points)
    return (
        Compared("velocity constant, mean", f"{thesis.VELOCITY_CONSTANT} rad/s/V", "within 2 %",
                 f"{words(found.thesis)} ({100 * off:+z.1f} %)", abs(off) <= 0.02),
        Compared("mean of the three fastest", f"{thesis.VELOCITY_FASTEST} rad/s/V", "within 2 %",
                 f"{words(found.fastest)} ({100 * top:+z.1f} %)", abs(top) <= 0.02),
        Compared("spread of the three fastest", f"{100 * thesis.VELOCITY_SPREAD:.1f} %", "",
                 f"{100 * found.spread:.1f} %", None),
        Compared("single lines", f"{low} to {high} rad/s/V", "",
                 f"{found.least:.2f} to {found.most:.2f} rad/s/V", None),
        Compared("slowest set point", "lower", "low-amplitude bias visible",
                 f"{slowest:.3f} rad/s/V", slowest < 0.99 * found.fastest.value),
        Compared("motor going as told", "trends towards 1.5 rad/s/V", "",
                 words(found.constant), None),
        Compared("amplitude difference, unloaded", f"{mid} ± {half} deg", "inside", words(loss),
                 abs(loss.value - mid) <= half),
        Compared("largest torque of the bearing", "under 0.4 N·m", "", f"{torque:.2f} N·m", None),
    )  # fmt: skip


def _pictures(points: Sequence[Free], constant: float) -> tuple[Picture, ...]:
    said = "boxes: domains of the fits, black clockwise, grey counter-clockwise."
    return (
        Picture("fig_2_6", "Fig. 2.6: amplitude difference, unloaded",
                "Mean of the periods with 5th and 95th percentile; red: thesis 0.025 ± 0.015°.",
                (7.2, 4.2), partial(_unloaded, points)),
        Picture("fig_3_5", "Fig. 3.5: commanded and measured velocity",
                f"Slowest set point above, fastest below; {said}", (7.6, 5.8),
                partial(_over_time, (points[0], points[-1]), constant)),
        Picture("fig_3_6", "Fig. 3.6: fits of the fastest set point", "One deceleration each way.",
                (7.2, 5.8), partial(_fits, points[-1])),
        Picture("fig_3_7", "Fig. 3.7: velocity constants over velocity",
                "Mean, least and largest of the decelerations of each set point.", (7.2, 5.8),
                partial(_constants, points, constant)),
        Picture("fig_3_8", "Fig. 3.8: torque of the bearing over the phase",
                "Means over periods and 15 ms; darker: faster.", (7.2, 4.4),
                partial(_torque, points)),
    )  # fmt: skip


def _unloaded(points: Sequence[Free], body: SubFigure) -> None:
    axes = axes_of(body, "rms motor velocity, rad/s", "amplitude difference, deg")
    mid, half = thesis.UNLOADED_DIFFERENCE
    axes.axhspan(mid - half, mid + half, color=RED, alpha=0.1, lw=0)
    axes.axhline(mid, color=RED, lw=0.9, ls="--")
    for each in points:
        values = each.behind.amplitude_difference / DEGREE
        low, high = np.percentile(values, [5, 95])
        reach = [[values.mean() - low], [high - values.mean()]]
        place = (each.behind.rms_velocity, values.mean())
        axes.errorbar(*place, reach, fmt="o", ms=5, color=BLUE, capsize=3)
    axes.set_ylim(0.0, None)


def _over_time(pair: tuple[Free, Free], constant: float, body: SubFigure) -> None:
    panels: Any = body.subplots(2, 1, sharex=True)
    for each, place in zip(pair, panels, strict=True):
        axes = axes_of(body, "time, s" if place is panels[-1] else "", "velocity, rad/s", place)
        count = min(len(each.slowing.velocity), round(2.0 * each.of.period / each.of.dt))
        t = each.of.dt * np.arange(count)
        wanted = constant * each.slowing.volts[:count]
        axes.plot(t, wanted, "--", color=RED, lw=1.1, label="command × constant")
        axes.plot(t, each.slowing.velocity[:count], color=BLUE, lw=1.2, label="measured")
        shown = [d for d in each.slowing.down if d.where.stop <= count]
        boxes(axes, shown, each.of.dt, each.slowing.velocity)
        axes.margins(x=0.0)
    panels[0].legend(
        frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2
    )


def _fits(one: Free, body: SubFigure) -> None:
    panels: Any = body.subplots(2, 1)
    for (sign, way, colour), place in zip(WAYS, panels, strict=True):
        axes = axes_of(body, "voltage command, V", "velocity, rad/s", place)
        mine = [d for d in one.slowing.down if d.quarter.sign == sign]
        if not mine:
            continue
        x = one.slowing.volts[mine[0].where]
        axes.plot(x, one.slowing.velocity[mine[0].where], ".", ms=3, color=BLUE, alpha=0.5)
        axes.plot(x, at(mine[0].fitted, x), color=colour, lw=1.4)
        said = f"{way}\n{mine[0].fitted.slope:.3f} rad/s/V, R² {mine[0].fitted.r_squared:.5f}"
        note(axes, said, "upper left" if sign > 0 else "lower right")


def _constants(points: Sequence[Free], constant: float, body: SubFigure) -> None:
    upper, lower = body.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
    upper = axes_of(body, "", "velocity constant, rad/s/V", upper)
    lower = axes_of(body, "rms motor velocity, rad/s", "R²", lower)
    for sign, way, colour in WAYS:
        fits = [[d.fitted for d in p.slowing.down if d.quarter.sign == sign] for p in points]
        places = [p.slowing.rms_velocity for p in points]
        bars(upper, places, [[f.slope for f in each] for each in fits], colour, way, 0.004 * sign)
        bars(lower, places, [[f.r_squared for f in e] for e in fits], colour, way, 0.004 * sign)
    upper.axhline(constant, color=BLUE, lw=0.9, label="going as told")
    upper.axhline(
        thesis.VELOCITY_FASTEST, color=RED, lw=0.9, ls="--", label="thesis, three fastest"
    )
    upper.legend(frameon=False, fontsize=8, loc="lower right")


def _torque(points: Sequence[Free], body: SubFigure) -> None:
    axes = axes_of(body, "phase of the oscillation, share of a period", "torque, N·m")
    for i, each in enumerate(points):
        torque = periods.mean_period(each.motion.torque, each.motion.of)
        share = np.arange(len(torque)) / len(torque)
        smooth = uniform_filter1d(torque, 15, mode="wrap")
        axes.plot(share, smooth, color=shade(i + 1, len(points) + 1), lw=1.0)
    axes.axhline(0.0, color=COUNTER, lw=0.6)
    axes.axhline(0.4, color=CLOCKWISE, lw=0.6, ls=":")
    axes.axhline(-0.4, color=CLOCKWISE, lw=0.6, ls=":")
    axes.margins(x=0.0)
