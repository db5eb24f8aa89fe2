"""Positioning of the magnetic spring: spring rate -> stator position, move, wait, hold.

The measured map from stator position to small-displacement spring rate (MASK4 report, Table 4-1)
decreases monotonically, so interpolation inverts it.
"""

from typing import NamedTuple

from controllers.blocks import interpolate
from controllers.signals import SpringCommand, SpringSense


class Params(NamedTuple):
    """The spring map, ordered by increasing rate so that it can be inverted."""

    rates: tuple[float, ...]  # N/m, increasing
    positions: tuple[float, ...]  # stator position in % for each rate
    tolerance: float  # %, largest distance from the target that counts as arrived


class State(NamedTuple):
    """Last command to the actuator, and whether there was one yet."""

    command: SpringCommand
    commanded: int  # 0 until the first rate is demanded: before that the actuator does not move


def start() -> State:
    """Return the state before the first rate is demanded."""
    return State(SpringCommand(0.0, 0.0, 0), 0)


def stator_position(params: Params, rate: float) -> float:
    """Return the stator position (%) for a spring rate (N/m), limited to the ends of the map."""
    return interpolate(rate, params.rates, params.positions)


def arrived(params: Params, state: State, sense: SpringSense) -> bool:
    """Return True when the stator is at its last target and the actuator is at rest."""
    gap = sense.position - state.command.target
    return (
        state.commanded == 1 and sense.arrived == 1 and -params.tolerance <= gap <= params.tolerance
    )


def step(params: Params, state: State, rate: float, move: int) -> State:
    """Return the command of ``rate`` (N/m) while ``move`` is 1; otherwise the stator stays put.

    The target is recomputed only when the rate changes, and then kept: the actuator has its own
    position loop.
    """
    last = state.command
    if last.enable == move and (move == 0 or (state.commanded == 1 and last.rate == rate)):
        return state
    if move == 0:
        return State(SpringCommand(last.rate, last.target, 0), state.commanded)
    return State(SpringCommand(rate, stator_position(params, rate), 1), 1)
