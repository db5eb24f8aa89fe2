"""The motor as a damper of the flap in waves: power over damping, and the best damping.

Between flap and load cell the motor is a load R + i X. A flap of intrinsic impedance Z under a
moment F gives it the power

    P = |F|^2 R / (2 |Z + i X + R|^2) = a R / (R^2 + 2 b R + c^2)

so a fit of a, b = Re Z and c = |Z + i X| over the measured R finds the best damping, c, and its
power a / (2 (b + c)): equation 2.2 of the OSWEC thesis (University of Washington), with the
frequency omega where the velocity is printed, the motor's own inertia in it. Where the loop's delay
lets X grow with R, k R, the form is the same and c = |Z| / sqrt(1 + k^2). R is what the load
cell and the shaft say, friction of the gearbox included, not what was asked. Intervals by leaving
out one damping at a time.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from rig.analysis.session import periods
from rig.analysis.session.estimate import Estimate, Floats, jackknife, mean
from rig.analysis.session.periods import Cut

LEAST = 5
"""Dampings, for a fit of three unknowns."""


class Taken(NamedTuple):
    """One set point."""

    damping: float  # N*m*s/rad, R by the fundamentals of torque and velocity at the cell
    reactance: float  # N*m*s/rad, X
    power: Estimate  # W, taken out of the flap, by scatter of the periods
    motor: Estimate  # W, of that what reaches the motor's shaft
    amplitude: float  # rad, of the flap


class Best(NamedTuple):
    """The fit."""

    unknowns: Floats  # a, b, c
    damping: Estimate  # N*m*s/rad
    power: Estimate  # W


def taken(
    shaft: Floats, motor: Floats, torque: Floats, motor_torque: Floats, of: Cut, window: float
) -> Taken:
    """Angles (rad) and torques (N*m, positive as the motor's on the flap), as measured."""
    here = slice(of.edges[0], of.edges[-1])
    speeds = [periods.velocity(each, of.dt, window)[here] for each in (shaft, motor)]
    torques = [torque[here], motor_torque[here]]
    powers = []
    for speed, pull, said in zip(speeds, torques, ("cell", "motor"), strict=True):
        each = [-float(np.mean(part)) for part in periods.pieces(speed * pull, of)]
        powers.append(mean(each, "W", f"at the {said}, {of.whole} periods by their scatter"))
    ratio = -(
        periods.fundamentals(torques[0], of).mean() / periods.fundamentals(speeds[0], of).mean()
    )
    swing = abs(periods.fundamentals(periods.detrended(shaft, of), of).mean())
    return Taken(float(ratio.real), float(ratio.imag), powers[0], powers[1], float(swing))


def expected_power(unknowns: Floats, damping: Floats) -> Floats:
    """Power by the fit, W."""
    a, b, c = unknowns
    out: Floats = a * damping / (damping * damping + 2.0 * b * damping + c * c)
    return out


def best(points: list[Taken]) -> Best | None:
    """The fit over dampings in one sea; None for fewer than `LEAST` of them."""
    if len(points) < LEAST:
        return None
    damping = np.array([each.damping for each in points])
    power = np.array([each.power.value for each in points])
    top = int(np.argmax(power))
    start = np.array([3.0 * power[top] * damping[top], 0.5 * damping[top], damping[top]])
    unknowns = _fit(damping, power, start)
    whole = _told(unknowns)
    everyone = np.arange(len(points))
    fewer = np.array([
        _told(_fit(damping[everyone != i], power[everyone != i], unknowns)) for i in everyone
    ])  # fmt: skip
    half = jackknife(whole, fewer)
    how = f"power of a damper through {len(points)} dampings, jackknife over them"
    return Best(
        unknowns,
        Estimate(float(whole[0]), float(half[0]), "N*m*s/rad", how),
        Estimate(float(whole[1]), float(half[1]), "W", how),
    )


def _fit(damping: Floats, power: Floats, start: Floats) -> Floats:
    size = float(power.max())
    solved = least_squares(
        lambda x: (expected_power(x, damping) - power) / size,
        start,
        bounds=([0.0, 0.0, 1e-6], [np.inf, np.inf, np.inf]),
        x_scale="jac",
    )
    out: Floats = solved.x
    return out


def _told(unknowns: Floats) -> Floats:
    a, b, c = unknowns
    return np.array([c, a / (2.0 * (b + c))])
