"""The flap about its hinge: buoyancy, inertia, added mass, radiation memory, drag. Pure.

Moments act on the flap; the angle is positive along the waves.
(I + mu_inf) theta'' = M_exc + M_pto - C theta - M_rad - (c1 + c2 |theta'|) theta'.
Leapfrog: the angle is at the tick, the velocity half a tick later; velocity-dependent terms use the
mean of two velocities. The scheme is of second order and stable with the coupling's stiffness.
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
    """Parameters; radiation is r1 s/(s2 + d1 s + d0), passive for any positive numbers."""

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
    radiation: NewtonMetre  # of the water on the flap, half a tick later


AT_REST = FlapBodyState(0.0, 0.0, 0.0, 0.0)


class FlapStep(NamedTuple):
    """The flap after a step, and the dry friction in it."""

    state: FlapBodyState
    friction: NewtonMetre  # signed: it acts against the other moments


def velocity_step(
    params: FlapBodyParams,
    state: FlapBodyState,
    angle: Radian,
    applied: NewtonMetre,
    dry: NewtonMetre,
    dt: Second,
) -> FlapStep:
    """Advance velocity and memory under the moment `applied` at the present `angle`.

    `dry` (not negative) is the friction that opposes motion, or holds the flap.
    """
    inertia, buoyancy, viscous, quadratic, r1, d0, d1 = params
    _, v, memory, radiation = state
    half = 0.5 * dt
    drag = half * (viscous + quadratic * abs(v))
    memory += dt * radiation
    # new radiation = radiation_free + radiation_gain * new velocity, in the equation of motion
    radiation_gain = half * r1 / (1.0 + half * d1)
    radiation_free = ((1.0 - half * d1) * radiation + half * r1 * v - dt * d0 * memory) / (
        1.0 + half * d1
    )
    effective_inertia = inertia + drag + half * radiation_gain
    impulse = (
        (inertia - drag) * v
        - half * (radiation + radiation_free)
        + dt * (applied - buoyancy * angle)
    )
    friction_impulse = dt * dry
    friction_taken = max(-friction_impulse, min(impulse, friction_impulse))
    v = (impulse - friction_taken) / effective_inertia
    return FlapStep(
        FlapBodyState(angle, v, memory, radiation_free + radiation_gain * v), friction_taken / dt
    )
