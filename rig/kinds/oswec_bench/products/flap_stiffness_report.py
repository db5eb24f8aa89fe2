"""The hydrostatic session of the flap: moment over angle in slow motion."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure
from scipy.ndimage import uniform_filter1d

from rig.kinds.oswec_bench.products import flap_stiffness, losses, periods
from rig.kinds.oswec_bench.products.drawing import RED, annotate_corner, prepare_axes, shade
from rig.kinds.oswec_bench.products.estimate import Floats
from rig.kinds.oswec_bench.products.flap_stiffness import MovingSamples, SpringFit
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import (
    Column,
    Comparison,
    FigureSpec,
    Result,
    Table,
    format_estimate,
)

WINDOW_SHARE = 0.03
"""Averaging window of the signals, as a share of the period.

It suppresses the flap's ringing on its coupling (some 7 Hz, excited by the gap at each reversal of
the load), which would count as motion.
"""

MIN_SPEED_SHARE = 0.25
"""Minimum speed as a share of the top speed; below it, ringing changes the sign of friction."""


class SlowPoint(NamedTuple):
    """A set point, cut to its whole periods."""

    point: SetpointData
    cut: PeriodCut
    angle: Floats  # rad
    torque: Floats  # N*m
    groups: list[MovingSamples]  # its periods, during motion

    @property
    def all_samples(self) -> MovingSamples:
        """All periods as one group."""
        return MovingSamples(*(np.concatenate(each) for each in zip(*self.groups, strict=True)))


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run of the session."""
    points = [_slow_point(point) for point in session.complete_points]
    groups = [group for each in points for group in each.groups]
    spring = flap_stiffness.fit_spring(groups, "periods")
    constants = {
        "flap_stiffness": spring.stiffness,
        "flap_rest": spring.rest_angle,
        "flap_dry_friction_behind": spring.dry_friction,
        "flap_viscous_slow": spring.viscous,
        "flap_inertia_slow": spring.inertia,
    }
    return Result(
        (_table(points, spring),),
        _comparisons(spring),
        constants,
        (
            FigureSpec(
                "flap_moment",
                "Moment over angle in slow motion",
                "Averaged signals; faint: as measured; darker: later. Red: the spring.",
                (7.2, 4.8),
                partial(_draw_moment, points, spring),
            ),
            FigureSpec(
                "flap_moment_rest",
                "Residual of the spring",
                "Cell minus spring and inertia: friction behind the cell changes its sign with "
                "the motion.",
                (7.2, 4.4),
                partial(_draw_residual, points, spring),
            ),
        ),
        (
            "The load cell measures the loads behind it: the flap, and the bearing and seal on its "
            "far side, not those before the cell. Angles are the shaft encoder's.",
        ),
    )


def _window_samples(point: SetpointData) -> int:
    """Return the number of samples of the averaging window."""
    return 2 * round(0.5 * WINDOW_SHARE * point.period / point.dt) + 1


def _slow_point(point: SetpointData) -> SlowPoint:
    cut = point.whole_periods()
    window_samples = _window_samples(point)
    angle, torque = (
        uniform_filter1d(each, window_samples, mode="nearest")
        for each in (point.shaft, point.torque)
    )
    velocity = np.gradient(angle, point.dt)
    acceleration = np.gradient(uniform_filter1d(velocity, window_samples, mode="nearest"), point.dt)
    time = point.start_time + point.dt * np.arange(len(angle))
    moving = losses.moving_samples(velocity, window_samples, MIN_SPEED_SHARE).astype(np.float64)
    signals = [
        periods.split_periods(point.trim(np.asarray(each, np.float64), cut), cut)
        for each in (angle, velocity, acceleration, torque, time, moving)
    ]
    groups = [
        MovingSamples(*(each[is_moving > 0.5] for each in period))
        for *period, is_moving in zip(*signals, strict=True)
    ]
    shaft, load_cell_torque = (point.trim(each, cut) for each in (point.shaft, point.torque))
    return SlowPoint(
        point, cut, shaft, load_cell_torque, [each for each in groups if len(each.angle) > 100]
    )


def _table(points: list[SlowPoint], spring: SpringFit) -> Table:
    return Table(
        "flap_slow",
        "Slow motion by set point",
        (
            Column("row", "", tuple(each.point.row for each in points)),
            Column(
                "requested amplitude",
                "deg",
                tuple(each.point.plan_value("amplitude_deg") for each in points),
            ),
            Column("period", "s", tuple(each.point.period for each in points)),
            Column(
                "amplitude",
                "deg",
                tuple(float(np.degrees(0.5 * np.ptp(each.angle))) for each in points),
            ),
            Column(
                "slope of moment over angle",
                "N*m/rad",
                tuple(_moment_slope(e.all_samples) for e in points),
            ),
            Column(
                "spring less inertia",
                "N*m/rad",
                tuple(
                    spring.stiffness.value - spring.inertia.value * each.cut.omega**2
                    for each in points
                ),
            ),
        ),
    )


def _moment_slope(samples: MovingSamples) -> float:
    """Return the slope of moment over angle, with friction fitted by the sign of the motion."""
    design = np.stack(
        [samples.angle, np.ones(len(samples.angle)), np.sign(samples.velocity)], axis=1
    )
    return float(np.linalg.lstsq(design, samples.torque)[0][0])


def _comparisons(spring: SpringFit) -> tuple[Comparison, ...]:
    return (
        Comparison("buoyant spring", "not run", "", format_estimate(spring.stiffness), None),
        Comparison(
            "angle of rest", "", "", format_estimate(spring.rest_angle, "deg", 180.0 / np.pi), None
        ),
        Comparison(
            "dry friction behind the cell", "", "", format_estimate(spring.dry_friction), None
        ),
        Comparison("viscous, slow motion", "", "", format_estimate(spring.viscous), None),
        Comparison(
            "inertia with added inertia, slow motion", "", "", format_estimate(spring.inertia), None
        ),
    )


def _draw_moment(points: list[SlowPoint], spring: SpringFit, body: SubFigure) -> None:
    axes = prepare_axes(body, "angle of the shaft, deg", "moment at the load cell, N·m")
    for i, each in enumerate(points):
        last = slice(each.cut.edges[-2] - each.cut.edges[0], None, 20)
        label = f"{each.point.plan_value('amplitude_deg'):g} deg, {each.point.period:g} s"
        colour = shade(i + 1, len(points) + 1)
        axes.plot(np.degrees(each.angle[last]), each.torque[last], lw=0.4, alpha=0.2, color=colour)
        smooth = [
            uniform_filter1d(s, _window_samples(each.point)) for s in (each.angle, each.torque)
        ]
        axes.plot(np.degrees(smooth[0][last]), smooth[1][last], lw=1.0, label=label, color=colour)
    max_angle = max(float(np.abs(each.angle).max()) for each in points)
    x = np.array([-max_angle, max_angle])
    line = spring.stiffness.value * (x - spring.rest_angle.value)
    axes.plot(np.degrees(x), line, "--", color=RED, lw=1.2)
    annotate_corner(axes, format_estimate(spring.stiffness), "lower right")
    axes.legend(frameon=False, fontsize=8, loc="upper left")


def _draw_residual(points: list[SlowPoint], spring: SpringFit, body: SubFigure) -> None:
    axes = prepare_axes(body, "angle of the shaft, deg", "moment minus spring and inertia, N·m")
    for i, each in enumerate(points):
        samples = each.all_samples
        explained = spring.stiffness.value * (samples.angle - spring.rest_angle.value)
        explained = (
            explained
            + spring.inertia.value * samples.acceleration
            + spring.drift.value * samples.time
        )
        decimated = slice(None, None, max(1, len(samples.angle) // 1500))
        axes.plot(
            np.degrees(samples.angle[decimated]),
            (samples.torque - explained)[decimated],
            ".",
            ms=1.5,
            alpha=0.5,
            color=shade(i + 1, len(points) + 1),
        )
    for sign in (1.0, -1.0):
        axes.axhline(sign * spring.dry_friction.value, color=RED, lw=1.0, ls="--")
    annotate_corner(axes, f"dry friction {format_estimate(spring.dry_friction)}", "upper right")
