"""The torque tracking session: measured torque beside the wanted one, open and closed loop."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.analysis.session import tracking
from rig.analysis.session.drawing import BLUE, RED, axes_of
from rig.analysis.session.estimate import Estimate, Floats
from rig.analysis.session.periods import Cut
from rig.analysis.session.points import Point, Session, session_of
from rig.analysis.session.result import Column, Compared, Picture, Result, Table, words
from rig.analysis.session.tracking import Tracked

CLOSED = "closed loop"


class Followed(NamedTuple):
    """A set point."""

    point: Point
    of: Cut
    wanted: Floats  # N*m
    measured: Floats  # N*m
    tracked: Tracked

    @property
    def place(self) -> tuple[float, float]:
        """Torque amplitude (N*m) and period (s) asked for."""
        return round(self.point.number("torque_amplitude_n_m"), 3), round(self.point.period, 3)


def result(session: Session, against: Session | None = None) -> Result:
    """Analyse a run; ``against`` is a run of the same rows in open loop."""
    mine = [_followed(point) for point in session.whole]
    if not mine:
        raise ValueError("no set point was measured to its end")
    loop = _loop(session)
    others = [_followed(point) for point in against.whole] if against is not None else []
    base = {each.place: each for each in others}
    pairs = [(each, base[each.place]) for each in mine if each.place in base]
    named: dict[str, Estimate] = {}
    if pairs:
        named["tracking_improvement"] = tracking.improvement(
            [other.tracked for _, other in pairs], [one.tracked for one, _ in pairs]
        )
    return Result(
        (_table(mine, base, loop),),
        _compared(mine, pairs, loop, named.get("tracking_improvement")),
        named,
        _pictures(mine, base, loop),
        (f"Open loop: run {against.known.run}.",) if against is not None else (),
    )


def _loop(session: Session) -> str:
    return str(session_of(session.known).get("control") or "open loop")


def _followed(point: Point) -> Followed:
    of = point.cut()
    wanted, measured = (point.over(each, of) for each in (point.wanted_torque, point.torque))
    return Followed(point, of, wanted, measured, tracking.tracked(wanted, measured, of))


def _table(mine: list[Followed], base: dict[tuple[float, float], Followed], loop: str) -> Table:
    columns = [
        Column("row", "", tuple(each.point.row for each in mine)),
        Column("torque amplitude", "N*m", tuple(each.place[0] for each in mine)),
        Column("period", "s", tuple(each.place[1] for each in mine)),
        Column(f"rms error, {loop}", "N*m", tuple(e.tracked.error.value for e in mine)),
        Column(f"rms error, {loop} ±", "N*m", tuple(e.tracked.error.uncertainty for e in mine)),
        Column("error / wanted", "", tuple(each.tracked.share for each in mine)),
    ]
    if base:
        other = [
            base[e.place].tracked.error.value if e.place in base else float("nan") for e in mine
        ]
        ratio = [e.tracked.error.value / o for e, o in zip(mine, other, strict=True)]
        columns += [
            Column("rms error, open loop", "N*m", tuple(other)),
            Column("closed / open", "", tuple(ratio)),
        ]
    return Table("torque_tracking", "Torque tracking by set point", tuple(columns))


def _compared(
    mine: list[Followed],
    pairs: list[tuple[Followed, Followed]],
    loop: str,
    improved: Estimate | None,
) -> tuple[Compared, ...]:
    share = 100.0 * float(np.mean([each.tracked.share for each in mine]))
    out = [Compared(f"rms error, {loop}", "not built", "", f"{share:.1f} % of the wanted", None)]
    if pairs and improved is not None:
        sums = [
            np.sqrt(np.mean([np.mean((e.wanted - e.measured) ** 2) for e in side]))
            for side in zip(*pairs, strict=True)
        ]
        ratio = float(sums[0] / sums[1])
        out.append(
            Compared("rms error, closed over open loop", "not built", "≤ 1/3",
                     f"{ratio:.3f} pooled; {words(improved)} by set points", ratio <= 1.0 / 3.0)
        )  # fmt: skip
    return tuple(out)


def _pictures(
    mine: list[Followed], base: dict[tuple[float, float], Followed], loop: str
) -> tuple[Picture, ...]:
    one = max(mine, key=lambda each: each.place[0])
    said = f"Torque amplitude {one.place[0]:g} N·m, one period; below, the error."
    return (
        Picture("torque_tracking", "Torque: wanted and measured", said, (7.2, 5.6),
                partial(_draw, one, base.get(one.place), loop)),
    )  # fmt: skip


def _draw(one: Followed, other: Followed | None, loop: str, body: SubFigure) -> None:
    upper, lower = body.subplots(2, 1, sharex=True)
    upper = axes_of(body, "", "torque, N·m", upper)
    lower = axes_of(body, "time, s", "error, N·m", lower)
    count = round(one.of.period / one.of.dt)
    t = one.of.dt * np.arange(count)
    upper.plot(t, one.wanted[:count], "k--", lw=1.0, label="wanted")
    shown = [(one, BLUE, loop)]
    if other is not None and len(other.measured) >= count:
        shown.insert(0, (other, RED, "open loop"))
    for each, colour, name in shown:
        upper.plot(t, each.measured[:count], color=colour, lw=1.2, label=name)
        lower.plot(t, (each.wanted - each.measured)[:count], color=colour, lw=1.0)
    upper.legend(frameon=False, fontsize=8)
    lower.margins(x=0.0)
