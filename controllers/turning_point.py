"""Detecting the turning points of a motion: where its velocity changes sign.

A measured velocity changes its sign many times while a body stands. So a turning point counts only
after the speed has exceeded an arming speed since the last one.
"""

from typing import NamedTuple

from controllers.signals import Flag, MetrePerSecond


class State(NamedTuple):
    """The direction of motion since the arming speed was last exceeded."""

    direction: Flag  # 1 up, -1 down, 0 not yet armed


def start() -> State:
    """State before any motion: not armed."""
    return State(0)


def step(state: State, velocity: MetrePerSecond, arming_speed: MetrePerSecond) -> tuple[State, int]:
    """Return the state, and 1 in the tick in which the velocity has changed its sign, else 0.

    NaN is no turning point and changes nothing.
    """
    direction = state.direction
    if direction * velocity < 0.0:
        return State(0), 1
    if velocity > arming_speed:
        return State(1), 0
    if velocity < -arming_speed:
        return State(-1), 0
    return state, 0
