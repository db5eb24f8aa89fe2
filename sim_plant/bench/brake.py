"""Magnetic particle brake: current to the torque it can hold. Pure.

Two branches over current (a play of the magnetisation, with minor loops between them), a residual
torque without current, saturation, and a lag. A brake only opposes motion: what it holds is never
negative, and `transmission.follow` lets it do no more than hold.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.units import Ampere, Flag, NewtonMetre, Second

ABSURD = 1.0e3  # A: no command, whatever sent it


class BrakeParams(NamedTuple):
    """Brake and amplifier constants; the curve is the middle between both branches."""

    fitted: Flag  # 0: brake and flexible coupling are taken off
    currents: tuple[float, ...]  # A, ascending from 0
    torques: tuple[float, ...]  # N m, the last one is saturation
    half_width: Ampere  # half the distance of the branches
    current_limit: Ampere  # of the amplifier
    current_lag: Second
    torque_lag: Second


class BrakeState(NamedTuple):
    """Coil current, magnetisation in terms of current, torque it can hold."""

    current: Ampere
    magnetised: Ampere
    torque: NewtonMetre


def initial(params: BrakeParams) -> BrakeState:
    """Give the brake long without current, demagnetised."""
    return BrakeState(0.0, 0.0, params.torques[0] if params.fitted == 1 else 0.0)


def curve(params: BrakeParams, magnetised: Ampere) -> NewtonMetre:
    """Give the torque of a magnetisation, between the ends of the table, N m."""
    currents, torques = params.currents, params.torques
    last = len(currents) - 1
    if not magnetised > currents[0]:
        return torques[0]
    for i in range(1, last + 1):
        if magnetised < currents[i]:
            share = (magnetised - currents[i - 1]) / (currents[i] - currents[i - 1])
            return torques[i - 1] + share * (torques[i] - torques[i - 1])
    return torques[last]


def step(params: BrakeParams, state: BrakeState, command: Ampere, dt: Second) -> BrakeState:
    """Advance by dt under a commanded current; one that is negative or no number counts as 0."""
    goal = 0.0
    if abs(command) < ABSURD and command > 0.0:
        goal = min(command, params.current_limit)
    current = goal + (state.current - goal) * math.exp(-dt / params.current_lag)
    magnetised = max(state.magnetised, current - params.half_width)
    magnetised = max(0.0, min(magnetised, current + params.half_width))
    if params.fitted == 0:
        return BrakeState(current, magnetised, 0.0)
    rest = curve(params, magnetised)
    torque = rest + (state.torque - rest) * math.exp(-dt / params.torque_lag)
    return BrakeState(current, magnetised, torque)
