"""The free decay session of the flap: how it swings out."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.analysis.session import flap_decay
from rig.analysis.session.drawing import BLUE, RED, axes_of, note, shade
from rig.analysis.session.estimate import Estimate
from rig.analysis.session.flap_decay import Decay, Loss, Release
from rig.analysis.session.points import Point, Session
from rig.analysis.session.result import Column, Compared, Picture, Result, Table, words


class Swung(NamedTuple):
    """A release as measured."""

    point: Point
    release: Release
    lost: list[Loss]


def result(session: Session, stiffness: Estimate | None = None) -> Result:
    """Analyse a run; with the flap's ``stiffness`` (N*m/rad) also what it means in moments."""
    whole = session.whole
    releases = [flap_decay.release(point.shaft, point.dt) for point in whole]
    found = flap_decay.decay(releases)
    rest = found.rest.value
    swung = [
        Swung(point, each, flap_decay.losses(each, rest))
        for point, each in zip(whole, releases, strict=True)
    ]
    named = {
        "flap_natural_period": found.period,
        "flap_decay_rate": found.rate,
        "flap_damping_ratio": found.ratio,
        "flap_quadratic_over_spring": found.quadratic,
        "flap_friction_angle": found.friction,
    }
    moments = _moments(found, stiffness) if stiffness is not None else {}
    said = [
        "The flap alone, its rigid coupling taken out; added inertia and radiation are those at "
        "its own period. Dry friction is that of bearings and seals.",
    ]
    if stiffness is None:
        said.append("Without a flap_hydrostatic run beside this one there are no moments.")
    return Result(
        (_table(swung),),
        _compared({**named, **moments}),
        {**named, **moments},
        (
            Picture("flap_decay", "The flap let go", "Blue: measured; red: the fit, integrated.",
                    (7.6, 4.8), partial(_draw, swung, found)),
            Picture("flap_extinction", "What half a swing loses over its amplitude",
                    "Points: turning points of each release; red: those of the fit.",
                    (7.2, 4.6), partial(_draw_losses, swung, found)),
        ),
        tuple(said),
    )  # fmt: skip


def _moments(found: Decay, stiffness: Estimate) -> dict[str, Estimate]:
    """Inertia and damping by the spring; of inertia and linear damping radiation is a part."""

    def times(factor: float, unit: str, *shares: Estimate) -> Estimate:
        relative = [each.uncertainty / each.value for each in (stiffness, *shares)]
        value = factor * stiffness.value
        how = f"{shares[0].method}; spring {stiffness.method}"
        return Estimate(value, abs(value) * float(np.linalg.norm(relative)), unit, how)

    natural, rate = found.natural, found.rate
    return {
        "flap_inertia": times(1.0 / natural.value, "kg*m^2", natural),
        "flap_linear_damping": times(2.0 * rate.value / natural.value, "N*m*s/rad", rate, natural),
        "flap_quadratic_damping": times(found.quadratic.value, "N*m*s^2/rad^2", found.quadratic),
        "flap_dry_friction": times(found.friction.value, "N*m", found.friction),
    }


_SAID = {
    "flap_natural_period": "natural period of small swings",
    "flap_decay_rate": "decay rate of small swings",
    "flap_damping_ratio": "damping ratio, linear",
    "flap_quadratic_over_spring": "quadratic damping over spring",
    "flap_friction_angle": "dry friction over spring",
    "flap_inertia": "inertia with added inertia",
    "flap_linear_damping": "linear damping, radiation included",
    "flap_quadratic_damping": "quadratic damping",
    "flap_dry_friction": "dry friction",
}


def _compared(named: dict[str, Estimate]) -> tuple[Compared, ...]:
    return tuple(
        Compared(_SAID[name], "not run", "", words(each), None) for name, each in named.items()
    )


def _table(swung: list[Swung]) -> Table:
    return Table(
        "flap_releases",
        "Releases",
        (
            Column("row", "", tuple(each.point.row for each in swung)),
            Column("released at", "deg", tuple(e.point.number("release_deg") for e in swung)),
            Column("from", "deg", tuple(float(np.degrees(e.release.angle[0])) for e in swung)),
            Column("half swings", "", tuple(len(each.lost) for each in swung)),
            Column("came to rest at", "deg",
                   tuple(float(np.degrees(each.release.angle[-1])) for each in swung)),
        ),
    )  # fmt: skip


def _draw(swung: list[Swung], found: Decay, body: SubFigure) -> None:
    axes = axes_of(body, "time since it was let go, s", "angle, deg")
    for each in swung:
        t, angle, dt = each.release.time, each.release.angle, each.release.dt
        axes.plot(t, np.degrees(angle), color=BLUE, lw=1.8)
        fitted = flap_decay.swing(found.fit, float(angle[0]), len(angle), dt)
        axes.plot(t, np.degrees(fitted), "--", color=RED, lw=0.9)
    axes.set_xlim(0.0, None)
    told = (
        f"natural period {words(found.period)}",
        f"damping ratio {words(found.ratio)}",
        f"quadratic damping over spring {words(found.quadratic)}",
        f"friction holds within {words(found.friction, 'deg', 180.0 / np.pi)}",
    )
    note(axes, "\n".join(told), "upper right")


def _draw_losses(swung: list[Swung], found: Decay, body: SubFigure) -> None:
    axes = axes_of(body, "mean amplitude of half a swing, deg", "lost in it, deg")
    for i, each in enumerate(swung):
        told = each.release
        angle = flap_decay.swing(found.fit, float(told.angle[0]), len(told.angle), told.dt)
        fitted = flap_decay.losses(told._replace(angle=angle), found.rest.value)
        if each.lost and fitted:
            colour, label = (
                shade(i + 1, len(swung) + 1),
                f"{each.point.number('release_deg'):g} deg",
            )
            axes.plot(*np.degrees(each.lost).T, "o", ms=6, color=colour, label=label)
            axes.plot(*np.degrees(fitted).T, "+", ms=10, color=RED)
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False, fontsize=8, title="released at", title_fontsize=8)
