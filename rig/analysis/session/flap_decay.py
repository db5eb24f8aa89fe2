"""The flap let go: its natural period, and linear, quadratic and dry damping, by its whole motion.

Per inertia, radiation as a memory of second order (h of v = theta', at rest when let go):

    theta'' = -w (theta - theta0) - c v - b |v| v - f sign(v) - r m,    m = s / (s^2 + d s + e) v

The acceleration is fitted where the flap moves fast enough for dry friction to have one sign: for
given d and e that is linear in all else, and d and e are searched. Period and rate of small swings
are those of the slow root of (s^2 + c s + w)(s^2 + d s + e) + r s^2: what the flap does when
neither quadratic nor dry friction matters. Each of c, r, d and e alone is known badly, that root
well. Intervals by leaving out one release at a time.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import bilinear, find_peaks, lfilter, savgol_filter

from rig.analysis.session.estimate import Estimate, Floats, jackknife
from rig.analysis.session.losses import moving

WINDOW, ORDER = 0.15, 5  # s and degree of the polynomials whose derivatives are taken
SLOWEST = 0.1  # share of a release's top speed
STILL = 2e-4  # rad
_SMALL = 1e-4  # of a logarithm, for differences


class Release(NamedTuple):
    """One release while it moves, (samples,) from when the flap was let go."""

    dt: float  # s
    angle: Floats  # rad
    velocity: Floats  # rad/s
    acceleration: Floats  # rad/s^2
    good: Any  # samples that are fitted

    @property
    def time(self) -> Floats:
        """s."""
        out: Floats = np.float64(self.dt) * np.arange(len(self.angle), dtype=np.float64)
        return out


class Fit(NamedTuple):
    """Of the equation above."""

    spring: float  # w, 1/s^2
    linear: float  # c, 1/s
    quadratic: float  # b, 1/rad
    dry: float  # f, rad/s^2
    offset: float  # w theta0, rad/s^2
    gain: float  # r, 1/s^2
    width: float  # d, 1/s
    square: float  # e, 1/s^2


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


class Loss(NamedTuple):
    """A half swing: from one turning point to the next, on the other side."""

    mean: float  # rad, amplitude
    lost: float  # rad


def release(angle: Floats, dt: float) -> Release:
    """A release of angles (rad); ValueError if the flap stays where it was."""
    moves = np.flatnonzero(np.abs(angle - angle[-1]) > STILL)
    if not len(moves):
        raise ValueError("a release that does not move")
    length = min(len(angle), int(moves[-1]) + round(0.5 / dt))
    count = 2 * round(0.5 * WINDOW / dt) + 1
    smooth = [savgol_filter(angle, count, ORDER, deriv=k, delta=dt)[:length] for k in range(3)]
    good = moving(smooth[1], count // 2, SLOWEST) > 0
    good[:count] = False  # the window would see both sides of the release
    return Release(dt, smooth[0], smooth[1], smooth[2], good)


def decay(releases: list[Release]) -> Decay:
    """Fit all releases at once; ValueError for fewer than four, or a flap that does not swing."""
    if len(releases) < 4:
        raise ValueError(f"{len(releases)} releases; a decay needs at least 4")

    def off(x: Floats) -> Floats:
        designs = [_design(each, x) for each in releases]
        out: Floats = np.concatenate(designs) @ _linear(designs, releases) - pulls
        return out

    pulls = np.concatenate([each.acceleration[each.good] for each in releases])
    start = _start(releases)
    solved = least_squares(off, start, bounds=(start - 2.0, start + 2.0), diff_step=1e-5)
    x = solved.x
    designs = [_design(each, x) for each in releases]
    linear = _linear(designs, releases)
    grams, rights = [], []
    for each, design in zip(releases, designs, strict=True):
        bends = [
            (_design(each, x + _SMALL * unit) - design) @ linear / _SMALL for unit in np.eye(2)
        ]
        whole = np.column_stack([design, *bends])
        rest = each.acceleration[each.good] - design @ linear
        grams.append(whole.T @ whole)
        rights.append(whole.T @ rest)
    gram, right = sum(grams), sum(rights)
    unknowns = np.concatenate([linear, x])
    fewer = [
        _told(_fit(unknowns + np.linalg.lstsq(gram - g, right - r, rcond=1e-13)[0]))
        for g, r in zip(grams, rights, strict=True)
    ]
    fit = _fit(unknowns)
    values = _told(fit)
    if not np.isfinite(values).all():
        raise ValueError("the flap does not swing")
    half = jackknife(values, np.array(fewer))
    units = ("s", "1/s", "1", "1/s^2", "s^2/rad", "rad", "rad")
    how = f"acceleration by least squares, jackknife over {len(releases)} releases"
    return Decay(fit, *(
        Estimate(float(v), float(h), u, how) for v, h, u in zip(values, half, units, strict=True)
    ))  # fmt: skip


def _design(of: Release, x: Floats) -> Floats:
    """What the acceleration is linear in, for the logarithms of d and e: (samples, 6)."""
    width, square = np.exp(x)
    v, good = of.velocity, of.good
    memory = lfilter(*bilinear([1.0, 0.0], [1.0, width, square], 1.0 / of.dt), v)
    columns = [-of.angle, -v, -np.abs(v) * v, -np.sign(v), np.ones(len(v)), -memory]
    out: Floats = np.stack(columns, axis=1)[good]
    return out


def _linear(designs: list[Floats], releases: list[Release]) -> Floats:
    """w, c, b, f, w theta0 and r, by least squares."""
    gram = sum(each.T @ each for each in designs)
    right = sum(d.T @ r.acceleration[r.good] for d, r in zip(designs, releases, strict=True))
    scale = 1.0 / np.sqrt(np.diag(gram))
    out: Floats = scale * np.linalg.solve(gram * np.outer(scale, scale), scale * right)
    return out


def _start(releases: list[Release]) -> Floats:
    """Logarithms of a memory some times as quick as the flap swings."""
    turned = [
        float(np.sqrt(-(r.acceleration * r.angle)[r.good].sum() / (r.angle**2)[r.good].sum()))
        for r in releases
    ]
    own = float(np.median(turned))
    return np.log([6.0 * own, 12.0 * own * own])


def _fit(x: Any) -> Fit:
    return Fit(*(float(each) for each in x[:6]), *(float(each) for each in np.exp(x[6:])))


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
        of.quadratic / of.spring, of.dry / of.spring, of.offset / of.spring,
    ])  # fmt: skip


def losses(of: Release, rest: float) -> list[Loss]:
    """Half swings by their turning points, from one side of the angle of rest to the other."""
    angle = of.angle - rest
    turns = [find_peaks(sign * angle, prominence=5.0 * STILL)[0] for sign in (1.0, -1.0)]
    tops = angle[np.sort(np.concatenate(turns))]
    return [
        Loss(float(0.5 * (abs(a) + abs(b))), float(abs(a) - abs(b)))
        for a, b in itertools.pairwise([angle[0], *tops])
        if a * b < 0.0 and abs(a) > abs(b)
    ]


def swing(of: Fit, begin: float, count: int, dt: float) -> Floats:
    """Angles (rad) by the fit, every ``dt`` s, of a flap let go from ``begin``.

    Half-implicit steps, the velocity half a step behind; dry friction holds exactly.
    """
    rest = of.offset / of.spring
    angle, v, memory, h = begin - rest, 0.0, 0.0, 0.0
    out = np.empty(count)
    step = 0.5 * dt
    for k in range(count):
        out[k] = angle + rest
        memory += step * h
        push = v - step * (of.spring * angle + h + (of.linear + of.quadratic * abs(v)) * v)
        after = math.copysign(max(abs(push) - step * of.dry, 0.0), push)
        given = step * (0.5 * of.gain * (after + v) - of.square * memory)
        h = (h + given) / (1.0 + step * of.width)
        v, step = after, dt
        angle += dt * v
    return out
