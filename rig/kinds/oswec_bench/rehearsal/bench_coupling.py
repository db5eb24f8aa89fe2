"""The simulated bench between two ticks of the loop, as pure functions: steps and signals.

They run interpreted and compiled, with the bits of `BenchPlantDevices`, and convert its signals.
Nobody presses an emergency stop.
"""

from typing import NamedTuple

from controllers.signals import PanelSense
from rig.kinds.oswec_bench.tick import Sense
from rig.kinds.oswec_bench.tick.signals import (
    BrakeSense,
    Command,
    EncoderSense,
    ServoSense,
    WrenchSense,
)
from sim_plant.bench import dynamometer
from sim_plant.bench.dynamometer import BenchParams, BenchState
from sim_plant.bench.signals import Actuation, BenchReading
from sim_plant.bench.wires import PlantInterface


class Plant(NamedTuple):
    """Constants of the bench."""

    constants: BenchParams
    normals: tuple[float, ...]  # noise table
    age: float  # s, of the readings


class Device(NamedTuple):
    """State of the bench, and the signals between bench and loop."""

    state: BenchState
    in_transit: tuple[BenchReading, ...]  # delayed readings for the loop, oldest first
    actuation: Actuation  # last command
    fresh: int  # 1: ``actuation`` arrived after the plant's last step


def couple(world: PlantInterface) -> tuple[Plant, Device]:
    """Return a bench between two ticks; the world itself then no longer takes part."""
    now = world.conditions()
    device = Device(now.state, now.delay_line, now.actuation, now.fresh)
    return Plant(now.params, tuple(now.normals), now.delay), device


def advance_plant(plant: Plant, device: Device, tick: int, dt: float) -> Device:
    """Return the device one tick later, with the readings of ``tick`` in transit."""
    state, in_transit, actuation, fresh = device
    state = dynamometer.step(plant.constants, state, actuation, fresh, 0, plant.normals, dt)
    reading = dynamometer.sample(plant.constants, state, 0, tick, plant.normals)
    line = in_transit[1:] + (reading,)  # noqa: RUF005 - what numba compiles
    return Device(state, line, actuation, 0)


def actuate(plant: Plant, device: Device, command: Command, dt: float) -> tuple[Device, bool]:
    """Return the device with a command of the loop, and False: nothing interrupts a simulation."""
    return Device(device.state, device.in_transit, actuation_of(command), 1), False


def sense(reading: BenchReading, age: float) -> Sense:
    """Return the loop's input for a reading of the plant; ``age`` is its age, s."""
    return Sense(
        EncoderSense(reading.motor_counts, reading.shaft_counts, age),
        ServoSense(reading.current_a, reading.enabled, reading.fault, age),
        WrenchSense(reading.fx, reading.fy, reading.fz, reading.tx, reading.ty, reading.tz, age),
        BrakeSense(reading.brake_current_a, age),
        PanelSense(reading.e_stop, reading.limit_switch, age),
    )


def actuation_of(command: Command) -> Actuation:
    """Return the plant's input for a command of the loop."""
    return Actuation(
        command.enable,
        command.mode,
        command.volts,
        command.current,
        command.brake_current,
        command.locked,
    )
