"""What the gearbox takes of the motor's torque: dry friction that grows with load. Pure.

At standstill a planetary gearbox loses more than its running efficiency tells, and not the same on
both flanks. Each time the teeth come to bear on the other flank they meet anew (another share of
friction, drawn from a seeded table) and have to break away: the first part of a ramp is held back,
so the ramp is the steeper after. This is how the torque constant of the OSWEC thesis (Fig. 3.3)
comes to spread over 15.56-18.42 N m/A; its cause was not found there, and this one is a choice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.sensors import MASK
from sim_plant.units import NewtonMetre, Radian, Ratio

STRIDE, OFFSET = 31, 90001  # how the flanks walk through the table of normals


class GearboxParams(NamedTuple):
    """Friction referred to the output."""

    dry: NewtonMetre
    breakaway: NewtonMetre  # beside `dry`, until the teeth have settled
    settling: Radian  # travel in which that fades
    share_forward: Ratio  # of the load, teeth bearing along positive angle
    share_back: Ratio
    spread_forward: Ratio  # standard deviation from one bearing of the teeth to the next
    spread_back: Ratio


class GearboxState(NamedTuple):
    """Which flank bears and how it came to."""

    flank: int  # +1, -1; 0 before any
    changes: int  # how often the flank changed
    share: Ratio  # of the load
    travel: Radian  # of the motor since


FRESH = GearboxState(0, 0, 0.0, 0.0)


def friction(params: GearboxParams, state: GearboxState, load: NewtonMetre) -> NewtonMetre:
    """Give the torque that opposes the motor under a load of either sign, not negative."""
    settled = math.exp(-min(state.travel / params.settling, 50.0))
    return params.dry + state.share * abs(load) + params.breakaway * settled


def step(
    params: GearboxParams,
    state: GearboxState,
    load: NewtonMetre,
    moved: Radian,
    normals: Sequence[float],
) -> GearboxState:
    """Remember a movement of the motor under a load; a new flank has a new share of friction."""
    flank, changes, share, travel = state
    if load != 0.0 and (load > 0.0) != (flank > 0):
        changes += 1
        normal = normals[(changes * STRIDE + OFFSET) & MASK]
        if load > 0.0:
            share = max(params.share_forward + params.spread_forward * normal, 0.0)
            return GearboxState(1, changes, share, 0.0)
        share = max(params.share_back + params.spread_back * normal, 0.0)
        return GearboxState(-1, changes, share, 0.0)
    return GearboxState(flank, changes, share, travel + abs(moved))
