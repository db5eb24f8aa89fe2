"""What rubs in the driveline: behind the load cell by its torque, before it by the current.

    T_cell            = c+ [v > 0] - c- [v < 0] + b v + J a + z t + z' t^2
    K i - T_cell      = (d + s |T_cell|) sign(v) + b' v + J' a

Inertia is told apart by the acceleration, and what differs between directions from a drift of the
cell's zero by the time t since its tare: the zero was right then, the bearing stays as it is. The
first is the bearing and, where there is one, the seal (OSWEC thesis, section 3.2.2 and chapter 4);
the second the motor and its gearbox. Intervals are by leaving out one group of samples (a set
point, or a period where there are few) at a time.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter1d

from rig.analysis.session.estimate import Estimate, Floats, jackknife

LEAST_GROUPS = 4


class Turned(NamedTuple):
    """A group of samples of a turning driveline, (samples,)."""

    velocity: Floats  # rad/s
    acceleration: Floats  # rad/s^2
    torque: Floats  # N*m, of the load cell
    current: Floats  # A, of the motor
    time: Floats  # s since the tare


class Behind(NamedTuple):
    """Losses behind the load cell."""

    positive: Estimate  # N*m, dry, as the shaft turns along positive angle
    negative: Estimate  # N*m, dry, the other way
    viscous: Estimate  # N*m*s/rad
    inertia: Estimate  # kg*m^2
    drift: Estimate  # N*m, of the cell's zero from the tare to the last sample
    bend: Estimate  # N*m, four times what that drift is behind a straight line halfway


class Before(NamedTuple):
    """Losses before the load cell."""

    dry: Estimate  # N*m
    share: Estimate  # of the load; NaN where the load hardly varies
    viscous: Estimate  # N*m*s/rad
    inertia: Estimate  # kg*m^2


def moving(velocity: Floats, around: int, least: float = 0.12) -> Floats:
    """Samples that turn faster than a share of the top speed, and have for ``around`` samples."""
    fast = np.abs(velocity) > least * np.abs(velocity).max()
    same = fast & (np.sign(velocity) == np.sign(np.roll(velocity, 1)))
    out: Floats = minimum_filter1d(same, 2 * around + 1)
    return out


def _solved(grams: Floats, rights: Floats) -> Floats:
    """Least squares of the sum of all groups, and without each: (groups + 1, unknowns)."""
    gram, right = grams.sum(axis=0), rights.sum(axis=0)
    sets = [(gram, right), *((gram - g, right - r) for g, r in zip(grams, rights, strict=True))]
    return np.array([np.linalg.lstsq(g, r, rcond=1e-12)[0] for g, r in sets])


def _fitted(
    groups: list[tuple[Floats, Floats]], units: tuple[str, ...], kind: str
) -> list[Estimate]:
    """Coefficients of design (samples, unknowns) and value (samples,), group by group."""
    scale = np.sqrt(sum((x * x).sum(axis=0) for x, _ in groups))
    scale = np.where(scale > 0.0, scale, 1.0)
    grams = np.array([(x / scale).T @ (x / scale) for x, _ in groups])
    rights = np.array([(x / scale).T @ y for x, y in groups])
    found = _solved(grams, rights) / scale
    half = jackknife(found[0], found[1:])
    how = f"least squares, jackknife over {len(groups)} {kind}"
    return [
        Estimate(float(value), float(width), unit, how)
        for value, width, unit in zip(found[0], half, units, strict=True)
    ]


def behind(groups: list[Turned], kind: str) -> Behind:
    """Losses behind the cell; ``kind`` names what a group is."""
    last = max(float(each.time.max()) for each in groups)
    rows = []
    for v, a, torque, _, time in groups:
        t = time / last
        columns = [(v > 0.0) * 1.0, -1.0 * (v < 0.0), v, a, t, t * t - t]
        rows.append((np.stack(columns, axis=1), torque))
    units = ("N*m", "N*m", "N*m*s/rad", "kg*m^2", "N*m", "N*m")
    return Behind(*_fitted(rows, units, kind))


def zero(of: Behind, time: Floats, last: float) -> Floats:
    """How far (N*m) the cell's zero has drifted by ``time``; ``last`` is the run's last sample."""
    t = time / last
    out: Floats = of.drift.value * t + of.bend.value * (t * t - t)
    return out


def before(groups: list[Turned], torque_constant: Estimate, kind: str) -> Before:
    """Losses before the cell.

    ``torque_constant`` (N*m/A) is the motor's own at the output; what its uncertainty makes of the
    losses is in their intervals.
    """
    plain = _before(groups, torque_constant.value, kind)
    half = torque_constant.uncertainty
    if not half > 0.0:
        return plain
    other = _before(groups, torque_constant.value + half, kind)
    both = (
        one._replace(uncertainty=float(np.hypot(one.uncertainty, two.value - one.value)))
        for one, two in zip(plain, other, strict=True)
    )
    return Before(*both)


def _before(groups: list[Turned], torque_constant: float, kind: str) -> Before:
    loads = [float(np.median(np.abs(each.torque))) for each in groups]
    loaded = max(loads) - min(loads) > 2.0  # N*m: less does not tell dry friction from its share
    rows = []
    for v, a, torque, current, _ in groups:
        sign = np.sign(v)
        columns = [sign, v, a, *([np.abs(torque) * sign] if loaded else [])]
        rows.append((np.stack(columns, axis=1), torque_constant * current - torque))
    units = ("N*m", "N*m*s/rad", "kg*m^2", *(("1",) if loaded else ()))
    dry, viscous, inertia, *rest = _fitted(rows, units, kind)
    nothing = Estimate(float("nan"), float("nan"), "1", "the load hardly varied")
    return Before(dry, rest[0] if rest else nothing, viscous, inertia)
