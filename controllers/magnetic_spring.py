"""Positioning the magnetic spring: spring rate -> stator position, move, wait, hold.

The measured map from stator position to small-displacement spring rate (MASK4 report, Table 4-1)
falls monotonically, so it can be inverted by interpolation.
"""

from typing import NamedTuple

from controllers.blocks import interpolate
from controllers.signals import SpringCommand, SpringSense


class Params(NamedTuple):
    """The spring map, ordered by rising rate so that it can be inverted."""

    rates: tuple[float, ...]  # N/m, increasing
    positions: tuple[float, ...]  # % stator position that gives each rate
    tolerance: float  # %, how near to the target counts as there


class State(NamedTuple):
    """What the actuator was told last, and whether it was told anything yet."""

    command: SpringCommand
    commanded: int  # 0 until the first rate is asked for: nothing moves before that


def start() -> State:
    """State before the first rate is asked for."""
    return State(SpringCommand(0.0, 0.0, 0), 0)


def stator_position(params: Params, rate: float) -> float:
    """Stator position (%) for a spring rate (N/m), held at the ends of the map."""
    return interpolate(rate, params.rates, params.positions)


def arrived(params: Params, state: State, sense: SpringSense) -> bool:
    """True when the stator stands where it was last told to and the actuator is at rest."""
    gap = sense.position - state.command.target
    return (
        state.commanded == 1 and sense.arrived == 1 and -params.tolerance <= gap <= params.tolerance
    )


def step(params: Params, state: State, rate: float, move: int) -> State:
    """Command the stator to ``rate`` (N/m) while ``move`` is 1; otherwise it stays where it is.

    The target is recomputed only when the rate changes, and is then held: the actuator keeps its
    own position loop.
    """
    last = state.command
    if last.enable == move and (move == 0 or (state.commanded == 1 and last.rate == rate)):
        return state
    if move == 0:
        return State(SpringCommand(last.rate, last.target, 0), state.commanded)
    return State(SpringCommand(rate, stator_position(params, rate), 1), 1)
