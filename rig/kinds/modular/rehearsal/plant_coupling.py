"""One compiled tick of a plant of coupled modes, between two ticks of the loop.

The order of operations is that of `sim_plant.modes.world.World`, the functions are its own. All
numbers of variable count are in columns of `Plant`, which the tick changes in place.
"""

from typing import Any, NamedTuple

from sim_plant.modes.plant import AXIS_PARAM_COUNT, STOP, ModesParams, axis_position, step
from sim_plant.modes.readings import sample
from sim_plant.wave_maker import onset_ramp

CONTACT_TICKS = 4096
"""Ticks whose contacts are kept, a power of two: more than a simulation executes at a time."""


class Plant(NamedTuple):
    """A plant in its sea; each simulation has its own columns of state and signals."""

    params: ModesParams
    state: Any
    table: Any  # excitation of each mode (N or N m), then elevation (m); one line per tick
    onset: float  # s
    onset_ticks: int  # after which the sea has its full height
    waves: Any  # line of the present tick
    following: Any  # line of the next tick
    normals: Any
    drives: Any  # current (A) and enable of each axis
    readings: Any
    in_transit: Any  # delayed readings for the loop, a ring
    age: float  # s, of the readings that the loop gets
    scales: Any  # of the rig's sensors
    offsets: Any
    contact: Any  # of the last `CONTACT_TICKS` ticks: 1.0 if a mode or an axis was at an end stop


class Device(NamedTuple):
    """Numbers of the coupling before a tick."""

    wave_tick: int  # since the wave maker was started; -1 while it is off
    line: int  # of that tick in the table
    oldest: int  # index of the oldest readings in transit
    trigger: int  # 1: the wave maker runs
    new_input: int  # 1: the drives got a command after the plant's last step


def at_end_stop(params: ModesParams, state: Any) -> float:
    """Return 1.0 if a mode or an axis is beyond the position of one of its end stops, else 0.0."""
    for i in range(params.modes):
        if abs(state[i]) > params.stops[3 * i]:
            return 1.0
    for a in range(params.axes):
        if abs(axis_position(params, state, a, 0)) > params.axis[a * AXIS_PARAM_COUNT + STOP]:
            return 1.0
    return 0.0


def write_waves(plant: Plant, wave_tick: int, line: int, dt: float, waves: Any) -> None:
    """Write excitation and elevation of a tick of the wave clock; zeros before its start."""
    count = len(waves)
    factor = 1.0
    if wave_tick < plant.onset_ticks:
        factor = onset_ramp(wave_tick * dt, plant.onset)
    for i in range(count):
        waves[i] = factor * plant.table[line * count + i] if wave_tick >= 0 else 0.0


def advance_plant(plant: Plant, device: Device, tick: int, dt: float) -> Device:
    """Return the device one tick later, with the plant's readings of ``tick`` in transit."""
    wave_tick, line, oldest, trigger, new_input = device
    waves, following, readings = plant.waves, plant.following, plant.readings
    if wave_tick >= 0:
        wave_tick += 1
        line += 1  # no remainder: a division is slow
        if line * len(waves) == len(plant.table):
            line = 0
    write_waves(plant, wave_tick, line, dt, following)
    step(plant.params, plant.state, plant.drives, new_input, waves, following, dt)
    plant.contact[tick & (CONTACT_TICKS - 1)] = at_end_stop(plant.params, plant.state)
    for i in range(len(waves)):
        waves[i] = following[i]
    sample(plant.params, plant.state, tick, waves[len(waves) - 1], plant.normals, readings)
    for i in range(len(readings)):
        plant.in_transit[oldest + i] = readings[i]
    oldest += len(readings)
    if oldest == len(plant.in_transit):
        oldest = 0
    return Device(wave_tick, line, oldest, trigger, 0)


def actuate(plant: Plant, device: Device, trigger: int, dt: float) -> tuple[Device, bool]:
    """Return the device whose drives got a command, with the wave maker switched, and False:
    nothing of a modular rig interrupts a simulation."""
    wave_tick, line = device.wave_tick, device.line
    if trigger != device.trigger:
        wave_tick, line = 0 if trigger != 0 else -1, 0
        write_waves(plant, wave_tick, line, dt, plant.waves)
    return Device(wave_tick, line, device.oldest, trigger, 1), False
