"""The motors and sensors of a simulated rig of coupled modes, for its emulated devices."""

from __future__ import annotations

from collections.abc import Callable

from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.emulators.torque_drive import Motor, MotorReading
from sim_plant.modes.readings import READINGS_PER_AXIS
from sim_plant.modes.world import Actuation, World
from sim_plant.units import Ampere, Flag

SharedModes = SharedSimulation[World, Actuation]
"""A rig of coupled modes in its basin."""


def axis_motor(world: SharedModes, name: str) -> Motor:
    """Return the motor of an axis of the plant, on a stiff bus of its own."""
    index = list(world.world.model.plant.axes).index(name)
    first = READINGS_PER_AXIS * index

    def read() -> MotorReading:
        counts, current, enabled, fault = world.world.readings()[first : first + READINGS_PER_AXIS]
        return MotorReading(int(counts), current, int(enabled), int(fault))

    def actuate(current: Ampere, enable: Flag) -> None:
        drives = list(world.actuation.drives)
        drives[2 * index : 2 * index + 2] = current, float(enable)
        world.actuate(drives=tuple(drives))

    return Motor(read, actuate)


def axis_power(world: SharedModes, name: str) -> Callable[[], bool]:
    """Return a function that returns whether the drive of an axis is commanded to be on."""
    index = list(world.world.model.plant.axes).index(name)
    return lambda: bool(world.actuation.drives[2 * index + 1])


def sensor_reading(world: SharedModes, name: str) -> Callable[[], float]:
    """Return a function that returns the present reading of a sensor of the plant, in its unit."""
    plant = world.world.model.plant
    index = READINGS_PER_AXIS * len(plant.axes) + list(plant.sensors).index(name)
    return lambda: world.world.readings()[index]
