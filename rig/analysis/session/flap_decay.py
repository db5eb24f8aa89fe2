"""The flap let go: its natural period, and linear, quadratic and dry damping, by its whole motion.

Per inertia, radiation as a memory of second order (h of v = theta', at rest when let go):

    theta'' = -w (theta - theta0) - c v - b |v| v - f sign(v) - h,    h = r s / (s^2 + d s + e) v

is integrated and fitted to the angles of all releases at once, by least squares. The small swings'
period and rate are those of the slow root of (s^2 + c s + w)(s^2 + d s + e) + r s^2: what the flap
does when neither quadratic nor dry friction matters. Each of r, d and e alone is known badly, that
root well. Intervals by leaving out one release at a time.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import argrelextrema

from rig.analysis.session.estimate import Estimate, Floats, jackknife

STEP = 0.002  # s, of the integration
SPARSE = 10  # steps between compared angles
_SMALL = 1e-5  # of a logarithm, for differences


class Release(NamedTuple):
    """One release, (samples,) every `STEP` * `SPARSE` seconds from when the flap was let go."""

    angle: Floats  # rad

    @property
    def time(self) -> Floats:
        """s."""
        out: Floats = SPARSE * STEP * np.arange(len(self.angle))
        return out


class Fit(NamedTuple):
    """Of the equation above."""

    spring: float  # w, 1/s^2
    linear: float  # c, 1/s
    quadratic: float  # b, 1/rad
    dry: float  # f, rad/s^2
    gain: float  # r, 1/s^2
    width: float  # d, 1/s
    square: float  # e, 1/s^2
    rest: float  # theta0, rad


class Decay(NamedTuple):
    """What a session of releases says."""

    fit: Fit
    period: Estimate  # s, of small swings
    rate: Estimate  # 1/s, at which small swings die out
    ratio: Estimate  # of it to the natural frequency
    natural: Estimate  # 1/s^2, square of the natural frequency
    quadratic: Estimate  # b / w, s^2/rad: over the spring
    friction: Estimate  # f / w, rad: how far from rest dry friction can hold it
    rest: Estimate  # rad
    off: float  # rad, root mean square of measured less fitted angle


class Loss(NamedTuple):
    """A half swing: from one turning point to the next, on the other side."""

    mean: float  # rad, amplitude
    lost: float  # rad


def release(angle: Floats, dt: float, age: float) -> Release:
    """A release of angles (rad) that were ``age`` s old when read; its first is that of the hold."""
    last = dt * (len(angle) - 1) - age
    t = np.arange(0.0, last, SPARSE * STEP)
    return Release(np.interp(t + age, dt * np.arange(len(angle)), angle))


def decay(releases: list[Release]) -> Decay:
    """Fit all releases at once; ValueError for fewer than four, or none that swings."""
    if len(releases) < 4:
        raise ValueError(f"{len(releases)} releases; a decay needs at least 4")
    least = min(len(each.angle) for each in releases)
    angles = np.array([each.angle[:least] for each in releases])

    def off(x: Floats) -> Floats:
        return (_angles(x[None], angles)[0] - angles).ravel()

    def slopes(x: Floats) -> Floats:
        moved = np.concatenate([x[None], x + _SMALL * np.eye(len(x))])
        found = _angles(moved, angles)
        each: Floats = ((found[1:] - found[0]) / _SMALL).reshape(len(x), -1).T
        return each

    solved = least_squares(off, _start(angles), jac=slopes, x_scale=1.0, max_nfev=60)
    jacobian = slopes(solved.x).reshape(*angles.shape, -1)
    rest = off(solved.x).reshape(angles.shape)
    grams = np.einsum("ijk,ijl->ikl", jacobian, jacobian)
    rights = np.einsum("ijk,ij->ik", jacobian, rest)
    gram, right = grams.sum(axis=0), rights.sum(axis=0)
    fewer = np.array([
        _told(_fit(solved.x - np.linalg.lstsq(gram - g, right - r, rcond=1e-12)[0]))
        for g, r in zip(grams, rights, strict=True)
    ])  # fmt: skip
    fit = _fit(solved.x)
    values = _told(fit)
    half = jackknife(values, fewer)
    if not np.isfinite(values).all():
        raise ValueError("the flap does not swing")
    units = ("s", "1/s", "1", "1/s^2", "s^2/rad", "rad", "rad")
    how = f"motion by least squares, jackknife over {len(releases)} releases"
    estimates = (
        Estimate(float(v), float(h), u, how) for v, h, u in zip(values, half, units, strict=True)
    )
    return Decay(fit, *estimates, float(np.sqrt(np.mean(rest * rest))))


def _fit(x: Any) -> Fit:
    """Unknowns as they are solved for (logarithms, the angle of rest in 1/100 rad) as the fit."""
    return Fit(*(float(each) for each in np.exp(x[:-1])), float(0.01 * x[-1]))


def _start(angles: Floats) -> Floats:
    """A flap that swings as often as the largest release crosses its rest."""
    largest = angles[np.argmax(np.abs(angles[:, 0]))]
    rest = float(angles[:, -1].mean())
    crossed = np.flatnonzero(np.diff(np.sign(largest - rest)))
    quarter = SPARSE * STEP * float(crossed[0] + 1) if len(crossed) else 1.0
    own = 0.5 * np.pi / quarter
    unknowns = [2.0 * own**2, 0.1 * own, 0.3, 0.01 * own**2, 10.0 * own**2, 6.0 * own, 12.0 * own**2]
    return np.array([*np.log(unknowns), 100.0 * rest])


def _angles(x: Floats, like: Floats) -> Floats:
    """Angles of all releases for several sets of unknowns (sets, 8): (sets, releases, samples).

    Half-implicit steps; dry friction holds exactly.
    """
    spring, linear, quadratic, dry, gain, width, square = np.exp(x[:, :-1]).T[:, :, None]
    rest = 0.01 * x[:, -1:]
    angle = like[None, :, 0] - rest
    v, memory, h = (np.zeros_like(angle) for _ in range(3))
    out = np.empty((len(x), *like.shape))
    out[:, :, 0] = angle + rest
    # Half a step less: velocities stand between the angles.
    dt = 0.5 * STEP
    for k in range(1, (like.shape[1] - 1) * SPARSE + 1):
        memory = memory + dt * h
        push = v - dt * (spring * angle + h) - dt * (linear + quadratic * np.abs(v)) * v
        after = np.sign(push) * np.maximum(np.abs(push) - dt * dry, 0.0)
        h = (h + gain * (after - v) - dt * square * memory) / (1.0 + dt * width)
        v = after
        dt = STEP
        angle = angle + dt * v
        if k % SPARSE == 0:
            out[:, :, k // SPARSE] = angle + rest
    return out


def root(of: Fit) -> complex:
    """The slow root that swings, 1/s; NaN where none does."""
    own = np.polymul([1.0, of.linear, of.spring], [1.0, of.width, of.square])
    found = np.roots(np.polyadd(own, [of.gain, 0.0, 0.0]))
    found = found[found.imag > 0.0]
    return complex(found[np.argmin(np.abs(found))]) if len(found) else complex(math.nan, math.nan)


def _told(of: Fit) -> Floats:
    """In the order of `Decay`."""
    slow = root(of)
    own = abs(slow)
    return np.array([
        2.0 * math.pi / slow.imag, -slow.real, -slow.real / own, own * own,
        of.quadratic / of.spring, of.dry / of.spring, of.rest,
    ])  # fmt: skip


def losses(of: Release, rest: float) -> list[Loss]:
    """Half swings by their turning points, from one side of the angle of rest to the other."""
    angle = of.angle - rest
    near = round(0.3 / (SPARSE * STEP))
    turns = [argrelextrema(angle, compare, order=near)[0] for compare in (np.greater, np.less)]
    tops = angle[np.sort(np.concatenate(turns))]
    return [
        Loss(float(0.5 * (abs(a) + abs(b))), float(abs(a) - abs(b)))
        for a, b in itertools.pairwise([angle[0], *tops])
        if a * b < 0.0 and abs(a) > abs(b)
    ]


def expected_loss(of: Decay, mean: Floats) -> Floats:
    """What a half swing loses by the fit: the energy that damping takes from a cosine, rad."""
    natural = of.natural.value
    out: Floats = (
        np.pi * of.ratio.value * mean
        + 4.0 / 3.0 * natural * of.quadratic.value * mean * mean
        + 2.0 * of.friction.value
    )
    return out


def swing(of: Fit, like: Release) -> Floats:
    """Angles by the fit at the times of a release, rad."""
    x = np.array([*np.log(of[:-1]), 100.0 * of.rest])
    out: Floats = _angles(x[None], like.angle[None])[0, 0]
    return out
