"""A taut, straight, elastic line between an anchor and a fairlead of the body. Pure.

Tension T = T0 + k (L - L0) + c dL/dt, never negative: a line does not push. The line is weightless,
so it is straight; L0 is its length at rest, k its axial stiffness EA / L0. Small motions see the
stiffness k u u' + T0 / L0 (I - u u'), with u along the line (M. Irvine, Cable Structures, 1981).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.units import Metre, MetrePerSecond, Newton, NewtonPerMetre, NewtonSecondPerMetre


class LineParams(NamedTuple):
    """A line at rest: its vector from the anchor to the fairlead, tension, stiffness, damping."""

    x: Metre
    y: Metre
    z: Metre
    pretension: Newton
    stiffness: NewtonPerMetre
    damping: NewtonSecondPerMetre


class Pull(NamedTuple):
    """Tension, and the force on the fairlead beyond the one at rest."""

    tension: Newton
    x: Newton
    y: Newton
    z: Newton


def pull(
    params: LineParams,
    dx: Metre,
    dy: Metre,
    dz: Metre,
    vx: MetrePerSecond,
    vy: MetrePerSecond,
    vz: MetrePerSecond,
) -> Pull:
    """Return tension and force of a line whose fairlead is displaced by d and moves at v.

    The force at rest is taken off: the weight and buoyancy of a moored body are in balance with it.
    """
    rest = math.sqrt(params.x * params.x + params.y * params.y + params.z * params.z)
    x, y, z = params.x + dx, params.y + dy, params.z + dz
    length = math.sqrt(x * x + y * y + z * z)
    if not length > 0.0:  # the fairlead is at the anchor: the line has no direction
        length = rest
    rate = (x * vx + y * vy + z * vz) / length
    tension = params.pretension + params.stiffness * (length - rest) + params.damping * rate
    tension = max(tension, 0.0)
    along, before = tension / length, params.pretension / rest
    return Pull(
        tension,
        before * params.x - along * x,
        before * params.y - along * y,
        before * params.z - along * z,
    )
