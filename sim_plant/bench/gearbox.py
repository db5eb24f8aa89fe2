"""Friction of the gearbox: dry friction that grows with load. Pure.

At standstill a planetary gearbox loses more than its running efficiency implies, and the loss
differs between the flanks. Each time the teeth change to the other flank, the contact has another
friction share (drawn from a seeded table) and has to break away: friction delays the first part of
a ramp, and the ramp is steeper afterwards. This reproduces the spread of the torque constant in the
OSWEC thesis (Fig. 3.3), 15.56-18.42 N m/A. The thesis gives no cause; this mechanism is a choice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.sensors import NOISE_MASK
from sim_plant.units import NewtonMetre, Radian, Ratio

STRIDE, OFFSET = 31, 90001  # step of the flank changes through the noise table


class GearboxParams(NamedTuple):
    """Friction referred to the output."""

    dry: NewtonMetre
    breakaway: NewtonMetre  # in addition to `dry`, until the teeth have settled
    settling: Radian  # travel in which the breakaway torque decays
    share_forward: Ratio  # of the load, teeth in contact for positive torque
    share_back: Ratio
    spread_forward: Ratio  # standard deviation from one contact of the teeth to the next
    spread_back: Ratio


class GearboxState(NamedTuple):
    """The flank in contact and its history."""

    flank: int  # +1, -1; 0 before any
    changes: int  # number of flank changes
    share: Ratio  # of the load
    travel: Radian  # of the motor since the last change


INITIAL = GearboxState(0, 0, 0.0, 0.0)


def friction(params: GearboxParams, state: GearboxState, load: NewtonMetre) -> NewtonMetre:
    """Return the torque that opposes the motor under a load of either sign, not negative."""
    settled = math.exp(-min(state.travel / params.settling, 50.0))
    return params.dry + state.share * abs(load) + params.breakaway * settled


def step(
    params: GearboxParams,
    state: GearboxState,
    load: NewtonMetre,
    motor_travel: Radian,
    normals: Sequence[float],
) -> GearboxState:
    """Return the state after a motor movement under a load; a new flank gets a new share."""
    flank, changes, share, travel = state
    if load != 0.0 and (load > 0.0) != (flank > 0):
        changes += 1
        normal = normals[(changes * STRIDE + OFFSET) & NOISE_MASK]
        if load > 0.0:
            share = max(params.share_forward + params.spread_forward * normal, 0.0)
            return GearboxState(1, changes, share, 0.0)
        share = max(params.share_back + params.spread_back * normal, 0.0)
        return GearboxState(-1, changes, share, 0.0)
    return GearboxState(flank, changes, share, travel + abs(motor_travel))
