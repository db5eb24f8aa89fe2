"""The flap let go: its natural period, and linear, quadratic and dry damping, by least squares.

    theta'' = -w0^2 (theta - theta0) - 2 d theta' - b |theta'| theta' - f sign(theta')

The acceleration is fitted where the flap moves fast enough for dry friction to have one sign, from
`SETTLED` on: before that the water still remembers that the flap stood. Of a linear flap w0 and d
are those of its slow pole, radiation memory included. Intervals by leaving out one release at a
time.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import argrelextrema, savgol_filter

from rig.analysis.session.estimate import Estimate, Floats, jackknife

SETTLED = 0.5  # s
WINDOW, ORDER = 0.15, 5  # s and degree of the polynomials whose derivatives are taken
SLOWEST = 0.12  # share of a release's top speed


class Release(NamedTuple):
    """One release, (samples,) from when the flap was let go."""

    dt: float  # s
    angle: Floats  # rad
    velocity: Floats  # rad/s
    acceleration: Floats  # rad/s^2


class Coefficients(NamedTuple):
    """Of the equation above."""

    spring: float  # w0^2, 1/s^2
    linear: float  # 2 d, 1/s
    quadratic: float  # b, 1/rad
    dry: float  # f, rad/s^2
    offset: float  # w0^2 theta0, rad/s^2


class Decay(NamedTuple):
    """What a session of releases says."""

    fitted: Coefficients
    period: Estimate  # s, from peak to peak as it swings out, dry and quadratic damping aside
    rate: Estimate  # d, 1/s
    ratio: Estimate  # d / w0
    quadratic: Estimate  # b, 1/rad
    friction: Estimate  # f / w0^2, rad: how far from rest dry friction can hold it
    spring: Estimate  # w0^2, 1/s^2
    dry: Estimate  # f, rad/s^2
    rest: Estimate  # theta0, rad


class Loss(NamedTuple):
    """A half swing: from one turning point to the next."""

    mean: float  # rad, amplitude
    lost: float  # rad


def release(angle: Floats, dt: float) -> Release:
    """A release with its derivatives, which are those of polynomials in a moving window."""
    count = 2 * round(0.5 * WINDOW / dt) + 1
    smooth = [savgol_filter(angle, count, ORDER, deriv=k, delta=dt) for k in range(3)]
    return Release(dt, *smooth)


def decay(releases: list[Release]) -> Decay:
    """Fit all releases at once; ValueError for fewer than three."""
    if len(releases) < 3:
        raise ValueError(f"{len(releases)} releases; a decay needs at least 3")
    parts = [_normal(each) for each in releases]
    gram, right = (sum(part[k] for part in parts) for k in (0, 1))
    whole = _solved(gram, right)
    fewer = np.array([_told(_solved(gram - g, right - r)) for g, r in parts])
    values = _told(whole)
    half = jackknife(values, fewer)
    units = ("s", "1/s", "1", "1/rad", "rad", "1/s^2", "rad/s^2", "rad")
    how = f"acceleration by least squares, jackknife over {len(releases)} releases"
    return Decay(whole, *(Estimate(float(v), float(h), u, how)
                          for v, h, u in zip(values, half, units, strict=True)))  # fmt: skip


def _normal(of: Release) -> tuple[Floats, Floats]:
    """Normal equations of one release."""
    v = of.velocity
    first = round(SETTLED / of.dt)
    good = np.abs(v) > SLOWEST * np.abs(v).max()
    good[:first] = False
    x = np.stack([-of.angle, -v, -np.abs(v) * v, -np.sign(v), np.ones(len(v))], axis=1)[good]
    return x.T @ x, x.T @ of.acceleration[good]


def _solved(gram: Any, right: Any) -> Coefficients:
    scale = 1.0 / np.sqrt(np.diag(gram))
    found = scale * np.linalg.solve(gram * np.outer(scale, scale), scale * right)
    return Coefficients(*(float(each) for each in found))


def _told(of: Coefficients) -> Floats:
    """In the order of `Decay`; NaN where nothing swings."""
    spring, linear, quadratic, dry, offset = of
    rate = 0.5 * linear
    under = spring - rate * rate
    if under <= 0.0:
        return np.full(8, np.nan)
    swing = math.sqrt(under)
    own = math.sqrt(spring)
    return np.array(
        [2.0 * np.pi / swing, rate, rate / own, quadratic, dry / spring, spring, dry,
         offset / spring]
    )  # fmt: skip


def losses(of: Release, rest: float) -> list[Loss]:
    """Half swings by their turning points, about the angle of rest."""
    angle = of.angle - rest
    turns = np.sort(np.concatenate([
        argrelextrema(angle, np.greater, order=round(0.3 / of.dt))[0],
        argrelextrema(angle, np.less, order=round(0.3 / of.dt))[0],
    ]))  # fmt: skip
    sizes = np.abs(angle[turns[turns > round(SETTLED / of.dt)]])
    return [Loss(float(0.5 * (a + b)), float(a - b)) for a, b in itertools.pairwise(sizes) if a > b]


def expected_loss(of: Coefficients, mean: Floats) -> Floats:
    """What a half swing loses by the fit: the energy that damping takes from a cosine, rad."""
    own = math.sqrt(of.spring)
    out: Floats = (
        0.5 * np.pi * of.linear / own * mean
        + 4.0 / 3.0 * of.quadratic * mean * mean
        + 2.0 * of.dry / of.spring
    )
    return out


def swing(of: Coefficients, begin: Release) -> tuple[Floats, Floats]:
    """Time (s) and angle (rad) by the fit, from where a release stands when it has settled."""
    first = round(SETTLED / begin.dt)
    spring, linear, quadratic, dry, offset = of

    def motion(_: float, y: Floats) -> list[float]:
        angle, v = y
        push = offset - spring * angle - linear * v - quadratic * abs(v) * v
        rub = dry * math.tanh(v / 1e-3)
        return [v, push - rub]

    last = begin.dt * (len(begin.angle) - 1)
    t = np.arange(first * begin.dt, last, 0.02)
    state = [float(begin.angle[first]), float(begin.velocity[first])]
    solved = solve_ivp(motion, (t[0], t[-1]), state, t_eval=t, method="LSODA", rtol=1e-6)
    return solved.t, solved.y[0]
