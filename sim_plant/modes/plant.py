"""A rig of n coupled modes and its PTO axes as one step on flat arrays.

(M + A_inf + J) v' = F_exc - K x - F_rad - F_loss - F_stop + sum of the axes' forces, all matrices
full. Forces are forces on the body; absorbed power is negative. Explicit midpoint rule as in
wavebot.py: the error of a motion at 1 Hz and 1 ms is 7e-6 of its amplitude, of second order.

The state is one array: positions, velocities and radiation states, then `AXIS_SIZE` numbers for
each axis, then the midpoint and the forces, which only the step itself uses. The functions index
and loop, so that the same code runs on lists and, compiled, on arrays, with the same bits.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence
from typing import NamedTuple

from sim_plant import drive, sensors
from sim_plant.drive import UNLIMITED_CURRENT, DriveParams, DriveState
from sim_plant.sensors import Channel

# Numbers of an axis in the state: those of DriveState, then the shaft force (N or N m) with
# friction and reflected inertia, and the electric power (W), the mean over the last step.
AXIS_SIZE = 9
SHAFT_FORCE, ELECTRIC_POWER = 7, 8
# Parameters of an axis, in this order in `ModesParams.axis`.
AXIS_PARAMS = (
    "current_limit", "time_constant", "enable_delay", "watchdog", "force_per_current", "copper",
    "standby", "regeneration", "inertia", "viscous", "coulomb", "coulomb_velocity",
    "counts_per_unit", "count_offset", "current_noise",
)  # fmt: skip
AXIS_PARAM_COUNT = len(AXIS_PARAMS)
SENSOR_PARAM_COUNT = 5  # signal, its index, scale, offset, noise
READINGS_PER_AXIS = 4  # counts, current, enabled, fault
# Signals of a sensor; the index is that of the axis or mode.
AXIS_SIGNALS = (
    "position", "velocity", "force", "motor_force", "current", "mechanical_power", "electric_power"
)  # fmt: skip
MODE_POSITION, MODE_VELOCITY, ELEVATION = 7, 8, 9


Numbers = Sequence[float]
State = MutableSequence[float]


class ModesParams(NamedTuple):
    """Sizes and coefficients; matrices are flat, row by row."""

    modes: int
    axes: int
    states: int  # of the radiation
    inverse_mass: Sequence[float]  # (modes, modes)
    stiffness: Sequence[float]  # (modes, modes)
    linear: Sequence[float]  # damping of each mode
    quadratic: Sequence[float]
    stop_position: Sequence[float]  # of each mode
    stop_stiffness: Sequence[float]
    stop_damping: Sequence[float]
    source: Sequence[int]  # radiation, see radiation.Radiation
    partner: Sequence[int]
    diagonal: Sequence[float]
    cross: Sequence[float]
    input: Sequence[float]
    output: Sequence[float]  # (modes, states)
    factors: Sequence[float]  # (axes, modes): position of the axis by positions of the modes
    axis: Sequence[float]  # (axes, AXIS_PARAM_COUNT)
    sensors: Sequence[float]  # (sensors, SENSOR_PARAM_COUNT)
    sensor_count: int


def state_size(modes: int, axes: int, states: int) -> int:
    """Return the length of the state."""
    return 2 * (2 * modes + states) + axes * AXIS_SIZE + 2 * modes


def reading_size(axes: int, sensor_count: int) -> int:
    """Return the number of readings: four of each axis, the sensors, the wave elevation."""
    return axes * READINGS_PER_AXIS + sensor_count + 1


def axis_position(params: ModesParams, state: Numbers, axis: int, start: int) -> float:
    """Return the weighted sum of the modes' positions (start 0) or velocities (start n)."""
    value = 0.0
    for i in range(params.modes):
        value += params.factors[axis * params.modes + i] * state[start + i]
    return value


def friction(params: ModesParams, axis: int, velocity: float) -> float:
    """Return viscous and Coulomb friction of an axis: -(B v + F_c tanh(v / v_c)), N or N m."""
    at = axis * AXIS_PARAM_COUNT
    viscous, coulomb, width = params.axis[at + 9], params.axis[at + 10], params.axis[at + 11]
    return -(viscous * velocity + coulomb * math.tanh(velocity / width))


def end_stop(params: ModesParams, mode: int, position: float, velocity: float) -> float:
    """Return the force of an end stop: spring and damper beyond its position, never pulling."""
    limit = params.stop_position[mode]
    if position > limit:
        force = params.stop_stiffness[mode] * (position - limit)
        return -max(force + params.stop_damping[mode] * velocity, 0.0)
    if position < -limit:
        force = params.stop_stiffness[mode] * (-limit - position)
        return max(force - params.stop_damping[mode] * velocity, 0.0)
    return 0.0


def _slopes(
    params: ModesParams,
    state: State,
    at: int,
    first_axis: int,
    force: int,
    excitation: Numbers,
    following: Numbers,
    share: float,
) -> None:
    """Write the accelerations under the forces at a motion.

    `at`: where the motion starts in the state, `force`: where the forces are to be written, the
    accelerations after them. Excitation is (1 - share) of the present plus share of the following.
    """
    n, states = params.modes, params.states
    for i in range(n):
        x, v = state[at + i], state[at + n + i]
        value = excitation[i] + share * (following[i] - excitation[i])
        for j in range(n):
            value -= params.stiffness[i * n + j] * state[at + j]
        for k in range(states):
            value -= params.output[i * states + k] * state[at + 2 * n + k]
        value -= (params.linear[i] + params.quadratic[i] * abs(v)) * v
        state[force + i] = value + end_stop(params, i, x, v)
    for a in range(params.axes):
        mean_current = state[first_axis + a * AXIS_SIZE + 1]
        motor = params.axis[a * AXIS_PARAM_COUNT + 4] * mean_current
        applied = motor + friction(params, a, axis_position(params, state, a, at + n))
        for i in range(n):
            state[force + i] += params.factors[a * n + i] * applied
    for i in range(n):
        value = 0.0
        for j in range(n):
            value += params.inverse_mass[i * n + j] * state[force + j]
        state[force + n + i] = value


def step(
    params: ModesParams,
    state: State,
    actuation: Numbers,
    fresh: int,
    excitation: Numbers,
    following: Numbers,
    dt: float,
) -> None:
    """Advance the state in place by dt (s).

    `actuation`: current (A) and enable (0 or 1) of each axis; `fresh` is 1 if it arrived since the
    last step. Excitation of each mode (N or N m) now and after the step is linear between them;
    motor forces are the exact means of the current loops.
    """
    n, states, axes = params.modes, params.states, params.axes
    motion = 2 * n + states
    middle = motion + axes * AXIS_SIZE
    force = middle + motion
    for a in range(axes):
        _step_drive(params, state, motion + a * AXIS_SIZE, a, actuation, fresh, dt)

    _slopes(params, state, 0, motion, force, excitation, following, 0.0)
    half = 0.5 * dt
    for i in range(n):
        state[middle + i] = state[i] + half * state[n + i]
        state[middle + n + i] = state[n + i] + half * state[force + n + i]
    for k in range(states):
        state[middle + 2 * n + k] = state[2 * n + k] + half * _memory_slope(params, state, 0, k)

    _slopes(params, state, middle, motion, force, excitation, following, 0.5)
    for a in range(axes):
        _power(params, state, motion + a * AXIS_SIZE, a, middle, force)
    # The slopes of the radiation states are taken at the midpoint, so all may be written at once.
    for i in range(n):
        state[i] += dt * state[middle + n + i]
        state[n + i] += dt * state[force + n + i]
    for k in range(states):
        state[2 * n + k] += dt * _memory_slope(params, state, middle, k)


def _memory_slope(params: ModesParams, state: State, at: int, k: int) -> float:
    """Return the slope of a radiation state at the motion that starts at `at`."""
    memory = at + 2 * params.modes
    slope = params.diagonal[k] * state[memory + k]
    slope += params.cross[k] * state[memory + params.partner[k]]
    return slope + params.input[k] * state[at + params.modes + params.source[k]]


def _step_drive(
    params: ModesParams,
    state: State,
    at: int,
    axis: int,
    actuation: Numbers,
    fresh: int,
    dt: float,
) -> None:
    """Advance enable logic, watchdog and current loop of an axis, whose numbers start at `at`."""
    p = axis * AXIS_PARAM_COUNT
    after = drive.drive_step(
        DriveParams(params.axis[p], params.axis[p + 1], params.axis[p + 2], params.axis[p + 3]),
        DriveState(
            state[at],
            state[at + 1],
            int(state[at + 2]),
            int(state[at + 3]),
            state[at + 4],
            state[at + 5],
            int(state[at + 6]),
        ),
        actuation[2 * axis],
        int(actuation[2 * axis + 1]),
        fresh,
        1,
        0,
        UNLIMITED_CURRENT,
        dt,
    )
    state[at] = after.current
    state[at + 1] = after.mean_current
    state[at + 2] = float(after.enabled)
    state[at + 3] = float(after.fault)
    state[at + 4] = after.enable_time
    state[at + 5] = after.command_age
    state[at + 6] = float(after.saturated)


def _power(params: ModesParams, state: State, at: int, axis: int, middle: int, force: int) -> None:
    """Write the shaft force and the electric power of an axis over this step.

    Electric power is motor force times velocity plus copper loss; of what is negative (absorbed)
    the regeneration efficiency arrives at the bus. Standby power is always drawn.
    """
    n, p = params.modes, axis * AXIS_PARAM_COUNT
    current = state[at + 1]
    motor = params.axis[p + 4] * current
    velocity = axis_position(params, state, axis, middle + n)
    acceleration = axis_position(params, state, axis, force + n)
    state[at + SHAFT_FORCE] = (
        motor + friction(params, axis, velocity) - params.axis[p + 8] * acceleration
    )
    power = motor * velocity + params.axis[p + 5] * current * current
    if power < 0.0:
        power *= params.axis[p + 7]
    state[at + ELECTRIC_POWER] = power + params.axis[p + 6]


def signal(params: ModesParams, state: Numbers, kind: int, index: int, elevation: float) -> float:
    """Return the true value of a signal of a sensor."""
    n = params.modes
    if kind == ELEVATION:
        return elevation
    if kind == MODE_POSITION:
        return state[index]
    if kind == MODE_VELOCITY:
        return state[n + index]
    at = 2 * n + params.states + index * AXIS_SIZE
    if kind == 0:
        return axis_position(params, state, index, 0)
    if kind == 1:
        return axis_position(params, state, index, n)
    if kind == 2:
        return state[at + SHAFT_FORCE]
    if kind == 3:
        return params.axis[index * AXIS_PARAM_COUNT + 4] * state[at]
    if kind == 4:
        return state[at]
    if kind == 5:
        return state[at + SHAFT_FORCE] * axis_position(params, state, index, n)
    return state[at + ELECTRIC_POWER]


def sample(
    params: ModesParams,
    state: Numbers,
    tick: int,
    elevation: float,
    normals: Numbers,
    readings: State,
) -> None:
    """Write the readings at a state; `normals` is the noise table, `tick` its index."""
    at = 2 * params.modes + params.states
    for a in range(params.axes):
        p, r = a * AXIS_PARAM_COUNT, a * READINGS_PER_AXIS
        position = axis_position(params, state, a, 0)
        count = sensors.encoder_count(params.axis[p + 12], int(params.axis[p + 13]), position)
        readings[r] = float(count)
        channel = Channel(0.0, params.axis[p + 14], 0.0, 4 * a + 1, 20011 * a)
        readings[r + 1] = sensors.measure(channel, state[at + a * AXIS_SIZE], tick, normals)
        readings[r + 2] = state[at + a * AXIS_SIZE + 2]
        readings[r + 3] = state[at + a * AXIS_SIZE + 3]
    first = params.axes * READINGS_PER_AXIS
    for s in range(params.sensor_count):
        p = s * SENSOR_PARAM_COUNT
        value = signal(params, state, int(params.sensors[p]), int(params.sensors[p + 1]), elevation)
        scale, offset, noise = params.sensors[p + 2], params.sensors[p + 3], params.sensors[p + 4]
        channel = Channel(offset, noise, 0.0, 4 * s + 3, 30011 * (s + 1))
        readings[first + s] = sensors.measure(channel, scale * value, tick, normals)
    readings[first + params.sensor_count] = elevation
