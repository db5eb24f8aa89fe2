"""The tare of the bench: zeros of both encoders and of the load cell, drive and brake off.

Until it is done the first tick's values are provisional zeros.
"""

from typing import NamedTuple

from rig.kinds.oswec_bench.signals import Zeros
from rig.realtime.sequence import TARE


class State(NamedTuple):
    """The zeros in use and the running sums of a tare."""

    zeros: Zeros
    seeded: int  # 1 once there are zeros at all
    samples: int
    motor: float  # rad, sum
    shaft: float  # rad, sum
    torque: float  # N*m, sum
    lowest: float  # rad, shaft
    highest: float  # rad


def start() -> State:
    """State before the first tick."""
    return State(Zeros(0.0, 0.0, 0.0, 0), 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0)


def step(state: State, motor: float, shaft: float, torque: float, phase: int) -> State:
    """Sum angles (rad) and torque (N*m) during the tare; then their means become the zeros."""
    if state.seeded == 0:
        state = State(Zeros(motor, shaft, torque, 0), 1, 0, 0.0, 0.0, 0.0, shaft, shaft)
    zeros, _, n, motors, shafts, torques, lowest, highest = state
    if phase == TARE:
        return State(
            zeros,
            1,
            n + 1,
            motors + motor,
            shafts + shaft,
            torques + torque,
            shaft if n == 0 or shaft < lowest else lowest,
            shaft if n == 0 or shaft > highest else highest,
        )
    if n == 0:
        return state
    taken = Zeros(motors / n, shafts / n, torques / n, n)
    return State(taken, 1, 0, 0.0, 0.0, 0.0, 0.0, 0.0)
