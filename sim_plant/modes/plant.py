"""A rig of n coupled modes and its PTO axes as one step on flat arrays.

(M + A_inf + J) v' = F_exc - K x - F_rad + F_drag + F_stop + F_lines + F_springs + sum of the axes'
forces, all matrices full. Forces are forces on the body; absorbed power is negative. Explicit
midpoint rule as in wavebot.py: the error of a motion at 1 Hz and 1 ms is 7e-6 of its amplitude, of
second order.

Each force is a part (`sim_plant.parts`); this module adds them up. What moves is one array:
positions, velocities and radiation states, then two numbers of each PTO (`PTO_STATES`). It is
followed by `AXIS_SIZE` numbers of each axis, those of the bus, the midpoint and the forces, which
only the step itself uses. The functions index and loop, so that the same code runs on lists and,
compiled, on arrays, with the same bits.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from typing import NamedTuple

from sim_plant.modes import springs
from sim_plant.parts import bus, drag, drive, end_stop, friction, gear, hydraulic, linear_motor
from sim_plant.parts import mooring_line as lines
from sim_plant.parts.bus import BusParams, BusState
from sim_plant.parts.drive import UNLIMITED_CURRENT, DriveParams, DriveState
from sim_plant.parts.end_stop import EndStopParams
from sim_plant.parts.friction import FrictionParams
from sim_plant.parts.hydraulic import HydraulicParams
from sim_plant.parts.mooring_line import LineParams, Pull
from sim_plant.parts.spring import MagneticForces

# How the motor drives the axis: without play (its inertia is part of the mass matrix), through a
# backlash, with an inertia of its own, or by oil. The two numbers of a PTO are: none, the motor's
# position and velocity (m, m/s at the axis), the gas volume and the speed of the hydraulic motor.
RIGID, BACKLASH, HYDRAULIC = 0, 1, 2
PTO_STATES = 2
# Numbers of an axis in the state: those of DriveState, then the force on the axis beyond gear and
# reflected inertia (N or N m), and the electric power (W), the mean over the last step.
AXIS_SIZE = 9
SHAFT_FORCE, ELECTRIC_POWER = 7, 8


class MotorParams(NamedTuple):
    """Motor, losses and encoder of an axis; forces and motion at the axis."""

    kind: float  # RIGID, BACKLASH, HYDRAULIC
    force_per_current: float  # N/A; of a hydraulic PTO the generator's torque, N m/A
    inertia: float  # reflected
    efficiency: float  # of the gear
    cogging: float  # N
    pitch: float  # m, of the cogging
    resistance: float  # ohm
    linear_loss: float  # W/A
    standby: float  # W
    regeneration: float  # efficiency of power that flows back
    back_emf: float  # V per m/s; 0: the bus voltage does not limit the current
    voltage_drop: float  # V/A of the motor
    modulation: float  # largest motor voltage per bus voltage
    current_noise: float  # A
    counts_per_unit: float
    count_offset: float


# Parameters of an axis, in this order in `ModesParams.axis`, and where each part starts.
AXIS_PARTS = (
    MotorParams, DriveParams, FrictionParams, EndStopParams, EndStopParams, HydraulicParams
)  # fmt: skip
MOTOR = 0
DRIVE = MOTOR + len(MotorParams._fields)
FRICTION = DRIVE + len(DriveParams._fields)
STOP = FRICTION + len(FrictionParams._fields)
TEETH = STOP + len(EndStopParams._fields)
OIL = TEETH + len(EndStopParams._fields)
AXIS_PARAM_COUNT = OIL + len(HydraulicParams._fields)
BUS_SIZE = len(BusState._fields) + 2  # then the power of supply and of dump resistors, W
LINE_PARAM_COUNT = len(LineParams._fields)

Numbers = Sequence[float]
State = MutableSequence[float]


class ModesParams(NamedTuple):
    """Sizes and coefficients; matrices are flat, row by row."""

    modes: int
    axes: int
    states: int  # of the radiation
    line_count: int
    spring_count: int
    bus_count: int  # 0 or 1
    sensor_count: int
    inverse_mass: Numbers  # (modes, modes)
    stiffness: Numbers  # (modes, modes)
    linear: Numbers  # damping of each mode
    quadratic: Numbers
    stops: Numbers  # (modes, 3): EndStopParams
    source: Sequence[int]  # radiation, see radiation.Radiation
    partner: Sequence[int]
    diagonal: Numbers
    cross: Numbers
    input: Numbers
    output: Numbers  # (modes, states)
    factors: Numbers  # (axes, modes): position of the axis by positions of the modes
    axis: Numbers  # (axes, AXIS_PARAM_COUNT)
    lines: Numbers  # (lines, LINE_PARAM_COUNT)
    line_factors: Numbers  # (lines, 3, modes): displacement of the fairlead by positions
    springs: Numbers  # (springs, SPRING_PARAM_COUNT), then the tables of their stators
    bus: Numbers  # BusParams
    sensors: Numbers  # (sensors, SENSOR_PARAM_COUNT)


def motion_size(params: ModesParams) -> int:
    """Return the number of what moves: of modes, radiation and PTOs."""
    return 2 * params.modes + params.states + PTO_STATES * params.axes


def bus_place(params: ModesParams) -> int:
    """Return where the numbers of the bus start in the state."""
    return motion_size(params) + AXIS_SIZE * params.axes


def state_size(params: ModesParams) -> int:
    """Return the length of the state."""
    return bus_place(params) + BUS_SIZE * params.bus_count + motion_size(params) + 2 * params.modes


# The functions of single parts take the arrays that they read, not all parameters: compiled code
# copies these wherever it does not inline a call.
def motor_params(p: Numbers, axis: int) -> MotorParams:
    """Return the motor of an axis; `p` is that of `ModesParams.axis`."""
    at = axis * AXIS_PARAM_COUNT + MOTOR
    return MotorParams(
        p[at], p[at + 1], p[at + 2], p[at + 3], p[at + 4], p[at + 5], p[at + 6], p[at + 7],
        p[at + 8], p[at + 9], p[at + 10], p[at + 11], p[at + 12], p[at + 13], p[at + 14],
        p[at + 15],
    )  # fmt: skip


def friction_params(p: Numbers, axis: int) -> FrictionParams:
    """Return the friction of an axis."""
    at = axis * AXIS_PARAM_COUNT + FRICTION
    return FrictionParams(p[at], p[at + 1], p[at + 2])


def stop_params(numbers: Numbers, at: int) -> EndStopParams:
    """Return the end stops, or teeth, whose numbers start at `at`."""
    return EndStopParams(numbers[at], numbers[at + 1], numbers[at + 2])


def hydraulic_params(p: Numbers, axis: int) -> HydraulicParams:
    """Return the oil side of an axis."""
    at = axis * AXIS_PARAM_COUNT + OIL
    return HydraulicParams(
        p[at], p[at + 1], p[at + 2], p[at + 3], p[at + 4], p[at + 5], p[at + 6], p[at + 7],
        p[at + 8], p[at + 9], p[at + 10],
    )  # fmt: skip


def axis_position(params: ModesParams, state: Numbers, axis: int, start: int) -> float:
    """Return the weighted sum of the modes' positions (start 0) or velocities (start n)."""
    value = 0.0
    for i in range(params.modes):
        value += params.factors[axis * params.modes + i] * state[start + i]
    return value


def pto_place(params: ModesParams, at: int, axis: int) -> int:
    """Return where the two numbers of a PTO are in a motion that starts at `at`."""
    return at + 2 * params.modes + params.states + PTO_STATES * axis


def _pto_numbers(params: ModesParams, state: Numbers, axis: int, at: int) -> tuple[float, float]:
    """Return the two numbers of a PTO in a motion that starts at `at`."""
    pto = pto_place(params, at, axis)
    return state[pto], state[pto + 1]


def motor_side(p: Numbers, axis: int, current: float, position: float, velocity: float) -> float:
    """Return motor force, friction, loss of the gear and cogging at a motion of the motor."""
    own, dry = motor_params(p, axis), friction_params(p, axis)
    motor = own.force_per_current * current
    force = motor + friction.force(dry, velocity)
    if own.efficiency < 1.0:
        force += gear.load_loss(own.efficiency, dry.width, motor, velocity)
    if own.cogging > 0.0:
        force += linear_motor.cogging_force(own.cogging, own.pitch, position)
    return force


def pto_force(
    p: Numbers,
    axis: int,
    current: float,
    position: float,
    velocity: float,
    pto: tuple[float, float],
) -> float:
    """Return the force on an axis in motion, N or N m; `pto` has the two numbers of its PTO.

    Of a rigid axis without the reflected inertia, which is in the mass matrix.
    """
    kind = p[axis * AXIS_PARAM_COUNT]
    if kind == RIGID:
        return motor_side(p, axis, current, position, velocity)
    first, second = pto
    if kind == BACKLASH:
        teeth = stop_params(p, axis * AXIS_PARAM_COUNT + TEETH)
        return gear.backlash_force(teeth, first - position, second - velocity)
    oil = hydraulic_params(p, axis)
    force = hydraulic.cylinder_force(oil, hydraulic.pressure(oil, first), velocity)
    return force + friction.force(friction_params(p, axis), velocity)


def pto_slopes(
    p: Numbers,
    axis: int,
    current: float,
    position: float,
    velocity: float,
    pto: tuple[float, float],
) -> tuple[float, float]:
    """Return the slopes of the two numbers of a PTO, from the same inputs."""
    own, (first, second) = motor_params(p, axis), pto
    if own.kind == BACKLASH:
        teeth = pto_force(p, axis, current, position, velocity, pto)
        return second, (motor_side(p, axis, current, first, second) - teeth) / own.inertia
    oil = hydraulic_params(p, axis)
    brake = hydraulic.brake_torque(own.force_per_current * current, second)
    return (
        hydraulic.volume_rate(oil, first, velocity, second),
        hydraulic.acceleration(oil, hydraulic.pressure(oil, first), second, brake),
    )


def line_pull(params: ModesParams, state: Numbers, line: int, at: int) -> Pull:
    """Return tension and force of a mooring line at the motion that starts at `at`."""
    n, p, k = params.modes, params.lines, line * LINE_PARAM_COUNT
    dx, dy, dz, vx, vy, vz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        x, v, f = state[at + i], state[at + n + i], 3 * line * n + i
        dx += params.line_factors[f] * x
        dy += params.line_factors[f + n] * x
        dz += params.line_factors[f + 2 * n] * x
        vx += params.line_factors[f] * v
        vy += params.line_factors[f + n] * v
        vz += params.line_factors[f + 2 * n] * v
    rest = LineParams(p[k], p[k + 1], p[k + 2], p[k + 3], p[k + 4], p[k + 5])
    return lines.pull(rest, dx, dy, dz, vx, vy, vz)


def spring_forces(params: ModesParams, state: Numbers, spring: int, at: int) -> MagneticForces:
    """Return the forces of a spring on its axis and on its stator at a motion."""
    other = springs.stator_axis(params.springs, spring)
    travel = axis_position(params, state, other, at) if other != springs.NO_AXIS else 0.0
    position = axis_position(params, state, springs.axis_of(params.springs, spring), at)
    return springs.forces(params.springs, spring, position, travel)


def _slopes(
    params: ModesParams,
    state: State,
    at: int,
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
        value += drag.force(params.linear[i], params.quadratic[i], v)
        state[force + i] = value + end_stop.force(stop_params(params.stops, 3 * i), x, v)
    for a in range(params.axes):
        current = state[motion_size(params) + a * AXIS_SIZE + 1]
        position = axis_position(params, state, a, at)
        velocity = axis_position(params, state, a, at + n)
        pto = _pto_numbers(params, state, a, at)
        applied = pto_force(params.axis, a, current, position, velocity, pto)
        stops = stop_params(params.axis, a * AXIS_PARAM_COUNT + STOP)
        if stops.position < end_stop.FAR:
            applied += end_stop.force(stops, position, velocity)
        for i in range(n):
            state[force + i] += params.factors[a * n + i] * applied
    for line in range(params.line_count):
        pull, f = line_pull(params, state, line, at), 3 * line * n
        for i in range(n):
            state[force + i] += (
                params.line_factors[f + i] * pull.x
                + params.line_factors[f + n + i] * pull.y
                + params.line_factors[f + 2 * n + i] * pull.z
            )
    for s in range(params.spring_count):
        a, b = springs.axis_of(params.springs, s), springs.stator_axis(params.springs, s)
        own = spring_forces(params, state, s, at)
        for i in range(n):
            state[force + i] += params.factors[a * n + i] * own.axis
            if b != springs.NO_AXIS:
                state[force + i] += params.factors[b * n + i] * own.stator
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
    motion, half = motion_size(params), 0.5 * dt
    middle = bus_place(params) + BUS_SIZE * params.bus_count
    force = middle + motion
    for a in range(axes):
        _step_drive(params, state, a, actuation, fresh, dt)

    _slopes(params, state, 0, force, excitation, following, 0.0)
    for i in range(n):
        state[middle + i] = state[i] + half * state[n + i]
        state[middle + n + i] = state[n + i] + half * state[force + n + i]
    for k in range(states):
        state[middle + 2 * n + k] = state[2 * n + k] + half * _memory_slope(params, state, 0, k)
    for a in range(axes):
        if params.axis[a * AXIS_PARAM_COUNT] != RIGID:
            _move_pto(params, state, a, 0, middle, half)

    _slopes(params, state, middle, force, excitation, following, 0.5)
    for a in range(axes):
        _power(params, state, a, middle, force)
        if params.axis[a * AXIS_PARAM_COUNT] != RIGID:
            _move_pto(params, state, a, middle, 0, dt)
    if params.bus_count:
        _step_bus(params, state, dt)
    # All slopes are taken at the midpoint, so all may be written at once.
    for i in range(n):
        state[i] += dt * state[middle + n + i]
        state[n + i] += dt * state[force + n + i]
    for k in range(states):
        state[2 * n + k] += dt * _memory_slope(params, state, middle, k)


def _move_pto(params: ModesParams, state: State, axis: int, at: int, to: int, dt: float) -> None:
    """Write the numbers of a PTO plus dt times their slopes at the motion `at` to that at `to`."""
    pto, n = pto_place(params, 0, axis), params.modes
    current = state[motion_size(params) + axis * AXIS_SIZE + 1]
    position = axis_position(params, state, axis, at)
    velocity = axis_position(params, state, axis, at + n)
    numbers = _pto_numbers(params, state, axis, at)
    first, second = pto_slopes(params.axis, axis, current, position, velocity, numbers)
    state[to + pto] = state[pto] + dt * first
    state[to + pto + 1] = state[pto + 1] + dt * second


def _memory_slope(params: ModesParams, state: State, at: int, k: int) -> float:
    """Return the slope of a radiation state at the motion that starts at `at`."""
    memory = at + 2 * params.modes
    slope = params.diagonal[k] * state[memory + k]
    slope += params.cross[k] * state[memory + params.partner[k]]
    return slope + params.input[k] * state[at + params.modes + params.source[k]]


def motor_velocity(params: ModesParams, state: Numbers, axis: int, at: int) -> float:
    """Return the velocity of the motor at a motion: at the axis, of a hydraulic PTO in rad/s."""
    if params.axis[axis * AXIS_PARAM_COUNT] == RIGID:
        return axis_position(params, state, axis, at + params.modes)
    return state[pto_place(params, at, axis) + 1]


def _step_drive(
    params: ModesParams, state: State, axis: int, actuation: Numbers, fresh: int, dt: float
) -> None:
    """Advance enable logic, watchdog and current loop of an axis; a bus may trip or limit it."""
    p, at = axis * AXIS_PARAM_COUNT + DRIVE, motion_size(params) + axis * AXIS_SIZE
    trip, max_current = 0, UNLIMITED_CURRENT
    if params.bus_count:
        own, voltage = motor_params(params.axis, axis), state[bus_place(params) + 1]
        trip = bus.voltage_trip(bus_params(params), _bus_state(params, state))
        if own.back_emf > 0.0:
            # A motor needs back-EMF plus drop, a generator back-EMF less drop.
            induced = own.back_emf * motor_velocity(params, state, axis, 0)
            if actuation[2 * axis] < 0.0:
                induced = -induced
            max_current = max(own.modulation * voltage - induced, 0.0) / own.voltage_drop
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
        trip,
        max_current,
        dt,
    )
    state[at] = after.current
    state[at + 1] = after.mean_current
    state[at + 2] = float(after.enabled)
    state[at + 3] = float(after.fault)
    state[at + 4] = after.enable_time
    state[at + 5] = after.command_age
    state[at + 6] = float(after.saturated)


def _power(params: ModesParams, state: State, axis: int, middle: int, force: int) -> None:
    """Write the shaft force and the electric power of an axis over this step.

    Electric power is motor force times velocity plus the losses of winding and drive; of what is
    negative (absorbed) the regeneration efficiency arrives at the bus. Standby power is always
    drawn.
    """
    own, at = motor_params(params.axis, axis), motion_size(params) + axis * AXIS_SIZE
    current = state[at + 1]
    position = axis_position(params, state, axis, middle)
    axis_velocity = axis_position(params, state, axis, middle + params.modes)
    pto = _pto_numbers(params, state, axis, middle)
    shaft = pto_force(params.axis, axis, current, position, axis_velocity, pto)
    motor, velocity = own.force_per_current * current, motor_velocity(params, state, axis, middle)
    if own.kind == RIGID:
        shaft -= own.inertia * axis_position(params, state, axis, force + params.modes)
    if own.kind == HYDRAULIC:
        motor = -hydraulic.brake_torque(motor, velocity)
    state[at + SHAFT_FORCE] = shaft
    power = motor * velocity + (own.resistance * current * current + own.linear_loss * abs(current))
    if power < 0.0:
        power *= own.regeneration
    standby = own.standby
    if params.bus_count and state[bus_place(params) + 1] < bus_params(params).brownout:
        standby = 0.0  # the drive's logic is off
    state[at + ELECTRIC_POWER] = power + standby


def bus_params(params: ModesParams) -> BusParams:
    """Return the parameters of the bus that all drives share."""
    p = params.bus
    return BusParams(
        p[0], p[1], int(p[2]), p[3], p[4], p[5], p[6], p[7], int(p[8]), p[9], p[10], p[11], p[12]
    )


def _bus_state(params: ModesParams, state: Numbers) -> BusState:
    at = bus_place(params)
    return BusState(
        state[at], state[at + 1], int(state[at + 2]), state[at + 3], state[at + 4], state[at + 5],
        state[at + 6],
    )  # fmt: skip


def _step_bus(params: ModesParams, state: State, dt: float) -> None:
    """Advance the bus under the electric power of all axes."""
    at, motion = bus_place(params), motion_size(params)
    power = 0.0
    for a in range(params.axes):
        power += state[motion + a * AXIS_SIZE + ELECTRIC_POWER]
    before = _bus_state(params, state)
    after = bus.bus_step(bus_params(params), before, power, dt)
    state[at] = after.energy
    state[at + 1] = after.voltage
    state[at + 2] = float(after.dumping)
    state[at + 3] = after.undervoltage_time
    state[at + 4] = after.supplied
    state[at + 5] = after.consumed
    state[at + 6] = after.dumped
    state[at + 7] = (after.supplied - before.supplied) / dt
    state[at + 8] = (after.dumped - before.dumped) / dt


def place(params: ModesParams, state: State, position: Numbers, velocity: Numbers) -> None:
    """Set the motion of the modes; a motor behind a backlash gets that of its axis."""
    n = params.modes
    for i in range(n):
        state[i] = position[i]
        state[n + i] = velocity[i]
    for a in range(params.axes):
        if params.axis[a * AXIS_PARAM_COUNT] == BACKLASH:
            state[pto_place(params, 0, a)] = axis_position(params, state, a, 0)
            state[pto_place(params, 0, a) + 1] = axis_position(params, state, a, n)
