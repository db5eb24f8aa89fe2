"""The flap about its hinge: buoyancy, inertia, added mass, radiation memory, drag. Pure.

Moments are on the flap, angle positive along the waves.
(I + mu_inf) theta'' = M_exc + M_pto - C theta - M_rad - (c1 + c2 |theta'|) theta'.
Leapfrog: the angle stands at the tick, the velocity half a tick after it; what depends on velocity
is taken as the mean of two of them. Second order, and the coupling's stiffness stays stable.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from sim_plant.units import (
    KilogramSquareMetre,
    NewtonMetre,
    NewtonMetrePerRadian,
    NewtonMetreSecondPerRadian,
    Radian,
    RadianPerSecond,
    Second,
)


class FlapBodyParams(NamedTuple):
    """Constants; radiation is r1 s/(s2 + d1 s + d0), passive for any positive numbers."""

    inertia: KilogramSquareMetre  # I + mu_inf
    buoyancy: NewtonMetrePerRadian  # C
    viscous: NewtonMetreSecondPerRadian
    quadratic: Annotated[float, "N m s2/rad2"]
    r1: Annotated[float, "N m/rad"]
    d0: Annotated[float, "1/s2"]
    d1: Annotated[float, "1/s"]


class FlapBodyState(NamedTuple):
    """Motion and radiation memory."""

    angle: Radian
    velocity: RadianPerSecond  # half a tick later
    memory: Annotated[float, "N m s"]  # integral of the radiation moment
    radiation: NewtonMetre  # what the water takes, half a tick later


AT_REST = FlapBodyState(0.0, 0.0, 0.0, 0.0)


class Swung(NamedTuple):
    """The flap after a step, and what dry friction took in it."""

    state: FlapBodyState
    friction: NewtonMetre  # signed, as it acts against the other moments


def swing(
    params: FlapBodyParams,
    state: FlapBodyState,
    angle: Radian,
    applied: NewtonMetre,
    dry: NewtonMetre,
    dt: Second,
) -> Swung:
    """Advance velocity and memory under the moment `applied` at the `angle` reached by now.

    `dry` (not negative) is friction that opposes motion, or holds.
    """
    inertia, buoyancy, viscous, quadratic, r1, d0, d1 = params
    _, v, memory, radiation = state
    half = 0.5 * dt
    drag = half * (viscous + quadratic * abs(v))
    memory += dt * radiation
    # radiation' = kept + given velocity', put into the equation of motion
    given = half * r1 / (1.0 + half * d1)
    kept = ((1.0 - half * d1) * radiation + half * r1 * v - dt * d0 * memory) / (1.0 + half * d1)
    mass = inertia + drag + half * given
    push = (inertia - drag) * v - half * (radiation + kept) + dt * (applied - buoyancy * angle)
    rub = dt * dry
    taken = max(-rub, min(push, rub))
    v = (push - taken) / mass
    return Swung(FlapBodyState(angle, v, memory, kept + given * v), taken / dt)
