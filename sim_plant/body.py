"""The floating body in heave: hydrostatics, five-state radiation, viscous drag. Pure.

Force is the force on the body, up positive. (m + A_inf) a = F_exc - K_h x - F_rad - F_visc + F_pto.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from sim_plant.units import (
    Kilogram,
    Metre,
    MetrePerSecond,
    MetrePerSecondSquared,
    Newton,
    NewtonPerMetre,
    NewtonSecondPerMetre,
    NewtonSecondSquaredPerMetreSquared,
    Second,
)


class BodyParams(NamedTuple):
    """Heave constants; radiation is (b4 s4 + b3 s3 + b2 s2 + b1 s)/(s5 + a4 s4 + ... + a0)."""

    inertia: Kilogram  # m + A_inf
    hydrostatic: NewtonPerMetre
    viscous: NewtonSecondPerMetre
    quadratic: NewtonSecondSquaredPerMetreSquared
    a0: Annotated[float, "1/s5"]
    a1: Annotated[float, "1/s4"]
    a2: Annotated[float, "1/s3"]
    a3: Annotated[float, "1/s2"]
    a4: Annotated[float, "1/s"]
    b1: Annotated[float, "N/m/s3"]
    b2: Annotated[float, "N/m/s2"]
    b3: Annotated[float, "N/m/s"]
    b4: Annotated[float, "N/m"]


class BodyState(NamedTuple):
    """Motion and radiation memory (companion form driven by velocity: z1' = z2, ..., z5')."""

    position: Metre
    velocity: MetrePerSecond
    z1: Annotated[float, "m s4"]
    z2: Annotated[float, "m s3"]
    z3: Annotated[float, "m s2"]
    z4: Annotated[float, "m s"]
    z5: Annotated[float, "m"]


def radiation(params: BodyParams, state: BodyState) -> Newton:
    """Return the memory part of the radiation force on the body (A_inf is part of the inertia).

    N, opposing motion. Source: Cummins' equation; five-state fit of BEM data.
    """
    return -(
        params.b1 * state.z2 + params.b2 * state.z3 + params.b3 * state.z4 + params.b4 * state.z5
    )


def drag(params: BodyParams, velocity: MetrePerSecond) -> Newton:
    """Return the viscous force on the body: -(c1 + c2 |v|) v. N.

    Source: WaveBot MASK1 identification (linear and quadratic heave damping).
    """
    return -(params.viscous + params.quadratic * abs(velocity)) * velocity


def acceleration(params: BodyParams, state: BodyState, applied: Newton) -> MetrePerSecondSquared:
    """Return heave acceleration under `applied` (excitation plus PTO forces on the body), m/s2."""
    return (
        applied
        - params.hydrostatic * state.position
        + radiation(params, state)
        + drag(params, state.velocity)
    ) / params.inertia


def predict(
    params: BodyParams, state: BodyState, applied: Newton, half: Second
) -> tuple[Metre, MetrePerSecond]:
    """Return position and velocity half a step ahead: first stage of the midpoint rule (Euler)."""
    inertia, hydrostatic, viscous, quadratic, _, _, _, _, _, b1, b2, b3, b4 = params
    x, v, _, z2, z3, z4, z5 = state
    memory = b1 * z2 + b2 * z3 + b3 * z4 + b4 * z5
    force = applied - hydrostatic * x - memory - (viscous + quadratic * abs(v)) * v
    return x + half * v, v + half * (force / inertia)


def correct(
    params: BodyParams,
    state: BodyState,
    x: Metre,
    v: MetrePerSecond,
    applied: Newton,
    dt: Second,
) -> BodyState:
    """Return the state one step ahead from the slope at the midpoint (x, v): the second stage.

    `applied` (N) is the force at the midpoint. The code unpacks the tuples and writes the equations
    out: in the interpreted loop an attribute access costs more than a product.
    """
    inertia, hydrostatic, viscous, quadratic, a0, a1, a2, a3, a4, b1, b2, b3, b4 = params
    x0, v0, y1, y2, y3, y4, y5 = state
    half = 0.5 * dt
    z1 = y1 + half * y2
    z2 = y2 + half * y3
    z3 = y3 + half * y4
    z4 = y4 + half * y5
    z5 = y5 + half * (v0 - a0 * y1 - a1 * y2 - a2 * y3 - a3 * y4 - a4 * y5)
    memory = b1 * z2 + b2 * z3 + b3 * z4 + b4 * z5
    force = applied - hydrostatic * x - memory - (viscous + quadratic * abs(v)) * v
    return BodyState(
        x0 + dt * v,
        v0 + dt * (force / inertia),
        y1 + dt * z2,
        y2 + dt * z3,
        y3 + dt * z4,
        y4 + dt * z5,
        y5 + dt * (v - a0 * z1 - a1 * z2 - a2 * z3 - a3 * z4 - a4 * z5),
    )
