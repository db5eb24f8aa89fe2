"""Open-loop force: a periodic reference from a table, as in tests for system identification.

    F = s r(n mod N)                                  (N, force on the body, up positive)

r is one repeat period, one entry a tick (a multisine of 300 s at 1 kHz: 300,000 entries); n counts
ticks of the wave clock, so that forces and waves of one repeat period keep their phase; s is the
set point's reference scale, ramped, so that a change of it does not jump. The impedance law adds
the force to its feedback: a test with waves has both (MASK4 report, section 3.2.2).

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

    table: tuple[float, ...]  # N, one repeat period, one entry a tick
    ramp: Second  # time a change of the scale takes


class State(NamedTuple):
    """The scale in use, on its way to the set one."""

    scale: Ramp


def start() -> State:
    """State at switch-on: no force, whatever the table says."""
    return State(ramp_start(0.0))


def step(
    params: Params, state: State, scale: float, at_tick: int, dt: float
) -> tuple[State, Newton]:
    """Reference force (N) in tick ``at_tick`` of the wave clock, ramped towards ``scale`` (1)."""
    if len(params.table) == 0:
        return state, 0.0
    if at_tick < 0:
        return start(), 0.0
    used = state.scale
    if used.value != scale:
        used = ramp_step(used, scale, params.ramp, dt)
        state = State(used)
    return state, used.value * _entry(params.table, at_tick)


def _entry(table: tuple[float, ...], at_tick: int) -> float:
    """The table's entry for a tick, wrapped; 0.0 of an empty one."""
    if len(table) == 0:
        return 0.0
    return table[at_tick % len(table)]
