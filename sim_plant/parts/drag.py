"""Viscous drag of a body in water: linear and quadratic. Pure.

F = -(b + c |v|) v. For a plate or hull of area S the quadratic coefficient is c = rho Cd S / 2 (the
drag term of J. R. Morison et al., Petroleum Transactions AIME 189, 1950). v is the velocity of the
body: that of the water is left out.
"""

from __future__ import annotations

from sim_plant.units import MetrePerSecond, Newton, NewtonSecondPerMetre


def force(linear: NewtonSecondPerMetre, quadratic: float, velocity: MetrePerSecond) -> Newton:
    """Return the drag; `quadratic` in N s2/m2. For a rotation read rad for m and N m for N."""
    return -((linear + quadratic * abs(velocity)) * velocity)
