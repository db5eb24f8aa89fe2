"""Conversion of load cell counts to newtons and newton metres.

Unit codes differ between boxes: the Net F/T numbers its units from 1, the Axia console from 0, and
those of the Digital F/T are not confirmed. So the codec of each box maps its codes to names, and
the functions here take units by name.
"""

import math
from typing import NamedTuple

from drivers.errors import CodecError

NEWTONS = {
    "lbf": 4.4482216152605,
    "N": 1.0,
    "klbf": 4448.2216152605,
    "kN": 1000.0,
    "kgf": 9.80665,
    "gf": 0.00980665,
}
NEWTON_METRES = {
    "lbf-in": 0.1129848290276167,
    "lbf-ft": 1.3558179483314004,
    "N-m": 1.0,
    "N-mm": 0.001,
    "kgf-cm": 0.0980665,
    "kN-m": 1000.0,
}
# Codes of the Net F/T box, from 1. Source: Net F/T manual 9620-05-net ft, 11.6.
NET_FT_FORCE_UNITS = ("lbf", "N", "klbf", "kN", "kgf", "gf")
NET_FT_TORQUE_UNITS = ("lbf-in", "lbf-ft", "N-m", "N-mm", "kgf-cm", "kN-m")

Vector6 = tuple[float, float, float, float, float, float]
Matrix = tuple[Vector6, Vector6, Vector6, Vector6, Vector6, Vector6]


class Scale(NamedTuple):
    """SI per count; `make_scale` returns a checked one."""

    force: float  # N per count
    torque: float  # N m per count


class Wrench(NamedTuple):
    """Force and torque in the sensor's own frame, with the manufacturer's signs."""

    fx: float  # N
    fy: float  # N
    fz: float  # N
    tx: float  # N m
    ty: float  # N m
    tz: float  # N m


def make_scale(per_force: float, per_torque: float, force_unit: str, torque_unit: str) -> Scale:
    """Return the scale (SI per count) from counts per unit and unit names.

    CodecError for a count that is not above 0 or an unknown unit.
    """
    for where, number in (("counts per force", per_force), ("counts per torque", per_torque)):
        if not (math.isfinite(number) and number > 0.0):
            raise CodecError("load cell scale", where, "a number above 0", number)
    if force_unit not in NEWTONS:
        raise CodecError("load cell scale", "force unit", " ".join(NEWTONS), force_unit)
    if torque_unit not in NEWTON_METRES:
        raise CodecError("load cell scale", "torque unit", " ".join(NEWTON_METRES), torque_unit)
    return Scale(NEWTONS[force_unit] / per_force, NEWTON_METRES[torque_unit] / per_torque)


def to_si(scaling: Scale, counts: Vector6) -> Wrench:
    """Return the wrench (SI) of six counts, forces first."""
    fx, fy, fz, tx, ty, tz = counts
    force, torque = scaling
    return Wrench(fx * force, fy * force, fz * force, tx * torque, ty * torque, tz * torque)


def apply_calibration(matrix: Matrix, gauges: Vector6, bias: Vector6) -> Vector6:
    """Return the counts of force and torque: matrix times (gauges - bias), row by row."""
    g0, g1, g2, g3, g4, g5 = (gauge - tare for gauge, tare in zip(gauges, bias, strict=True))
    r0, r1, r2, r3, r4, r5 = (
        a * g0 + b * g1 + c * g2 + d * g3 + e * g4 + f * g5 for a, b, c, d, e, f in matrix
    )
    return r0, r1, r2, r3, r4, r5
