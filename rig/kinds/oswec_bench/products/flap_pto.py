"""The motor as a damper of the flap in waves: power over damping, and the optimal damping.

Between flap and load cell the motor is a load R + i X. A flap of intrinsic impedance Z under a
moment F delivers to it the power

    P = |F|^2 R / (2 |Z + i X + R|^2) = a R / (R^2 + 2 b R + c^2)

so a fit of a, b = Re Z and c = |Z + i X| over the measured R gives the optimal damping, c, and its
power a / (2 (b + c)): equation 2.2 of the OSWEC thesis (University of Washington), with the
frequency omega where the thesis prints the velocity, and including the motor's own inertia. If the
loop's delay makes X grow with R, as k R, the form is the same and c = |Z| / sqrt(1 + k^2). R is
measured by load cell and shaft, friction of the gearbox included; it is not the requested damping.
Intervals are by leaving out one damping at a time.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from rig.kinds.oswec_bench.products import periods
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, jackknife, mean
from rig.kinds.oswec_bench.products.periods import PeriodCut

MIN_DAMPINGS = 5
"""Minimum number of dampings for a fit of three unknowns."""


class PtoPoint(NamedTuple):
    """Results of one set point."""

    damping: float  # N*m*s/rad, R by the fundamentals of torque and velocity at the cell
    reactance: float  # N*m*s/rad, X
    power: Estimate  # W, absorbed from the flap, interval by scatter of the periods
    motor_power: Estimate  # W, part of it that reaches the motor's shaft
    amplitude: float  # rad, of the flap's motion


class OptimalDamping(NamedTuple):
    """Results of the fit."""

    unknowns: Floats  # a, b, c
    damping: Estimate  # N*m*s/rad
    power: Estimate  # W


def pto_point(
    shaft: Floats,
    motor: Floats,
    torque: Floats,
    motor_torque: Floats,
    cut: PeriodCut,
    window: float,
) -> PtoPoint:
    """Return the results of a set point.

    Angles (rad) and torques (N*m, positive as the motor's on the flap) are as measured.
    """
    trimmed = slice(cut.edges[0], cut.edges[-1])
    velocities = [
        periods.velocity(period_powers, cut.dt, window)[trimmed] for period_powers in (shaft, motor)
    ]
    torques = [torque[trimmed], motor_torque[trimmed]]
    powers = []
    for speed, torque_signal, place in zip(velocities, torques, ("cell", "motor"), strict=True):
        period_powers = [
            -float(np.mean(part)) for part in periods.split_periods(speed * torque_signal, cut)
        ]
        powers.append(
            mean(period_powers, "W", f"at the {place}, {cut.period_count} periods by their scatter")
        )
    ratio = -(
        periods.fundamentals(torques[0], cut).mean()
        / periods.fundamentals(velocities[0], cut).mean()
    )
    amplitude = abs(periods.fundamentals(periods.detrend(shaft, cut), cut).mean())
    return PtoPoint(float(ratio.real), float(ratio.imag), powers[0], powers[1], float(amplitude))


def expected_power(unknowns: Floats, damping: Floats) -> Floats:
    """Return the power by the fit, W."""
    a, b, c = unknowns
    power: Floats = a * damping / (damping * damping + 2.0 * b * damping + c * c)
    return power


def optimal_damping(points: list[PtoPoint]) -> OptimalDamping | None:
    """Return the fit over dampings in one sea; None for fewer than `MIN_DAMPINGS`."""
    if len(points) < MIN_DAMPINGS:
        return None
    damping = np.array([each.damping for each in points])
    power = np.array([each.power.value for each in points])
    largest = int(np.argmax(power))
    start = np.array(
        [3.0 * power[largest] * damping[largest], 0.5 * damping[largest], damping[largest]]
    )
    unknowns = _fit_unknowns(damping, power, start)
    values = _optimum(unknowns)
    indices = np.arange(len(points))
    leave_one_out = np.array(
        [
            _optimum(_fit_unknowns(damping[indices != i], power[indices != i], unknowns))
            for i in indices
        ]
    )
    half_widths = jackknife(values, leave_one_out)
    method = f"power of a damper through {len(points)} dampings, jackknife over them"
    return OptimalDamping(
        unknowns,
        Estimate(float(values[0]), float(half_widths[0]), "N*m*s/rad", method),
        Estimate(float(values[1]), float(half_widths[1]), "W", method),
    )


def _fit_unknowns(damping: Floats, power: Floats, start: Floats) -> Floats:
    max_power = float(power.max())
    solved = least_squares(
        lambda x: (expected_power(x, damping) - power) / max_power,
        start,
        bounds=([0.0, 0.0, 1e-6], [np.inf, np.inf, np.inf]),
        x_scale="jac",
    )
    unknowns: Floats = solved.x
    return unknowns


def _optimum(unknowns: Floats) -> Floats:
    a, b, c = unknowns
    return np.array([c, a / (2.0 * (b + c))])
