"""The free decay session of the flap: natural period, and linear, quadratic and dry damping, from
the whole motion.

Equation of motion per inertia, with radiation as a memory of second order (h of v = theta', at rest
at the release):

    theta'' = -w (theta - theta0) - c v - b |v| v - f sign(v) - r m,    m = s / (s^2 + d s + e) v

The acceleration is fitted where the flap moves fast enough for dry friction to have one sign. For
given d and e the model is linear in all other coefficients; d and e are searched. Period and rate
of small swings are those of the slow root of (s^2 + c s + w)(s^2 + d s + e) + r s^2: the motion
without quadratic and dry friction. The individual values of c, r, d and e are poorly determined,
that root is determined well. Intervals are by leaving out one release at a time.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import least_squares
from scipy.signal import bilinear, find_peaks, lfilter, savgol_filter

from rig.kinds.oswec_bench.products import figures
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, jackknifed, solve_groups
from rig.kinds.oswec_bench.products.periods import moving_samples
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import Columns, Result, compare, table

WINDOW, ORDER = 0.15, 5  # s and degree of the polynomials whose derivatives are taken
MIN_SPEED_SHARE = 0.1  # share of a release's top speed
STILL_ANGLE = 2e-4  # rad
_LOG_STEP = 1e-4  # step of a logarithm for numerical derivatives


class Release(NamedTuple):
    """One release during its motion, (samples,) from the moment of release."""

    dt: float  # s
    angle: Floats  # rad
    velocity: Floats  # rad/s
    acceleration: Floats  # rad/s^2
    fitted_samples: Any  # mask of the fitted samples

    @property
    def time(self) -> Floats:
        """Time since the release, s."""
        return self.dt * np.arange(len(self.angle), dtype=np.float64)


class Fit(NamedTuple):
    """Coefficients of the equation of motion above."""

    spring: float  # w, 1/s^2
    linear: float  # c, 1/s
    quadratic: float  # b, 1/rad
    dry_friction: float  # f, rad/s^2
    offset: float  # w theta0, rad/s^2
    memory_gain: float  # r, 1/s^2
    memory_damping: float  # d, 1/s
    memory_stiffness: float  # e, 1/s^2


class Decay(NamedTuple):
    """Results of a session of releases."""

    fit: Fit
    period: Estimate  # s, of small swings
    decay_rate: Estimate  # 1/s, decay rate of small swings
    damping_ratio: Estimate  # decay rate over natural frequency
    natural_squared: Estimate  # 1/s^2, square of the natural frequency
    quadratic: Estimate  # b / w, s^2/rad, per spring rate
    friction: Estimate  # f / w, rad: largest angle from rest at which dry friction holds the flap
    rest_angle: Estimate  # rad


def prepare_release(angle: Floats, dt: float) -> Release:
    """Return a release of angles (rad); ValueError if the flap does not move."""
    moves = np.flatnonzero(np.abs(angle - angle[-1]) > STILL_ANGLE)
    if not len(moves):
        raise ValueError("the flap does not move after the release")
    length = min(len(angle), int(moves[-1]) + round(0.5 / dt))
    window_samples = 2 * round(0.5 * WINDOW / dt) + 1
    smooth, velocity, acceleration = (
        savgol_filter(angle, window_samples, ORDER, deriv=k, delta=dt)[:length] for k in range(3)
    )
    fitted_samples = moving_samples(velocity, window_samples // 2, MIN_SPEED_SHARE) > 0
    fitted_samples[:window_samples] = False  # the window would contain both sides of the release
    return Release(dt, smooth, velocity, acceleration, fitted_samples)


def fit_decay(releases: list[Release]) -> Decay:
    """Fit all releases together; ValueError for fewer than four, or a flap that does not swing."""
    if len(releases) < 4:
        raise ValueError(f"{len(releases)} releases; a decay needs at least 4")

    def residuals(logs: Floats) -> Floats:
        designs = [_design_matrix(each, logs) for each in releases]
        linear = _linear_coefficients(designs, releases)
        out: Floats = np.concatenate(designs) @ linear - accelerations
        return out

    accelerations = np.concatenate([each.acceleration[each.fitted_samples] for each in releases])
    start_logs = _start_logs(releases)
    solved = least_squares(
        residuals, start_logs, bounds=(start_logs - 2.0, start_logs + 2.0), diff_step=1e-5
    )
    logs = solved.x
    designs = [_design_matrix(each, logs) for each in releases]
    linear = _linear_coefficients(designs, releases)
    groups = []
    for each, design in zip(releases, designs, strict=True):
        log_derivatives = [
            (_design_matrix(each, logs + _LOG_STEP * unit) - design) @ linear / _LOG_STEP
            for unit in np.eye(2)
        ]
        residual = each.acceleration[each.fitted_samples] - design @ linear
        groups.append((np.column_stack([design, *log_derivatives]), residual))
    unknowns = np.concatenate([linear, logs])
    _, *changes = solve_groups(groups, lambda g, r: np.linalg.lstsq(g, r, rcond=1e-13)[0])
    leave_one_out = [_derived_quantities(_fit_from_unknowns(unknowns + each)) for each in changes]
    fit = _fit_from_unknowns(unknowns)
    values = _derived_quantities(fit)
    if not np.isfinite(values).all():
        raise ValueError("the flap does not swing")
    units = ("s", "1/s", "1", "1/s^2", "s^2/rad", "rad", "rad")
    method = f"acceleration by least squares, jackknife over {len(releases)} releases"
    return Decay(fit, *jackknifed(values, leave_one_out, units, method))


def _design_matrix(release: Release, logs: Floats) -> Floats:
    """Return the design matrix of the acceleration, (samples, 6), for the logarithms of d and e."""
    memory_damping, memory_stiffness = np.exp(logs)
    v, fitted_samples = release.velocity, release.fitted_samples
    memory = lfilter(
        *bilinear([1.0, 0.0], [1.0, memory_damping, memory_stiffness], 1.0 / release.dt), v
    )
    columns = [-release.angle, -v, -np.abs(v) * v, -np.sign(v), np.ones(len(v)), -memory]
    design: Floats = np.stack(columns, axis=1)[fitted_samples]
    return design


def _linear_coefficients(designs: list[Floats], releases: list[Release]) -> Floats:
    """Return w, c, b, f, w theta0 and r by least squares."""
    accelerations = [each.acceleration[each.fitted_samples] for each in releases]
    coefficients: Floats
    coefficients, *_ = solve_groups(list(zip(designs, accelerations, strict=True)), np.linalg.solve)
    return coefficients


def _start_logs(releases: list[Release]) -> Floats:
    """Return logarithms of a memory several times faster than the flap's swing."""
    squares = [
        -(r.acceleration * r.angle)[r.fitted_samples].sum() / (r.angle**2)[r.fitted_samples].sum()
        for r in releases
    ]
    natural_frequency = float(np.median(np.sqrt(squares)))
    return np.log([6.0 * natural_frequency, 12.0 * natural_frequency * natural_frequency])


def _fit_from_unknowns(x: Any) -> Fit:
    return Fit(*(float(each) for each in x[:6]), *(float(each) for each in np.exp(x[6:])))


def swinging_root(fit: Fit) -> complex:
    """Return the slow oscillatory root, 1/s; NaN if there is none."""
    body = np.polymul(
        [1.0, fit.linear, fit.spring], [1.0, fit.memory_damping, fit.memory_stiffness]
    )
    roots = np.roots(np.polyadd(body, [fit.memory_gain, 0.0, 0.0]))
    roots = roots[roots.imag > 0.0]
    return complex(roots[np.argmin(np.abs(roots))]) if len(roots) else complex(math.nan, math.nan)


def _derived_quantities(fit: Fit) -> Floats:
    """Return period to rest angle, in the order of `Decay`."""
    root = swinging_root(fit)
    natural_frequency = abs(root)
    return np.array(
        [
            2.0 * math.pi / root.imag,
            -root.real,
            -root.real / natural_frequency,
            natural_frequency * natural_frequency,
            fit.quadratic / fit.spring,
            fit.dry_friction / fit.spring,
            fit.offset / fit.spring,
        ]
    )


def half_swing_losses(release: Release, rest_angle: float) -> Floats:
    """Return mean amplitude and amplitude loss (rad) of the half swings, (half swings, 2).

    A half swing is from one turning point to the next on the other side of the rest angle.
    """
    angle = release.angle - rest_angle
    turning_points = [
        find_peaks(sign * angle, prominence=5.0 * STILL_ANGLE)[0] for sign in (1.0, -1.0)
    ]
    extremes = angle[np.sort(np.concatenate(turning_points))]
    losses = [
        (0.5 * (abs(a) + abs(b)), abs(a) - abs(b))
        for a, b in itertools.pairwise([angle[0], *extremes])
        if a * b < 0.0 and abs(a) > abs(b)
    ]
    return np.array(losses).reshape(-1, 2)


def simulate_release(fit: Fit, start_angle: float, count: int, dt: float) -> Floats:
    """Return angles (rad) of the fitted flap, every ``dt`` s, after a release at ``start_angle``.

    Steps are half-implicit, with the velocity half a step behind; dry friction holds the flap
    exactly.
    """
    rest_angle = fit.offset / fit.spring
    angle, v, memory, memory_rate = start_angle - rest_angle, 0.0, 0.0, 0.0
    angles = np.empty(count)
    step = 0.5 * dt
    for k in range(count):
        angles[k] = angle + rest_angle
        memory += step * memory_rate
        velocity_without_friction = v - step * (
            fit.spring * angle + memory_rate + (fit.linear + fit.quadratic * abs(v)) * v
        )
        next_velocity = math.copysign(
            max(abs(velocity_without_friction) - step * fit.dry_friction, 0.0),
            velocity_without_friction,
        )
        memory_input = step * (
            0.5 * fit.memory_gain * (next_velocity + v) - fit.memory_stiffness * memory
        )
        memory_rate = (memory_rate + memory_input) / (1.0 + step * fit.memory_damping)
        v, step = next_velocity, dt
        angle += dt * v
    return angles


def simulated(fit: Fit, release: Release) -> Release:
    """Return a release with the angles of the fitted flap."""
    start_angle, count = float(release.angle[0]), len(release.angle)
    return release._replace(angle=simulate_release(fit, start_angle, count, release.dt))


class MeasuredRelease(NamedTuple):
    """A release as measured."""

    point: SetpointData
    release: Release
    losses: Floats  # of its half swings


def analyse_session(session: SessionRun, stiffness: Estimate | None = None) -> Result:
    """Analyse a run; with the flap's ``stiffness`` (N*m/rad) the result contains moments, too."""
    points = session.complete_points
    releases = [prepare_release(point.shaft, point.dt) for point in points]
    decay = fit_decay(releases)
    measured = [
        MeasuredRelease(point, each, half_swing_losses(each, decay.rest_angle.value))
        for point, each in zip(points, releases, strict=True)
    ]
    facts = {
        "flap_natural_period": ("natural period of small swings", decay.period),
        "flap_decay_rate": ("decay rate of small swings", decay.decay_rate),
        "flap_damping_ratio": ("damping ratio, linear", decay.damping_ratio),
        "flap_quadratic_over_spring": ("quadratic damping over spring", decay.quadratic),
        "flap_friction_angle": ("dry friction over spring", decay.friction),
    }
    notes = [
        "The flap alone, with its rigid coupling removed; added inertia and radiation are those "
        "at its natural period. Dry friction is that of bearings and seals.",
    ]
    if stiffness is None:
        notes.append("No moments: there is no analysed flap_hydrostatic run in the same folder.")
    else:
        facts |= _moments(decay, stiffness)
    return Result(
        (table("flap_releases", "Releases", measured, COLUMNS),),
        tuple(compare(label, each, "not run") for label, each in facts.values()),
        {name: each for name, (_, each) in facts.items()},
        (flap_decay(measured, decay), flap_extinction(measured, decay)),
        tuple(notes),
    )


def _moments(decay: Decay, stiffness: Estimate) -> dict[str, tuple[str, Estimate]]:
    """Return inertia and damping by the spring rate.

    Inertia and linear damping include radiation.
    """

    def scaled(factor: float, unit: str, *shares: Estimate) -> Estimate:
        relative = [each.uncertainty / each.value for each in (stiffness, *shares)]
        value = factor * stiffness.value
        method = f"{shares[0].method}; spring {stiffness.method}"
        return Estimate(value, abs(value) * float(np.linalg.norm(relative)), unit, method)

    natural, rate, dry = decay.natural_squared, decay.decay_rate, decay.friction
    inertia = scaled(1.0 / natural.value, "kg*m^2", natural)
    quadratic = scaled(decay.quadratic.value, "N*m*s^2/rad^2", decay.quadratic)
    linear = scaled(2.0 * rate.value / natural.value, "N*m*s/rad", rate, natural)
    return {
        "flap_inertia": ("inertia with added inertia", inertia),
        "flap_linear_damping": ("linear damping, radiation included", linear),
        "flap_quadratic_damping": ("quadratic damping", quadratic),
        "flap_dry_friction": ("dry friction", scaled(dry.value, "N*m", dry)),
    }


COLUMNS: Columns[MeasuredRelease] = {
    "row": lambda r: r.point.row,
    "released at [deg]": lambda r: r.point.plan_value("release_deg"),
    "measured start [deg]": lambda r: float(np.degrees(r.release.angle[0])),
    "half swings": lambda r: len(r.losses),
    "rest angle [deg]": lambda r: float(np.degrees(r.release.angle[-1])),
}


@figures.figure(
    "Free decay of the flap",
    "Blue: measured; red: the fit, integrated.",
    axes=("time since the release, s", "angle, deg"),
    size=(7.6, 4.8),
)
def flap_decay(axes: Axes, releases: list[MeasuredRelease], decay: Decay) -> None:
    for _, release, _ in releases:
        axes.plot(release.time, np.degrees(release.angle), color=figures.BLUE, lw=1.8)
        fitted = simulated(decay.fit, release)
        axes.plot(release.time, np.degrees(fitted.angle), "--", color=figures.RED, lw=0.9)
    axes.set_xlim(0.0, None)
    lines = (
        f"natural period {decay.period}",
        f"damping ratio {decay.damping_ratio}",
        f"quadratic damping over spring {decay.quadratic}",
        f"friction holds within {decay.friction.scaled(180.0 / np.pi, 'deg')}",
    )
    figures.annotate_corner(axes, "\n".join(lines), "upper right")


@figures.figure(
    "Amplitude loss of half a swing over its amplitude",
    "Points: turning points of each release; red: those of the fit.",
    axes=("mean amplitude of half a swing, deg", "amplitude loss, deg"),
    size=(7.2, 4.6),
)
def flap_extinction(axes: Axes, releases: list[MeasuredRelease], decay: Decay) -> None:
    for (point, release, measured), colour in figures.shaded(releases):
        fitted = half_swing_losses(simulated(decay.fit, release), decay.rest_angle.value)
        if len(measured) and len(fitted):
            label = f"{point.plan_value('release_deg'):g} deg"
            axes.plot(*np.degrees(measured).T, "o", ms=6, color=colour, label=label)
            axes.plot(*np.degrees(fitted).T, "+", ms=10, color=figures.RED)
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, None)
    figures.legend(axes, title="released at")
