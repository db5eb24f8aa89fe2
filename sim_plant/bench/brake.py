"""Magnetic particle brake: holding torque over current. Pure.

The model has two branches over current (a play of the magnetisation, with minor loops between
them), a residual torque without current, saturation, and a lag. A brake only opposes motion: its
holding torque is never negative, and `transmission.follow` uses it only to hold.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.units import Ampere, Flag, NewtonMetre, Second

MAX_PLAUSIBLE_CURRENT = 1.0e3  # A: a larger command is invalid, whatever its source


class BrakeParams(NamedTuple):
    """Brake and amplifier parameters; the curve is midway between both branches."""

    fitted: Flag  # 0: brake and flexible coupling are removed
    currents: tuple[float, ...]  # A, ascending from 0
    torques: tuple[float, ...]  # N m, the last one is saturation
    half_width: Ampere  # half the distance of the branches
    current_limit: Ampere  # of the amplifier
    current_lag: Second
    torque_lag: Second


class BrakeState(NamedTuple):
    """Coil current, magnetisation expressed as a current, holding torque."""

    current: Ampere
    magnetisation: Ampere
    torque: NewtonMetre


def initial(params: BrakeParams) -> BrakeState:
    """Return the state of a demagnetised brake without current."""
    return BrakeState(0.0, 0.0, params.torques[0] if params.fitted == 1 else 0.0)


def torque_of_magnetisation(params: BrakeParams, magnetisation: Ampere) -> NewtonMetre:
    """Return the torque of a magnetisation, limited to the ends of the table, N m."""
    currents, torques = params.currents, params.torques
    last = len(currents) - 1
    if not magnetisation > currents[0]:
        return torques[0]
    for i in range(1, last + 1):
        if magnetisation < currents[i]:
            fraction = (magnetisation - currents[i - 1]) / (currents[i] - currents[i - 1])
            return torques[i - 1] + fraction * (torques[i] - torques[i - 1])
    return torques[last]


def step(params: BrakeParams, state: BrakeState, command: Ampere, dt: Second) -> BrakeState:
    """Advance by dt under a commanded current; a negative or invalid command counts as 0."""
    target = 0.0
    if abs(command) < MAX_PLAUSIBLE_CURRENT and command > 0.0:
        target = min(command, params.current_limit)
    current = target + (state.current - target) * math.exp(-dt / params.current_lag)
    magnetisation = max(state.magnetisation, current - params.half_width)
    magnetisation = max(0.0, min(magnetisation, current + params.half_width))
    if params.fitted == 0:
        return BrakeState(current, magnetisation, 0.0)
    steady_torque = torque_of_magnetisation(params, magnetisation)
    torque = steady_torque + (state.torque - steady_torque) * math.exp(-dt / params.torque_lag)
    return BrakeState(current, magnetisation, torque)
