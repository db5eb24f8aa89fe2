"""The hydrostatic session of the flap: its buoyant spring rate in slow motion, by the load cell.

    T = C (theta - theta0) + f sign(v) + b v + J a + z t

Two periods of motion separate spring and inertia, which cannot be separated in one sine. z t is a
drift of the cell's zero. Intervals are by leaving out one period at a time.
"""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from scipy.ndimage import uniform_filter1d

from rig.kinds.oswec_bench.products import figures, periods
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, jackknifed, solve_groups
from rig.kinds.oswec_bench.products.losses import MIN_GROUPS
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import Columns, Result, compare, table

WINDOW_SHARE = 0.03
"""Averaging window of the signals, as a share of the period.

It suppresses the flap's ringing on its coupling (some 7 Hz, excited by the gap at each reversal of
the load), which would count as motion.
"""

MIN_SPEED_SHARE = 0.25
"""Minimum speed as a share of the top speed; below it, ringing changes the sign of friction."""


class MovingSamples(NamedTuple):
    """A group of samples at which the flap moves, (samples,)."""

    angle: Floats  # rad
    velocity: Floats  # rad/s
    acceleration: Floats  # rad/s^2
    torque: Floats  # N*m, of the load cell
    time: Floats  # s since the tare


class SpringFit(NamedTuple):
    """Results of the load cell for the flap behind it."""

    stiffness: Estimate  # N*m/rad
    rest_angle: Estimate  # rad, angle of zero moment
    dry_friction: Estimate  # N*m
    viscous: Estimate  # N*m*s/rad
    inertia: Estimate  # kg*m^2, with added inertia of slow motion
    drift: Estimate  # N*m/s


def fit_spring(groups: list[MovingSamples]) -> SpringFit:
    """Fit all groups, periods; ValueError for too few of them."""
    if len(groups) < MIN_GROUPS:
        raise ValueError(f"{len(groups)} periods; a spring needs at least {MIN_GROUPS}")
    solutions = solve_groups([(_design_matrix(g), g.torque) for g in groups], np.linalg.solve)
    values, *left_out = [_spring_quantities(each) for each in solutions]
    units = ("N*m/rad", "rad", "N*m", "N*m*s/rad", "kg*m^2", "N*m/s")
    method = f"least squares, jackknife over {len(groups)} periods"
    stiffness, *others = jackknifed(values, left_out, units, method)
    return SpringFit(stiffness.with_cell_error(), *others)


def _design_matrix(samples: MovingSamples) -> Floats:
    v = samples.velocity
    columns = [samples.angle, np.ones(len(v)), np.sign(v), v, samples.acceleration, samples.time]
    return np.stack(columns, axis=1)


def _spring_quantities(coefficients: Floats) -> Floats:
    """Return stiffness to drift, in the order of `SpringFit`."""
    stiffness, offset, dry, viscous, inertia, drift = coefficients
    return np.array([stiffness, -offset / stiffness, dry, viscous, inertia, drift])


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
    spring = fit_spring([group for each in points for group in each.groups])
    return Result(
        (table("flap_slow", "Slow motion by set point", points, _columns(spring)),),
        (
            compare("buoyant spring", spring.stiffness, "not run"),
            compare("angle of rest", spring.rest_angle.scaled(180.0 / np.pi, "deg")),
            compare("dry friction behind the cell", spring.dry_friction),
            compare("viscous, slow motion", spring.viscous),
            compare("inertia with added inertia, slow motion", spring.inertia),
        ),
        {
            "flap_stiffness": spring.stiffness,
            "flap_rest": spring.rest_angle,
            "flap_dry_friction_behind": spring.dry_friction,
            "flap_viscous_slow": spring.viscous,
            "flap_inertia_slow": spring.inertia,
        },
        (flap_moment(points, spring), flap_moment_rest(points, spring)),
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
    size = _window_samples(point)
    angle, torque = (
        uniform_filter1d(each, size, mode="nearest") for each in (point.shaft, point.torque)
    )
    velocity = np.gradient(angle, point.dt)
    acceleration = np.gradient(uniform_filter1d(velocity, size, mode="nearest"), point.dt)
    time = point.start_time + point.dt * np.arange(len(angle))
    moving = cut.trim(periods.moving_samples(velocity, size, MIN_SPEED_SHARE))
    signals = [cut.trim(each) for each in (angle, velocity, acceleration, torque, time)]
    groups = [MovingSamples(*each) for each in periods.split_moving(signals, moving, cut)]
    long_groups = [each for each in groups if len(each.angle) > 100]
    return SlowPoint(point, cut, cut.trim(point.shaft), cut.trim(point.torque), long_groups)


def _columns(spring: SpringFit) -> Columns[SlowPoint]:
    stiffness, inertia = spring.stiffness.value, spring.inertia.value
    return {
        "row": lambda p: p.point.row,
        "requested amplitude [deg]": lambda p: p.point.plan_value("amplitude_deg"),
        "period [s]": lambda p: p.point.period,
        "amplitude [deg]": lambda p: float(np.degrees(0.5 * np.ptp(p.angle))),
        "slope of moment over angle [N*m/rad]": lambda p: _moment_slope(p.all_samples),
        "spring less inertia [N*m/rad]": lambda p: stiffness - inertia * p.cut.omega**2,
    }


def _moment_slope(samples: MovingSamples) -> float:
    """Return the slope of moment over angle, with friction fitted by the sign of the motion."""
    columns = [samples.angle, np.ones(len(samples.angle)), np.sign(samples.velocity)]
    return float(np.linalg.lstsq(np.stack(columns, axis=1), samples.torque)[0][0])


@figures.figure(
    "Moment over angle in slow motion",
    "Averaged signals; faint: as measured; darker: later. Red: the spring.",
    axes=("angle of the shaft, deg", "moment at the load cell, N·m"),
    size=(7.2, 4.8),
)
def flap_moment(axes: Axes, points: list[SlowPoint], spring: SpringFit) -> None:
    for each, colour in figures.shaded(points):
        last = slice(each.cut.edges[-2] - each.cut.edges[0], None, 20)
        label = f"{each.point.plan_value('amplitude_deg'):g} deg, {each.point.period:g} s"
        axes.plot(np.degrees(each.angle[last]), each.torque[last], lw=0.4, alpha=0.2, color=colour)
        size = _window_samples(each.point)
        angle, torque = (uniform_filter1d(s, size)[last] for s in (each.angle, each.torque))
        axes.plot(np.degrees(angle), torque, lw=1.0, label=label, color=colour)
    max_angle = max(float(np.abs(each.angle).max()) for each in points)
    x = np.array([-max_angle, max_angle])
    line = spring.stiffness.value * (x - spring.rest_angle.value)
    axes.plot(np.degrees(x), line, "--", color=figures.RED, lw=1.2)
    figures.annotate_corner(axes, str(spring.stiffness), "lower right")
    figures.legend(axes, "upper left")


@figures.figure(
    "Residual of the spring",
    "Cell minus spring and inertia: friction behind the cell changes its sign with the motion.",
    axes=("angle of the shaft, deg", "moment minus spring and inertia, N·m"),
)
def flap_moment_rest(axes: Axes, points: list[SlowPoint], spring: SpringFit) -> None:
    for each, colour in figures.shaded(points):
        angle, _, acceleration, torque, time = each.all_samples
        explained = spring.stiffness.value * (angle - spring.rest_angle.value)
        explained = explained + spring.inertia.value * acceleration + spring.drift.value * time
        some = slice(None, None, max(1, len(angle) // 1500))
        residual = (torque - explained)[some]
        axes.plot(np.degrees(angle[some]), residual, ".", ms=1.5, alpha=0.5, color=colour)
    for sign in (1.0, -1.0):
        axes.axhline(sign * spring.dry_friction.value, color=figures.RED, lw=1.0, ls="--")
    figures.annotate_corner(axes, f"dry friction {spring.dry_friction}", "upper right")
