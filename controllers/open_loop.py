"""Open-loop force: a periodic reference from a table, as in system identification tests.

    F = s r_j(n mod N)                                (N, force on the body)

r_j is one repeat period, one entry a tick (a multisine of 300 s at 1 kHz: 300,000 entries), of
realisation j: the same lines with other phases, one after another in the table. n counts ticks of
the wave clock, so that forces and waves of one repeat period keep their phase; s is the set point's
reference scale, ramped so that it never jumps. A change of realisation ramps the scale to zero,
switches, and ramps it up again. The law of the axis adds the force to its feedback: a test with
waves has both (MASK4 report, section 3.2.2).

Before the wave clock starts (n < 0) the force is zero; then the scale ramps up from zero.
Bad input: a scale or an entry that is not finite gives a force that is not finite, which the
limits turn into a stop. An empty table gives 0.0.

The table is a tuple in the loop. Compiled code uses an array for a long one: the law only needs
its length and one entry.
"""

from typing import NamedTuple

from controllers.blocks import Ramp, ramp_start, ramp_step
from controllers.signals import Newton, Second


class Params(NamedTuple):
    """Constants of the reference."""

    table: tuple[float, ...]  # N, one repeat period of each realisation, one entry a tick
    ramp: Second  # duration of a change of the scale
    realisations: int  # number of realisations, all of one length


class State(NamedTuple):
    """The active scale and realisation."""

    scale: Ramp
    realisation: int  # from 0


def start() -> State:
    """Return the state at switch-on: no force, whatever the table contains."""
    return State(ramp_start(0.0), 0)


def step(
    params: Params, state: State, scale: float, realisation: int, wave_tick: int, dt: float
) -> tuple[State, Newton]:
    """Return the reference force (N) in a tick of the wave clock, ramped towards ``scale`` (1).

    ``realisation`` counts from 0; a number beyond the table selects the last realisation.
    """
    if len(params.table) == 0:
        return state, 0.0
    if wave_tick < 0:
        return start(), 0.0
    ramp, active = state
    if active != realisation and ramp.value == 0.0:
        active = realisation
        state = State(ramp, active)
    target = scale if active == realisation else 0.0
    if ramp.value != target:
        ramp = ramp_step(ramp, target, params.ramp, dt)
        state = State(ramp, active)
    return state, ramp.value * _entry(params.table, params.realisations, active, wave_tick)


def _entry(table: tuple[float, ...], realisations: int, active: int, wave_tick: int) -> float:
    """Return the entry of a realisation for a tick, wrapped; 0.0 for an empty table."""
    if len(table) == 0:  # a test of its own: compiled code then never indexes an empty tuple
        return 0.0
    if realisations < 1 or len(table) < realisations:
        return 0.0
    period = len(table) // realisations
    active = max(active, 0)
    if active >= realisations:
        active = realisations - 1
    return table[active * period + wave_tick % period]
