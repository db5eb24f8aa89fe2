"""The losses session: bearing and seal behind the load cell, motor and gearbox before it."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.analysis.session import losses, periods
from rig.analysis.session.drawing import BLUE, RED, axes_of, note, shade
from rig.analysis.session.estimate import Estimate, Floats
from rig.analysis.session.losses import Before, Behind, Turned
from rig.analysis.session.periods import Cut
from rig.analysis.session.points import Point, Session
from rig.analysis.session.result import Column, Compared, Picture, Result, Table, words

WINDOW = 0.03  # s, of the differentiator
_UNBRAKED = 1.0  # N*m: a larger torque is a brake's, not a bearing's


class Rubbed(NamedTuple):
    """A set point with its samples at speed, by period."""

    point: Point
    of: Cut
    groups: list[Turned]

    @property
    def whole(self) -> Turned:
        """All periods in one."""
        return Turned(*(np.concatenate(column) for column in zip(*self.groups, strict=True)))

    @property
    def free(self) -> bool:
        """Whether nothing but bearing and seal holds the shaft."""
        return float(np.median(np.abs(self.whole.torque))) < _UNBRAKED or not self.asked

    @property
    def asked(self) -> bool:
        """Whether the brake was asked for anything."""
        point = self.point
        return point.number("brake_current_a", 0.0) + point.number("damping_n_m_s_per_rad", 0.0) > 0


def result(session: Session, constant: Estimate | None = None) -> Result:
    """Analyse a run; ``constant`` is the motor's own (N*m/A), as a torque constant session has it.

    Without one the constant in use in the run is taken, and its error is not in the intervals.
    """
    points = [each for p in session.whole if (each := _rubbed(p)).groups]
    if not points:
        raise ValueError("no set point turned")
    known = constant or Estimate(session.torque_constant, 0.0, "N*m/A", "in use in the run")
    free = [each for each in points if each.free]
    behind = losses.behind(*_groups(free)) if free else None
    if behind is not None:
        zero = _zero_error(free)
        behind = behind._replace(
            positive=_widened(behind.positive, zero), negative=_widened(behind.negative, zero)
        )
    before = losses.before(*_with_constant(points, known))
    named: dict[str, Estimate] = {}
    if behind is not None:
        named |= {
            f"bearing_{name}": each for name, each in behind._asdict().items() if name != "bend"
        }
    named |= {
        f"gearbox_{name}": each
        for name, each in before._asdict().items()
        if np.isfinite(each.value)
    }
    less = f"Current times {known.value:.2f} N·m/A less cell's torque and inertia; red: the fit."
    pictures = [
        Picture("losses_before", "Losses before the load cell over velocity",
                less, (7.2, 4.6), partial(_draw_before, points, known.value, before)),
    ]  # fmt: skip
    if behind is not None:
        said = "Some of the samples at speed, the cell's drift taken out; red: the fit."
        title = "Losses behind the load cell over velocity"
        draw = partial(_draw_behind, free, behind)
        pictures.insert(0, Picture("losses_behind", title, said, (7.2, 4.6), draw))
    return Result(
        (_table(points, known.value),),
        _compared(behind, before),
        named,
        tuple(pictures),
        (
            f"Losses before the cell rest on the torque constant {words(known)}, {known.method}"
            + ("." if constant else "; its error is not in their intervals."),
            "What differs between directions is told from a drift of the cell's zero by its being "
            "constant over the run, and the zero right at the tare.",
        ),
    )


def _zero_error(points: list[Rubbed]) -> float:
    """Half width, 95 %, of the cell's zero: by its noise over the ticks of the tare."""
    noise = float(np.mean([np.std(np.diff(each.point.torque)) for each in points])) / np.sqrt(2.0)
    samples = max(1, min(each.point.tare_samples for each in points))
    return float(1.96 * noise / np.sqrt(samples))


def _widened(of: Estimate, by: float) -> Estimate:
    return of._replace(uncertainty=float(np.hypot(of.uncertainty, by)))


def _rubbed(point: Point) -> Rubbed:
    of = point.cut()
    speed = periods.velocity(periods.detrended(point.motor, of), of.dt, WINDOW)
    rate = periods.velocity(speed, of.dt, WINDOW)
    good = losses.moving(speed, round(WINDOW / of.dt))
    time = point.start + of.dt * np.arange(len(speed))
    torque, current = point.over(point.torque, of), point.over(point.current, of)
    columns: list[Floats] = [speed, rate, torque, current, np.asarray(time, np.float64), good]
    parts = [periods.pieces(each, of) for each in columns]
    groups = [
        Turned(*(each[good] for each in signals)) for *signals, good in zip(*parts, strict=True)
    ]
    return Rubbed(point, of, [each for each in groups if len(each.velocity) > 20])


def _groups(points: list[Rubbed]) -> tuple[list[Turned], str]:
    if len(points) >= losses.LEAST_GROUPS:
        return [each.whole for each in points], "set points"
    return [group for each in points for group in each.groups], "periods"


def _with_constant(points: list[Rubbed], constant: Estimate) -> tuple[list[Turned], Estimate, str]:
    groups, kind = _groups(points)
    return groups, constant, kind


def _table(points: list[Rubbed], constant: float) -> Table:
    whole = [each.whole for each in points]
    lost = [np.sign(w.velocity) * (constant * w.current - w.torque) for w in whole]
    return Table(
        "losses_points",
        "Losses by set point, mean at speed",
        (
            Column("row", "", tuple(each.point.row for each in points)),
            Column("amplitude", "deg", tuple(p.point.number("amplitude_deg") for p in points)),
            Column("brake current", "A",
                   tuple(p.point.number("brake_current_a", 0.0) for p in points)),
            Column("rms velocity", "rad/s", tuple(periods.rms(w.velocity) for w in whole)),
            Column("behind the cell, positive", "N*m",
                   tuple(float(w.torque[w.velocity > 0.0].mean()) for w in whole)),
            Column("behind the cell, negative", "N*m",
                   tuple(float(-w.torque[w.velocity < 0.0].mean()) for w in whole)),
            Column("before the cell", "N*m", tuple(float(each.mean()) for each in lost)),
        ),
    )  # fmt: skip


def _compared(behind: Behind | None, before: Before) -> tuple[Compared, ...]:
    out = []
    if behind is not None:
        out += [
            Compared("behind the cell, clockwise (dry)", "mostly below 0.15 N·m", "",
                     words(behind.positive), None),
            Compared("behind the cell, counter-clockwise (dry)", "larger than clockwise", "",
                     words(behind.negative), None),
            Compared("behind the cell, viscous", "grows with speed", "",
                     words(behind.viscous), None),
            Compared("drift of the cell's zero", "", "", words(behind.drift), None),
            Compared("behind the cell, inertia", "", "", words(behind.inertia), None),
        ]  # fmt: skip
    told = np.isfinite(before.share.value)
    share = words(before.share) if told else "in the dry part: no loads that differ"
    return (
        *out,
        Compared("before the cell, dry", "", "", words(before.dry), None),
        Compared("before the cell, share of the load", "", "", share, None),
        Compared("before the cell, viscous", "", "", words(before.viscous), None),
        Compared("before the cell, inertia", "", "", words(before.inertia), None),
    )


def _draw_behind(points: list[Rubbed], fitted: Behind, body: SubFigure) -> None:
    axes = axes_of(body, "velocity, rad/s", "torque of the load cell, N·m")
    last = max(float(each.whole.time.max()) for each in points)
    for i, each in enumerate(points):
        whole = each.whole
        pick = slice(None, None, max(1, len(whole.velocity) // 1500))
        colour = shade(i + 1, len(points) + 1)
        torque = whole.torque - losses.zero(fitted, whole.time, last)
        axes.plot(whole.velocity[pick], torque[pick], ".", ms=1.5, color=colour, alpha=0.35)
    top = max(float(np.abs(each.whole.velocity).max()) for each in points)
    x = np.linspace(0.0, top, 50)
    slope = fitted.viscous.value
    axes.plot(x, fitted.positive.value + slope * x, color=RED, lw=1.6)
    axes.plot(-x, -fitted.negative.value - slope * x, color=RED, lw=1.6)
    note(axes, f"clockwise {words(fitted.positive)}\ncounter-clockwise {words(fitted.negative)}\n"
         f"viscous {words(fitted.viscous)}", "upper left")  # fmt: skip


def _draw_before(points: list[Rubbed], constant: float, fitted: Before, body: SubFigure) -> None:
    axes = axes_of(body, "velocity, rad/s", "motor torque less cell's less inertia, N·m")
    inertia = fitted.inertia.value
    for i, each in enumerate(points):
        w = each.whole
        lost = constant * w.current - w.torque - inertia * w.acceleration
        edges = np.linspace(-np.abs(w.velocity).max(), np.abs(w.velocity).max(), 41)
        at = np.digitize(w.velocity, edges)
        full = [k for k in range(1, 41) if (at == k).sum() > 10]
        x = [w.velocity[at == k].mean() for k in full]
        y = [lost[at == k].mean() for k in full]
        axes.plot(x, y, ".", ms=4, color=shade(i + 1, len(points) + 1))
    axes.axhline(0.0, color=BLUE, lw=0.5)
    said = f"dry {words(fitted.dry)}\nviscous {words(fitted.viscous)}"
    if np.isfinite(fitted.share.value):
        said += f"\nshare of load {words(fitted.share)}"
    else:  # one line for all loads, for there is but one
        top = max(float(np.abs(each.whole.velocity).max()) for each in points)
        line = fitted.dry.value + fitted.viscous.value * np.array([0.0, top])
        axes.plot([0.0, top], line, color=RED, lw=1.2)
        axes.plot([0.0, -top], -line, color=RED, lw=1.2)
    note(axes, said, "upper left")
