"""Losses of the driveline: behind the load cell by its torque, before it by the motor's current.

    T_cell            = c+ [v > 0] - c- [v < 0] + b v + J a + z t + z' t^2
    K i - T_cell      = (d + s |T_cell|) sign(v) + b' v + J' a

The acceleration separates inertia. The time t since the tare separates a difference between
directions from a drift of the cell's zero: the zero was correct at the tare, and the bearing does
not change. The first equation describes the bearing and, if present, the seal (OSWEC thesis,
section 3.2.2 and chapter 4); the second the motor and its gearbox. Intervals are by leaving out one
group of samples (a set point, or a period if there are few set points) at a time.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter1d

from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, jackknife

MIN_GROUPS = 4


class MovingSamples(NamedTuple):
    """A group of samples of a moving driveline, (samples,)."""

    velocity: Floats  # rad/s
    acceleration: Floats  # rad/s^2
    torque: Floats  # N*m, of the load cell
    current: Floats  # A, of the motor
    time: Floats  # s since the tare


class LossesBehindCell(NamedTuple):
    """Losses behind the load cell."""

    positive: Estimate  # N*m, dry, rotation to positive angles
    negative: Estimate  # N*m, dry, opposite rotation
    viscous: Estimate  # N*m*s/rad
    inertia: Estimate  # kg*m^2
    drift: Estimate  # N*m, of the cell's zero from the tare to the last sample
    drift_curvature: Estimate  # N*m, four times the drift's lag behind a straight line at half time


class LossesBeforeCell(NamedTuple):
    """Losses before the load cell."""

    dry: Estimate  # N*m
    share: Estimate  # share of the load; NaN if the load hardly varies
    viscous: Estimate  # N*m*s/rad
    inertia: Estimate  # kg*m^2


def moving_samples(velocity: Floats, guard_samples: int, min_share: float = 0.12) -> Floats:
    """Return a mask of samples faster than a share of the top speed, with ``guard_samples`` on each
    side.
    """
    fast = np.abs(velocity) > min_share * np.abs(velocity).max()
    steady = fast & (np.sign(velocity) == np.sign(np.roll(velocity, 1)))
    moving: Floats = minimum_filter1d(steady, 2 * guard_samples + 1)
    return moving


def _solve_with_leave_one_out(grams: Floats, right_sides: Floats) -> Floats:
    """Return least squares of the sum of all groups, and without each: (groups + 1, unknowns)."""
    gram, right = grams.sum(axis=0), right_sides.sum(axis=0)
    systems = [
        (gram, right),
        *((gram - g, right - r) for g, r in zip(grams, right_sides, strict=True)),
    ]
    return np.array([np.linalg.lstsq(g, r, rcond=1e-12)[0] for g, r in systems])


def _fit_groups(
    groups: list[tuple[Floats, Floats]], units: tuple[str, ...], group_name: str
) -> list[Estimate]:
    """Return coefficients of design (samples, unknowns) and value (samples,), group by group."""
    scale = np.sqrt(sum((x * x).sum(axis=0) for x, _ in groups))
    scale = np.where(scale > 0.0, scale, 1.0)
    grams = np.array([(x / scale).T @ (x / scale) for x, _ in groups])
    right_sides = np.array([(x / scale).T @ y for x, y in groups])
    solutions = _solve_with_leave_one_out(grams, right_sides) / scale
    half_widths = jackknife(solutions[0], solutions[1:])
    method = f"least squares, jackknife over {len(groups)} {group_name}"
    return [
        Estimate(float(value), float(width), unit, method)
        for value, width, unit in zip(solutions[0], half_widths, units, strict=True)
    ]


def losses_behind_cell(groups: list[MovingSamples], group_name: str) -> LossesBehindCell:
    """Return the losses behind the cell; ``group_name`` names the groups."""
    end_time = max(float(each.time.max()) for each in groups)
    designs = []
    for v, a, torque, _, time in groups:
        t = time / end_time
        columns = [(v > 0.0) * 1.0, -1.0 * (v < 0.0), v, a, t, t * t - t]
        designs.append((np.stack(columns, axis=1), torque))
    units = ("N*m", "N*m", "N*m*s/rad", "kg*m^2", "N*m", "N*m")
    return LossesBehindCell(*_fit_groups(designs, units, group_name))


def zero_drift(losses: LossesBehindCell, time: Floats, end_time: float) -> Floats:
    """Return the drift (N*m) of the cell's zero by ``time``; ``end_time`` is that of the last
    sample.
    """
    t = time / end_time
    drift: Floats = losses.drift.value * t + losses.drift_curvature.value * (t * t - t)
    return drift


def losses_before_cell(
    groups: list[MovingSamples], torque_constant: Estimate, group_name: str
) -> LossesBeforeCell:
    """Return the losses before the cell.

    ``torque_constant`` (N*m/A) is the motor's own at the output; the intervals include the effect
    of its uncertainty.
    """
    losses = _fit_losses_before_cell(groups, torque_constant.value, group_name)
    constant_half_width = torque_constant.uncertainty
    if not constant_half_width > 0.0:
        return losses
    shifted = _fit_losses_before_cell(
        groups, torque_constant.value + constant_half_width, group_name
    )
    widened = (
        estimate._replace(
            uncertainty=float(
                np.hypot(estimate.uncertainty, shifted_estimate.value - estimate.value)
            )
        )
        for estimate, shifted_estimate in zip(losses, shifted, strict=True)
    )
    return LossesBeforeCell(*widened)


def _fit_losses_before_cell(
    groups: list[MovingSamples], torque_constant: float, group_name: str
) -> LossesBeforeCell:
    loads = [float(np.median(np.abs(each.torque))) for each in groups]
    # 2 N*m: a smaller range does not separate dry friction from the load share.
    load_varies = max(loads) - min(loads) > 2.0
    designs = []
    for v, a, torque, current, _ in groups:
        sign = np.sign(v)
        columns = [sign, v, a, *([np.abs(torque) * sign] if load_varies else [])]
        designs.append((np.stack(columns, axis=1), torque_constant * current - torque))
    units = ("N*m", "N*m*s/rad", "kg*m^2", *(("1",) if load_varies else ()))
    dry, viscous, inertia, *shares = _fit_groups(designs, units, group_name)
    no_share = Estimate(float("nan"), float("nan"), "1", "the load hardly varied")
    return LossesBeforeCell(dry, shares[0] if shares else no_share, viscous, inertia)
