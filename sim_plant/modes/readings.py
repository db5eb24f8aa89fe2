"""Readings of a plant of coupled modes: encoders, currents and sensors of any of its signals.

The functions read the state that `plant.step` advances and run compiled as that does.
"""

from __future__ import annotations

from sim_plant import sensors
from sim_plant.modes.plant import (
    AXIS_PARAM_COUNT,
    AXIS_SIZE,
    BACKLASH,
    ELECTRIC_POWER,
    HYDRAULIC,
    SHAFT_FORCE,
    ModesParams,
    Numbers,
    State,
    axis_position,
    bus_place,
    hydraulic_params,
    line_pull,
    motion_size,
    motor_params,
    motor_velocity,
    pto_place,
    spring_forces,
)  # fmt: skip
from sim_plant.parts import hydraulic
from sim_plant.sensors import Channel

SENSOR_PARAM_COUNT = 5  # signal, its index, scale, offset, noise
READINGS_PER_AXIS = 4  # counts, current, enabled, fault
# Signals of a sensor, by their code; the index is that of the axis, mode, line or spring.
AXIS_SIGNALS = (
    "position", "velocity", "force", "motor_force", "current", "mechanical_power",
    "electric_power", "motor_position", "motor_velocity", "pressure",
)  # fmt: skip
MODE_POSITION, MODE_VELOCITY, ELEVATION, TENSION = 10, 11, 12, 13
BUS_VOLTAGE, SUPPLY_POWER, DUMP_POWER = 14, 15, 16
SPRING_FORCE, STATOR_FORCE = 17, 18


def reading_size(params: ModesParams) -> int:
    """Return the number of readings: four of each axis, the sensors, the wave elevation."""
    return params.axes * READINGS_PER_AXIS + params.sensor_count + 1


def signal(params: ModesParams, state: Numbers, kind: int, index: int, elevation: float) -> float:
    """Return the true value of a signal of a sensor."""
    n = params.modes
    if kind < len(AXIS_SIGNALS):
        return _axis_signal(params, state, kind, index)
    if kind == MODE_POSITION:
        return state[index]
    if kind == MODE_VELOCITY:
        return state[n + index]
    if kind == ELEVATION:
        return elevation
    if kind == TENSION:
        return line_pull(params, state, index, 0).tension
    if kind == SPRING_FORCE:
        return spring_forces(params, state, index, 0).axis
    if kind == STATOR_FORCE:
        return spring_forces(params, state, index, 0).stator
    at = bus_place(params)
    if kind == BUS_VOLTAGE:
        return state[at + 1]
    if kind == SUPPLY_POWER:
        return state[at + 7]
    return state[at + 8]


def _axis_signal(params: ModesParams, state: Numbers, kind: int, axis: int) -> float:
    """Return a signal of `AXIS_SIGNALS` by its index."""
    at = motion_size(params) + axis * AXIS_SIZE
    if kind == 0:
        return axis_position(params, state, axis, 0)
    if kind == 1:
        return axis_position(params, state, axis, params.modes)
    if kind == 2:
        return state[at + SHAFT_FORCE]
    if kind == 3:
        return _motor_force(params, state, axis)
    if kind == 4:
        return state[at]
    if kind == 5:
        return state[at + SHAFT_FORCE] * axis_position(params, state, axis, params.modes)
    if kind == 6:
        return state[at + ELECTRIC_POWER]
    if kind == 7:
        return encoder_position(params, state, axis)
    if kind == 8:
        return motor_velocity(params, state, axis, 0)
    oil = hydraulic_params(params.axis, axis)
    return hydraulic.pressure(oil, state[pto_place(params, 0, axis)])


def _motor_force(params: ModesParams, state: Numbers, axis: int) -> float:
    """Return the force of the motor on the axis, of a hydraulic PTO that of its braking torque."""
    own, at = motor_params(params.axis, axis), motion_size(params) + axis * AXIS_SIZE
    force = own.force_per_current * state[at]
    if own.kind != HYDRAULIC:
        return force
    oil = hydraulic_params(params.axis, axis)
    brake = hydraulic.brake_torque(force, motor_velocity(params, state, axis, 0))
    pressure = oil.low_pressure + brake / oil.displacement  # that holds against the brake
    return hydraulic.cylinder_force(oil, pressure, axis_position(params, state, axis, params.modes))


def encoder_position(params: ModesParams, state: Numbers, axis: int) -> float:
    """Return the position that the encoder sees: of the motor, if there is play, else the axis."""
    if params.axis[axis * AXIS_PARAM_COUNT] == BACKLASH:
        return state[pto_place(params, 0, axis)]
    return axis_position(params, state, axis, 0)


def sample(
    params: ModesParams,
    state: Numbers,
    tick: int,
    elevation: float,
    normals: Numbers,
    readings: State,
) -> None:
    """Write the readings at a state; `normals` is the noise table, `tick` its index."""
    for a in range(params.axes):
        own, r = motor_params(params.axis, a), a * READINGS_PER_AXIS
        at = motion_size(params) + a * AXIS_SIZE
        position = encoder_position(params, state, a)
        count = sensors.encoder_count(own.counts_per_unit, int(own.count_offset), position)
        readings[r] = float(count)
        channel = Channel(0.0, own.current_noise, 0.0, 4 * a + 1, 20011 * a)
        readings[r + 1] = sensors.measure(channel, state[at], tick, normals)
        readings[r + 2] = state[at + 2]
        readings[r + 3] = state[at + 3]
    first = params.axes * READINGS_PER_AXIS
    for s in range(params.sensor_count):
        p = s * SENSOR_PARAM_COUNT
        value = signal(params, state, int(params.sensors[p]), int(params.sensors[p + 1]), elevation)
        scale, offset, noise = params.sensors[p + 2], params.sensors[p + 3], params.sensors[p + 4]
        channel = Channel(offset, noise, 0.0, 4 * s + 3, 30011 * (s + 1))
        readings[first + s] = sensors.measure(channel, scale * value, tick, normals)
    readings[first + params.sensor_count] = elevation
