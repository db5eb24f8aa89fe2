"""The WaveBot as one pure step: drives, motors, spring, stator, hull, bus, analyser.

Explicit midpoint rule: at 1 ms the position error is below 3e-6 of the stroke, and of second order.
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
from sim_plant.sensors import HeaveForces, SensorParams
from sim_plant.signals import Actuation, Readings
from sim_plant.stator_force import StatorForceParams
from sim_plant.surge import SurgeParams, SurgeState
from sim_plant.units import Flag, Metre, MetrePerSecond, Newton, Percent, Second


class WaveBotParams(NamedTuple):
    """Parameters of the step, as floats."""

    body: BodyParams
    pto: PtoParams
    spring: SpringParams
    stator: StatorForceParams
    electrics: ElectricsParams
    surge: SurgeParams
    sensors: SensorParams


class Hoist(NamedTuple):
    """Heave imposed by a hoist during the next step, and the hoist's force in the last one."""

    active: Flag
    middle_position: Metre
    middle_velocity: MetrePerSecond
    position: Metre  # at the end of the step
    velocity: MetrePerSecond
    force: Newton  # on the hull, in addition to all others


class Probes(NamedTuple):
    """Last sample of the basin probes and its age."""

    probe_1: Metre
    probe_2: Metre
    probe_3: Metre
    age: Second


class Excitation(NamedTuple):
    """Wave excitation on the hull at one tick."""

    heave: Newton
    surge: Newton


class WaveBotState(NamedTuple):
    """State of the step; `passive_force` is spring + drivetrain friction at this state."""

    body: BodyState
    electrics: ElectricsState
    stator: StatorState
    surge: SurgeState
    passive_force: Newton
    hoist: Hoist
    probes: Probes
    forces: HeaveForces


NO_EXCITATION = Excitation(0.0, 0.0)
NO_HOIST = Hoist(0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_PROBE_SAMPLE = Probes(0.0, 0.0, 0.0, 0.0)


def initial(params: WaveBotParams, stator: Percent, position: Metre) -> WaveBotState:
    """Return the state at rest at a heave position (m) and a stator position (%), drives off."""
    stator_state = magnetic_spring.stator_at_rest(params.spring, stator)
    spring = magnetic_spring.force(params.spring, stator_state.rate, position)
    return WaveBotState(
        BodyState(position, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        electrics.initial(params.electrics),
        stator_state,
        surge.initial(params.surge, 0.0),
        spring,
        NO_HOIST,
        NO_PROBE_SAMPLE,
        HeaveForces(spring, 0.0),
    )


def passive_force(
    params: WaveBotParams, rate: float, position: Metre, velocity: MetrePerSecond, lateral: Newton
) -> Newton:
    """Return spring plus drivetrain friction, the forces between TRS and LCB, N on the body."""
    spring = magnetic_spring.force(params.spring, rate, position)
    return spring + pto.friction(params.pto, velocity, lateral)


def step(
    params: WaveBotParams,
    state: WaveBotState,
    actuation: Actuation,
    fresh: int,
    excitation: Excitation,
    next_excitation: Excitation,
    dt: Second,
) -> WaveBotState:
    """Advance the rig by dt under a latched actuation and the excitation at both ends.

    `fresh` is 1 if the actuation arrived since the last step (the drives' watchdogs count its age).
    Excitation is linear within the step; motor forces are the exact means of the current loops.
    """
    body_state, electrics_state, stator, surge_state, passive, hoist, probes, forces = state
    drive_state = electrics.command_step(
        params.electrics,
        electrics_state,
        actuation.heave_current,
        actuation.heave_enable,
        actuation.conducting,
        fresh,
        body_state.velocity,
        dt,
    )
    motor = params.pto.force_per_current * drive_state.mean_current
    next_surge = surge.step(
        params.surge,
        surge_state,
        actuation.surge_current,
        actuation.surge_enable,
        fresh,
        excitation.surge,
        next_excitation.surge,
        dt,
    )

    x, v = body.predict(params.body, body_state, excitation.heave + motor + passive, 0.5 * dt)
    if hoist.active == 1:
        x, v = hoist.middle_position, hoist.middle_velocity
    guide = 0.5 * (surge_state.guide_force + next_surge.guide_force)
    passive = passive_force(params, stator.rate, x, v, guide)
    applied = 0.5 * (excitation.heave + next_excitation.heave) + motor + passive
    end = body.correct(params.body, body_state, x, v, applied, dt)
    if hoist.active == 1:
        end, hoist = impose_motion(params.body, end, hoist, dt)

    next_stator = magnetic_spring.stator_step(
        params.spring, stator, actuation.stator_target, actuation.stator_enable, dt
    )
    passive = passive_force(
        params, next_stator.rate, end.position, end.velocity, next_surge.guide_force
    )
    power_ac = motor * v + pto.copper_loss(params.pto, motor)
    next_electrics = electrics.power_step(
        params.electrics, electrics_state, drive_state, actuation.conducting, power_ac, dt
    )
    probe_1, probe_2, probe_3, age = probes
    next_probes = Probes(probe_1, probe_2, probe_3, age + dt)
    end_motor = params.pto.force_per_current * next_electrics.drive.current
    lag = params.sensors.heave_force_lag
    next_forces = sensors.amplify(lag, forces, end_motor + passive, end_motor, dt)
    return WaveBotState(
        end, next_electrics, next_stator, next_surge, passive, hoist, next_probes, next_forces
    )


def impose_motion(
    params: BodyParams, free: BodyState, hoist: Hoist, dt: Second
) -> tuple[BodyState, Hoist]:
    """Return the body at the imposed position, and the hoist with its mean force over the step."""
    imposed, x, v, position, velocity, _ = hoist
    force = params.inertia * (velocity - free.velocity) / dt
    body_state = BodyState(position, velocity, free.z1, free.z2, free.z3, free.z4, free.z5)
    return body_state, Hoist(imposed, x, v, position, velocity, force)


def sample(
    params: WaveBotParams,
    state: WaveBotState,
    tick: int,
    elevation: Metre,
    normals: Sequence[float],
) -> Readings:
    """Return the sensor readings at a state; `normals` is the noise table, `tick` its index."""
    body_state, electrics_state, stator, surge_state, _, _, probes, forces = state
    sensor_params, stator_params = params.sensors, params.stator
    measure = sensors.measure
    position, current, analyser = (
        body_state.position,
        electrics_state.drive.current,
        electrics_state.analyser,
    )
    angle = params.spring.angle_per_metre * position
    axial = stator_force.axial_force(stator_params, stator.rate, stator.slope, angle)
    axial_a = stator_params.share_a * axial
    slew = stator_force.slew_force(stator_params, stator.rate, angle)
    return Readings(
        sensors.encoder_count(sensor_params.counts_per_metre, sensor_params.count_offset, position),
        measure(sensor_params.current, current, tick, normals),
        electrics_state.drive.enabled,
        electrics_state.drive.fault,
        sensors.encoder_count(
            sensor_params.counts_per_metre, sensor_params.surge_offset, surge_state.body.position
        ),
        measure(sensor_params.surge_current, surge_state.drive.current, tick, normals),
        surge_state.drive.enabled,
        surge_state.drive.fault,
        measure(sensor_params.force_lcb, forces.lcb, tick, normals),
        measure(sensor_params.force_trs, forces.trs, tick, normals),
        measure(sensor_params.force_slew, slew, tick, normals),
        measure(sensor_params.force_stator_a, axial_a, tick, normals),
        measure(sensor_params.force_stator_b, axial - axial_a, tick, normals),
        measure(sensor_params.string_pot, position, tick, normals),
        measure(sensor_params.rotor_angle, angle, tick, normals),
        stator.position,
        stator.arrived,
        analyser.power_ac,
        analyser.power_dc,
        electrics.bus_voltage(params.electrics, electrics_state),
        analyser.age,
        electrics_state.drive.saturated,
        electrics.dump_mask(params.electrics, electrics_state),
        electrics.is_conducting(electrics_state),
        elevation,
        probes.probe_1,
        probes.probe_2,
        probes.probe_3,
        probes.age,
    )
