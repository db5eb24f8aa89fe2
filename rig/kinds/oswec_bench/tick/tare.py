"""The tare of the bench: zeros of both encoders and of the load cell, with drive and brake off.

Until the tare is complete, the first tick's values are provisional zeros.
"""

from typing import NamedTuple

from rig.kinds.oswec_bench.tick.signals import Zeros
from rig.realtime.sequence import TARE


class State(NamedTuple):
    """The zeros in use and the running sums of a tare."""

    zeros: Zeros
    seeded: int  # 1: zeros exist, at least provisional ones
    samples: int
    motor_sum: float  # rad, sum
    shaft_sum: float  # rad, sum
    torque_sum: float  # N*m, sum
    lowest: float  # rad, shaft
    highest: float  # rad


def start() -> State:
    """Return the state before the first tick."""
    return State(Zeros(0.0, 0.0, 0.0, 0), 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0)


def step(state: State, motor: float, shaft: float, torque: float, phase: int) -> State:
    """Return the state after a tick: angles (rad) and torque (N*m) are summed during the tare.

    After the tare their means become the zeros.
    """
    if state.seeded == 0:
        state = State(Zeros(motor, shaft, torque, 0), 1, 0, 0.0, 0.0, 0.0, shaft, shaft)
    zeros, _, n, motor_sum, shaft_sum, torque_sum, lowest, highest = state
    if phase == TARE:
        return State(
            zeros,
            1,
            n + 1,
            motor_sum + motor,
            shaft_sum + shaft,
            torque_sum + torque,
            shaft if n == 0 or shaft < lowest else lowest,
            shaft if n == 0 or shaft > highest else highest,
        )
    if n == 0:
        return state
    new_zeros = Zeros(motor_sum / n, shaft_sum / n, torque_sum / n, n)
    return State(new_zeros, 1, 0, 0.0, 0.0, 0.0, 0.0, 0.0)
