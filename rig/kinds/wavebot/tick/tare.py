"""The tare: sensor zeros taken in calm water with the drive off.

An encoder offset b would give a force of Ki b newtons, so every campaign begins with a tare. Until
its end the first tick's values are provisional zeros.
"""

from typing import NamedTuple

from controllers.signals import Count, Metre, Newton
from rig.realtime.sequence import TARE


class Zeros(NamedTuple):
    """The zeros in use."""

    position: Metre  # heave, in the encoder's own frame
    surge: Metre  # in that encoder's own frame
    string_pot: Metre
    lcb: Newton
    trs: Newton
    slew: Newton
    stator_a: Newton  # includes the stator's force at its position during the tare
    stator_b: Newton
    samples: Count  # ticks averaged; 0: provisional, from the first tick alone


class RawSensors(NamedTuple):
    """The present values of the sensors that are tared."""

    position: float  # m, heave, in the encoder's own frame
    surge: float  # m, likewise
    string_pot: float  # m
    lcb: float  # N
    trs: float  # N
    slew: float  # N
    stator_a: float  # N
    stator_b: float  # N


class State(NamedTuple):
    """The zeros in use and the running sums of a tare."""

    zeros: Zeros
    seeded: int  # 1 once there are zeros at all
    samples: int
    sums: RawSensors
    lowest: float  # m, heave
    highest: float  # m


_ZERO_SUMS = RawSensors(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def start() -> State:
    """Return the state before the first tick."""
    return State(_provisional(_ZERO_SUMS), 0, 0, _ZERO_SUMS, 0.0, 0.0)


def _provisional(raw: RawSensors) -> Zeros:
    """Return the provisional zeros until the end of a tare."""
    position, surge, string_pot, lcb, trs, slew, stator_a, stator_b = raw
    return Zeros(position, surge, string_pot, lcb, trs, slew, stator_a, stator_b, 0)


def step(state: State, raw: RawSensors, phase: int) -> State:
    """Add to the sums during the tare; after it, set the zeros to the means."""
    if state.seeded == 0:
        x = raw.position
        state = State(_provisional(raw), 1, 0, _ZERO_SUMS, x, x)
    if phase == TARE:
        total, x, first_sample = state.sums, raw.position, state.samples == 0
        return State(
            state.zeros,
            1,
            state.samples + 1,
            RawSensors(
                total.position + x,
                total.surge + raw.surge,
                total.string_pot + raw.string_pot,
                total.lcb + raw.lcb,
                total.trs + raw.trs,
                total.slew + raw.slew,
                total.stator_a + raw.stator_a,
                total.stator_b + raw.stator_b,
            ),
            x if first_sample or x < state.lowest else state.lowest,
            x if first_sample or x > state.highest else state.highest,
        )
    n, total = state.samples, state.sums
    if n == 0:
        return state
    zeros = Zeros(
        total.position / n,
        total.surge / n,
        total.string_pot / n,
        total.lcb / n,
        total.trs / n,
        total.slew / n,
        total.stator_a / n,
        total.stator_b / n,
        n,
    )
    return State(zeros, 1, 0, _ZERO_SUMS, 0.0, 0.0)
