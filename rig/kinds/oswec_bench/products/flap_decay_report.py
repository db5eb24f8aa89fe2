"""The free decay session of the flap: releases, fitted decay, losses by half swing."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.kinds.oswec_bench.products import flap_decay
from rig.kinds.oswec_bench.products.drawing import (
    BLUE,
    RED,
    annotate_corner,
    prepare_axes,
    shade,
)
from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.flap_decay import Decay, HalfSwingLoss, Release
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import (
    Column,
    Comparison,
    FigureSpec,
    Result,
    Table,
    format_estimate,
)


class MeasuredRelease(NamedTuple):
    """A release as measured."""

    point: SetpointData
    release: Release
    losses: list[HalfSwingLoss]


def analyse_session(session: SessionRun, stiffness: Estimate | None = None) -> Result:
    """Analyse a run; with the flap's ``stiffness`` (N*m/rad) the result contains moments, too."""
    points = session.complete_points
    releases = [flap_decay.prepare_release(point.shaft, point.dt) for point in points]
    decay = flap_decay.fit_decay(releases)
    rest_angle = decay.rest_angle.value
    measured = [
        MeasuredRelease(point, each, flap_decay.half_swing_losses(each, rest_angle))
        for point, each in zip(points, releases, strict=True)
    ]
    constants = {
        "flap_natural_period": decay.period,
        "flap_decay_rate": decay.decay_rate,
        "flap_damping_ratio": decay.damping_ratio,
        "flap_quadratic_over_spring": decay.quadratic,
        "flap_friction_angle": decay.friction,
    }
    moments = _moments(decay, stiffness) if stiffness is not None else {}
    notes = [
        "The flap alone, with its rigid coupling removed; added inertia and radiation are those "
        "at its natural period. Dry friction is that of bearings and seals.",
    ]
    if stiffness is None:
        notes.append("No moments: there is no analysed flap_hydrostatic run in the same folder.")
    return Result(
        (_table(measured),),
        _comparisons({**constants, **moments}),
        {**constants, **moments},
        (
            FigureSpec(
                "flap_decay",
                "Free decay of the flap",
                "Blue: measured; red: the fit, integrated.",
                (7.6, 4.8),
                partial(_draw_releases, measured, decay),
            ),
            FigureSpec(
                "flap_extinction",
                "Amplitude loss of half a swing over its amplitude",
                "Points: turning points of each release; red: those of the fit.",
                (7.2, 4.6),
                partial(_draw_losses, measured, decay),
            ),
        ),
        tuple(notes),
    )


def _moments(decay: Decay, stiffness: Estimate) -> dict[str, Estimate]:
    """Return inertia and damping by the spring rate.

    Inertia and linear damping include radiation.
    """

    def scaled(factor: float, unit: str, *shares: Estimate) -> Estimate:
        relative = [each.uncertainty / each.value for each in (stiffness, *shares)]
        value = factor * stiffness.value
        method = f"{shares[0].method}; spring {stiffness.method}"
        return Estimate(value, abs(value) * float(np.linalg.norm(relative)), unit, method)

    natural, rate = decay.natural_squared, decay.decay_rate
    return {
        "flap_inertia": scaled(1.0 / natural.value, "kg*m^2", natural),
        "flap_linear_damping": scaled(2.0 * rate.value / natural.value, "N*m*s/rad", rate, natural),
        "flap_quadratic_damping": scaled(decay.quadratic.value, "N*m*s^2/rad^2", decay.quadratic),
        "flap_dry_friction": scaled(decay.friction.value, "N*m", decay.friction),
    }


_LABELS = {
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


def _comparisons(constants: dict[str, Estimate]) -> tuple[Comparison, ...]:
    return tuple(
        Comparison(_LABELS[name], "not run", "", format_estimate(each), None)
        for name, each in constants.items()
    )


def _table(releases: list[MeasuredRelease]) -> Table:
    return Table(
        "flap_releases",
        "Releases",
        (
            Column("row", "", tuple(each.point.row for each in releases)),
            Column(
                "released at", "deg", tuple(e.point.plan_value("release_deg") for e in releases)
            ),
            Column(
                "measured start",
                "deg",
                tuple(float(np.degrees(e.release.angle[0])) for e in releases),
            ),
            Column("half swings", "", tuple(len(each.losses) for each in releases)),
            Column(
                "rest angle",
                "deg",
                tuple(float(np.degrees(each.release.angle[-1])) for each in releases),
            ),
        ),
    )


def _draw_releases(releases: list[MeasuredRelease], decay: Decay, body: SubFigure) -> None:
    axes = prepare_axes(body, "time since the release, s", "angle, deg")
    for each in releases:
        t, angle, dt = each.release.time, each.release.angle, each.release.dt
        axes.plot(t, np.degrees(angle), color=BLUE, lw=1.8)
        fitted = flap_decay.simulate_release(decay.fit, float(angle[0]), len(angle), dt)
        axes.plot(t, np.degrees(fitted), "--", color=RED, lw=0.9)
    axes.set_xlim(0.0, None)
    lines = (
        f"natural period {format_estimate(decay.period)}",
        f"damping ratio {format_estimate(decay.damping_ratio)}",
        f"quadratic damping over spring {format_estimate(decay.quadratic)}",
        f"friction holds within {format_estimate(decay.friction, 'deg', 180.0 / np.pi)}",
    )
    annotate_corner(axes, "\n".join(lines), "upper right")


def _draw_losses(releases: list[MeasuredRelease], decay: Decay, body: SubFigure) -> None:
    axes = prepare_axes(body, "mean amplitude of half a swing, deg", "amplitude loss, deg")
    for i, each in enumerate(releases):
        release = each.release
        angle = flap_decay.simulate_release(
            decay.fit, float(release.angle[0]), len(release.angle), release.dt
        )
        fitted = flap_decay.half_swing_losses(release._replace(angle=angle), decay.rest_angle.value)
        if each.losses and fitted:
            colour, label = (
                shade(i + 1, len(releases) + 1),
                f"{each.point.plan_value('release_deg'):g} deg",
            )
            axes.plot(*np.degrees(each.losses).T, "o", ms=6, color=colour, label=label)
            axes.plot(*np.degrees(fitted).T, "+", ms=10, color=RED)
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False, fontsize=8, title="released at", title_fontsize=8)
