"""The tare: sensor zeros taken in calm water with the drive off.

An encoder offset b would give Ki b newtons, so every campaign begins with this. Until it is done
the first tick's values are provisional zeros.
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
    stator_a: Newton  # where the stator stood: the stator's force there is in it
    stator_b: Newton
    samples: Count  # ticks averaged; 0: provisional, from the first tick alone


class Raw(NamedTuple):
    """What is tared, as sensed."""

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
    sum: Raw
    lowest: float  # m, heave
    highest: float  # m


_NOTHING = Raw(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def start() -> State:
    """State before the first tick."""
    return State(_provisional(_NOTHING), 0, 0, _NOTHING, 0.0, 0.0)


def _provisional(raw: Raw) -> Zeros:
    """What stands for the zeros until a tare is over."""
    position, surge, string_pot, lcb, trs, slew, stator_a, stator_b = raw
    return Zeros(position, surge, string_pot, lcb, trs, slew, stator_a, stator_b, 0)


def step(state: State, raw: Raw, phase: int) -> State:
    """Sum during the tare; when it is over its means become the zeros."""
    if state.seeded == 0:
        x = raw.position
        state = State(_provisional(raw), 1, 0, _NOTHING, x, x)
    if phase == TARE:
        total, x, first_sample = state.sum, raw.position, state.samples == 0
        return State(
            state.zeros,
            1,
            state.samples + 1,
            Raw(
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
    n, total = state.samples, state.sum
    if n == 0:
        return state
    taken = Zeros(
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
    return State(taken, 1, 0, _NOTHING, 0.0, 0.0)
