"""Averages over the recent past that need no memory of it: a first-order low-pass.

    T da/dt = x - a,    for an x held over a tick exactly    a <- a + (1 - exp(-dt / T)) (x - a)

Taken of a power it tells a source from a store. A power that only charges and empties a store of
at most E joules (a spring, a moving mass, the Ki term) averages to no more than E / T either way,
whatever its course: with e the energy in the store, the average of de/dt from a start at 0 is

    ( e(t) - mean of e weighted by exp(-age / T) - e(0) exp(-t / T) ) / T.

A source shows with its mean power after some T.
"""

import math


def share(duration: float, dt: float) -> float:
    """Share of a tick of ``dt`` in an average over ``duration`` (s, > 0)."""
    return -math.expm1(-dt / duration)


def step(average: float, value: float, newest: float) -> float:
    """The average with the value of this tick in it, whose share is ``newest``."""
    return average + newest * (value - average)
