"""Open-loop force: a periodic reference from a table, as in tests for system identification.

    F = s r_j(n mod N)                                (N, force on the body)

r_j is one repeat period, one entry a tick (a multisine of 300 s at 1 kHz: 300,000 entries), of
realisation j: the same lines with other phases, one after another in the table. n counts ticks of
the wave clock, so that forces and waves of one repeat period keep their phase; s is the set point's
reference scale, ramped, so that a change of it does not jump. Before another realisation begins,
the scale goes down to zero, and up again with it. The law of the axis adds the force to its
feedback: a test with waves has both (MASK4 report, section 3.2.2).

Before the wave clock starts (n < 0) there is no force, and the scale ramps up from zero once it
does. Bad input: a scale or an entry that is not finite gives a force that is not finite, which the
limits turn into a stop. An empty table gives 0.0.

The table is a tuple in the loop. In compiled code a long one is an array: it is only asked for its
length and one entry.
"""

from typing import NamedTuple

from controllers.blocks import Ramp, ramp_start, ramp_step
from controllers.signals import Newton, Second


class Params(NamedTuple):
    """Constants of the reference."""

    table: tuple[float, ...]  # N, a repeat period of each realisation, one entry a tick
    ramp: Second  # time a change of the scale takes
    realisations: int  # how many there are, all of one length


class State(NamedTuple):
    """What is in use, on its way to what is set."""

    scale: Ramp
    realisation: int  # from 0


def start() -> State:
    """State at switch-on: no force, whatever the table says."""
    return State(ramp_start(0.0), 0)


def step(
    params: Params, state: State, scale: float, realisation: int, at_tick: int, dt: float
) -> tuple[State, Newton]:
    """Reference force (N) in tick ``at_tick`` of the wave clock, ramped towards ``scale`` (1).

    ``realisation`` counts from 0; one that is not in the table is the last one.
    """
    if len(params.table) == 0:
        return state, 0.0
    if at_tick < 0:
        return start(), 0.0
    used, playing = state
    if playing != realisation and used.value == 0.0:
        playing = realisation
        state = State(used, playing)
    wanted = scale if playing == realisation else 0.0
    if used.value != wanted:
        used = ramp_step(used, wanted, params.ramp, dt)
        state = State(used, playing)
    return state, used.value * _entry(params.table, params.realisations, playing, at_tick)


def _entry(table: tuple[float, ...], realisations: int, playing: int, at_tick: int) -> float:
    """The entry of a realisation for a tick, wrapped; 0.0 of an empty table."""
    if len(table) == 0:  # by itself: compiled code then never looks into an empty tuple
        return 0.0
    if realisations < 1 or len(table) < realisations:
        return 0.0
    period = len(table) // realisations
    playing = max(playing, 0)
    if playing >= realisations:
        playing = realisations - 1
    return table[playing * period + at_tick % period]
