"""First-order low-pass average, which distinguishes a power source from an energy store.

    T da/dt = x - a,    for an x held over a tick exactly    a <- a + (1 - exp(-dt / T)) (x - a)

A power that only charges and empties a store of at most E joules (a spring, a moving mass, the Ki
term) has an average of at most E / T in magnitude, whatever its course: with e the energy in the
store, the average of de/dt from a start at 0 is

    ( e(t) - mean of e weighted by exp(-age / T) - e(0) exp(-t / T) ) / T.

The average of a source approaches its mean power after some T.
"""

import math


def weight_of_tick(time_constant: float, dt: float) -> float:
    """Return the weight of one tick of ``dt`` (s) for a ``time_constant`` T (s, > 0)."""
    return -math.expm1(-dt / time_constant)


def step(average: float, value: float, weight: float) -> float:
    """Return the average updated with this tick's value of the given ``weight``."""
    return average + weight * (value - average)
