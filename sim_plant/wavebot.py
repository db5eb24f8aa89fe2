"""WaveBot as one pure step: drives, motors, spring, stator, hull in heave and surge, bus, analyser.

Explicit midpoint rule: at 1 ms the position error is below 3e-6 of the stroke, of second order.
Force is on the body; absorbed power is negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from sim_plant import (
    body,
    electrics,
    magnetic_spring,
    pto,
    sensors,
    stator_force,
    surge,
)
from sim_plant.body import BodyParams, BodyState
from sim_plant.electrics import ElectricsParams, ElectricsState
from sim_plant.magnetic_spring import SpringParams, StatorState
from sim_plant.pto import PtoParams
from sim_plant.sensors import SensorParams
from sim_plant.signals import Actuation, Readings
from sim_plant.stator_force import StatorForceParams
from sim_plant.surge import SurgeParams, SurgeState
from sim_plant.units import Flag, Metre, MetrePerSecond, Newton, Percent, Second


class WaveBotParams(NamedTuple):
    """Everything the step needs, real floats."""

    body: BodyParams
    pto: PtoParams
    spring: SpringParams
    stator: StatorForceParams
    electrics: ElectricsParams
    surge: SurgeParams
    sensors: SensorParams


class Hoist(NamedTuple):
    """Heave imposed by a hoist during the step to come, and the force it took in the last one."""

    imposed: Flag
    middle_position: Metre
    middle_velocity: MetrePerSecond
    position: Metre  # at the end of the step
    velocity: MetrePerSecond
    force: Newton  # on the hull, beside all others


class Probes(NamedTuple):
    """Last sample of the basin probes and its age."""

    one: Metre
    two: Metre
    three: Metre
    age: Second


class Excitation(NamedTuple):
    """Wave excitation on the hull at one tick."""

    heave: Newton
    surge: Newton


class WaveBotState(NamedTuple):
    """Everything the step remembers; `passive` is spring + drivetrain friction at this state."""

    body: BodyState
    electrics: ElectricsState
    stator: StatorState
    surge: SurgeState
    passive: Newton
    hoist: Hoist
    probes: Probes


STILL = Excitation(0.0, 0.0)
FREE = Hoist(0, 0.0, 0.0, 0.0, 0.0, 0.0)
NOTHING_SEEN = Probes(0.0, 0.0, 0.0, 0.0)


def initial(params: WaveBotParams, stator: Percent, position: Metre) -> WaveBotState:
    """Give the state at rest at a heave position (m) and a stator position (%), drives off."""
    standing = magnetic_spring.stator_at(params.spring, stator)
    return WaveBotState(
        BodyState(position, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        electrics.initial(params.electrics),
        standing,
        surge.initial(params.surge, 0.0),
        magnetic_spring.force(params.spring, standing.rate, position),
        FREE,
        NOTHING_SEEN,
    )


def passive_force(
    params: WaveBotParams, rate: float, position: Metre, velocity: MetrePerSecond, lateral: Newton
) -> Newton:
    """Give spring plus drivetrain friction, the two forces between TRS and LCB, N on the body."""
    spring = magnetic_spring.force(params.spring, rate, position)
    return spring + pto.friction(params.pto, velocity, lateral)


def step(
    params: WaveBotParams,
    state: WaveBotState,
    actuation: Actuation,
    fresh: int,
    now: Excitation,
    after: Excitation,
    dt: Second,
) -> WaveBotState:
    """Advance the rig by dt under a latched actuation and the excitation at both ends.

    `fresh` is 1 if the actuation came since the last step (the drives' watchdogs count its age).
    Excitation is linear within the step; motor forces are the exact mean of the current loops.
    """
    start, electric, stator, lateral, passive, hoist, probes = state
    current, enable, target, stator_enable, _, surge_current, surge_enable, conducting = actuation
    driven = electrics.command(
        params.electrics, electric, current, enable, conducting, fresh, start.velocity, dt
    )
    motor = params.pto.force_per_current * driven.mean_current
    aside = surge.step(
        params.surge, lateral, surge_current, surge_enable, fresh, now.surge, after.surge, dt
    )

    x, v = body.predict(params.body, start, now.heave + motor + passive, 0.5 * dt)
    if hoist.imposed == 1:
        x, v = hoist.middle_position, hoist.middle_velocity
    guide = 0.5 * (lateral.guide + aside.guide)
    passive = passive_force(params, stator.rate, x, v, guide)
    applied = 0.5 * (now.heave + after.heave) + motor + passive
    end = body.correct(params.body, start, x, v, applied, dt)
    if hoist.imposed == 1:
        end, hoist = held(params.body, end, hoist, dt)

    moved = magnetic_spring.stator_step(params.spring, stator, target, stator_enable, dt)
    passive = passive_force(params, moved.rate, end.position, end.velocity, aside.guide)
    power_ac = motor * v + pto.copper_loss(params.pto, motor)
    supplied = electrics.power(params.electrics, electric, driven, conducting, power_ac, dt)
    one, two, three, age = probes
    seen = Probes(one, two, three, age + dt)
    return WaveBotState(end, supplied, moved, aside, passive, hoist, seen)


def held(params: BodyParams, free: BodyState, hoist: Hoist, dt: Second) -> tuple[BodyState, Hoist]:
    """Give the body where the hoist puts it, and the mean force which that took over the step."""
    imposed, x, v, position, velocity, _ = hoist
    force = params.inertia * (velocity - free.velocity) / dt
    there = BodyState(position, velocity, free.z1, free.z2, free.z3, free.z4, free.z5)
    return there, Hoist(imposed, x, v, position, velocity, force)


def sample(
    params: WaveBotParams,
    state: WaveBotState,
    tick: int,
    elevation: Metre,
    normals: Sequence[float],
) -> Readings:
    """Give what the sensors read at a state; `normals` is the noise table, `tick` its clock."""
    hull, electric, stator, lateral, passive, _, probes = state
    errors, shares = params.sensors, params.stator
    measure = sensors.measure
    position, current, analyser = hull.position, electric.drive.current, electric.analyser
    motor = params.pto.force_per_current * current
    angle = params.spring.angle_per_metre * position
    axial = stator_force.axial_force(shares, stator.rate, stator.slope, angle)
    axial_a = shares.share_a * axial
    slew = stator_force.slew_force(shares, stator.rate, angle)
    return Readings(
        sensors.count(errors.counts_per_metre, errors.count_offset, position),
        measure(errors.current, current, tick, normals),
        electric.drive.enabled,
        electric.drive.fault,
        sensors.count(errors.counts_per_metre, errors.surge_offset, lateral.body.position),
        measure(errors.surge_current, lateral.drive.current, tick, normals),
        lateral.drive.enabled,
        lateral.drive.fault,
        measure(errors.force_lcb, motor + passive, tick, normals),
        measure(errors.force_trs, motor, tick, normals),
        measure(errors.force_slew, slew, tick, normals),
        measure(errors.force_stator_a, axial_a, tick, normals),
        measure(errors.force_stator_b, axial - axial_a, tick, normals),
        measure(errors.string_pot, position, tick, normals),
        measure(errors.rotor_angle, angle, tick, normals),
        stator.position,
        stator.arrived,
        analyser.power_ac,
        analyser.power_dc,
        electrics.bus_voltage(params.electrics, electric),
        analyser.age,
        electric.drive.saturated,
        electrics.dump_mask(params.electrics, electric),
        electrics.conducts(electric),
        elevation,
        probes.one,
        probes.two,
        probes.three,
        probes.age,
    )
