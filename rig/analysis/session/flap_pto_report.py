"""The power take-off session of the flap: power over the motor's damping, and the best of it."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.analysis.session import flap_pto
from rig.analysis.session.drawing import RED, axes_of, shade
from rig.analysis.session.estimate import Estimate
from rig.analysis.session.flap_pto import Best, Taken
from rig.analysis.session.points import Point, Session
from rig.analysis.session.result import Column, Compared, Picture, Result, Table, words

IDEAL = (42.0, 104.0)
"""N*m*s/rad: ideal dampings of waves of 1 to 2 s and 0.1 m (OSWEC thesis, section 2.1)."""

WINDOW = 0.02
"""s, of the moving-window differentiator."""


class Damped(NamedTuple):
    """A set point."""

    point: Point
    taken: Taken


class Waves(NamedTuple):
    """All dampings in one sea."""

    said: str
    name: str  # of its constants
    rows: list[Damped]  # by damping
    best: Best | None


def result(session: Session) -> Result:
    """Analyse a run."""
    rows = [_damped(point, session.torque_constant) for point in session.whole]
    if not rows:
        raise ValueError("no set point was measured to its end")
    waves = _waves(rows, irregular=session.irregular)
    named: dict[str, Estimate] = {}
    for each in waves:
        if each.best is not None:
            named[f"flap_best_damping{each.name}"] = each.best.damping
            named[f"flap_best_power{each.name}"] = each.best.power
    return Result(
        (_table(waves),),
        tuple(_compared(each) for each in waves),
        named,
        (
            Picture("flap_power", "Power that the flap gives over the damping it feels",
                    "Points: measured at the load cell, 95 %; lines: the fit; crosses: of it what "
                    "reaches the motor.", (7.4, 4.8), partial(_draw, waves)),
            Picture("flap_damping", "Damping at the load cell over damping asked",
                    "Above the dashed line the gearbox's friction adds to the motor.", (6.4, 4.2),
                    partial(_draw_damping, waves)),
        ),
        (
            "Power is positive where it is taken out of the waves. The motor's is by its measured "
            "current and the constant in use, before electrical losses.",
            "The best damping is that felt behind the load cell, the motor's inertia being part of "
            "the flap's impedance.",
        ),
    )  # fmt: skip


def _damped(point: Point, constant: float) -> Damped:
    found = flap_pto.taken(
        point.shaft, point.motor, point.torque, constant * point.current, point.cut(), WINDOW
    )
    return Damped(point, found)


def _waves(rows: list[Damped], *, irregular: bool) -> list[Waves]:
    seas: dict[tuple[float, float], list[Damped]] = {}
    for each in rows:
        seas.setdefault((each.point.number("wave_amplitude_m"), each.point.period), []).append(each)
    out = []
    for (wave, period), mine in sorted(seas.items()):
        mine.sort(key=lambda each: each.taken.damping)
        said = f"{1e3 * wave:g} mm, " + ("irregular" if irregular else f"{period:g} s")
        name = "" if len(seas) == 1 else f"_{round(1e3 * wave)}mm_{round(1e3 * period)}ms"
        out.append(Waves(said, name, mine, flap_pto.best([each.taken for each in mine])))
    return out


def _table(waves: list[Waves]) -> Table:
    rows = [(each.said, row.point, row.taken) for each in waves for row in each.rows]
    return Table(
        "flap_power",
        "Power by set point",
        (
            Column("row", "", tuple(point.row for _, point, _ in rows)),
            Column("waves", "", tuple(said for said, _, _ in rows)),
            Column("damping asked", "N*m*s/rad",
                   tuple(p.number("pto_damping_n_m_s_per_rad") for _, p, _ in rows)),
            Column("damping felt", "N*m*s/rad", tuple(t.damping for *_, t in rows)),
            Column("reactance", "N*m*s/rad", tuple(t.reactance for *_, t in rows)),
            Column("amplitude", "deg", tuple(float(np.degrees(t.amplitude)) for *_, t in rows)),
            Column("power of the flap", "W", tuple(t.power.value for *_, t in rows)),
            Column("power of the flap ±", "W", tuple(t.power.uncertainty for *_, t in rows)),
            Column("power of the motor", "W", tuple(t.motor.value for *_, t in rows)),
        ),
    )  # fmt: skip


def _compared(of: Waves) -> Compared:
    if of.best is None:
        said = f"too few dampings for a fit ({len(of.rows)} of {flap_pto.LEAST})"
    else:
        said = f"{words(of.best.damping)}, {words(of.best.power)}"
    theirs = f"{IDEAL[0]:g} to {IDEAL[1]:g} N·m·s/rad in waves of 1 to 2 s"
    return Compared(f"best damping and its power, waves {of.said}", theirs, "", said, None)


def _draw(waves: list[Waves], body: SubFigure) -> None:
    axes = axes_of(body, "damping at the load cell, N·m·s/rad", "mean power, W")
    top = 0.0
    for i, each in enumerate(waves):
        colour = shade(i + 1, len(waves) + 1)
        damping = [row.taken.damping for row in each.rows]
        power = [row.taken.power.value for row in each.rows]
        half = np.nan_to_num([row.taken.power.uncertainty for row in each.rows])
        top = max(top, *power)
        said = each.said
        if each.best is not None:
            said += f": {words(each.best.damping)}, {words(each.best.power)}"
            fine = np.linspace(0.0, 1.05 * max(damping), 300)
            axes.plot(fine, flap_pto.expected_power(each.best.unknowns, fine), lw=1.2, color=colour)
            best = each.best.damping.value, each.best.power.value
            axes.plot(*best, "*", ms=11, color=RED, zorder=5)
        axes.errorbar(damping, power, half, fmt="o", ms=4, capsize=2.5, color=colour, label=said)
        axes.plot(damping, [row.taken.motor.value for row in each.rows], "x", ms=4, color=colour)
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, 1.35 * top)
    axes.legend(frameon=False, fontsize=8, title="waves: best damping and its power (stars)",
                title_fontsize=8, loc="upper right")  # fmt: skip


def _draw_damping(waves: list[Waves], body: SubFigure) -> None:
    axes = axes_of(body, "damping asked of the motor, N·m·s/rad", "damping felt, N·m·s/rad")
    top = 0.0
    for i, each in enumerate(waves):
        asked = [row.point.number("pto_damping_n_m_s_per_rad") for row in each.rows]
        felt = [row.taken.damping for row in each.rows]
        top = max(top, *asked)
        axes.plot(asked, felt, "o", ms=4, color=shade(i + 1, len(waves) + 1), label=each.said)
    axes.plot([0.0, top], [0.0, top], "k--", lw=0.9)
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False, fontsize=8, title="waves", title_fontsize=8)
