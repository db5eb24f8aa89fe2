"""Motors and stator of the simulated WaveBot, for its emulated drives."""

from __future__ import annotations

from functools import partial

from sim_plant.emulators.shared_world import SharedWorld
from sim_plant.emulators.stator_actuator import Carriage
from sim_plant.emulators.torque_drive import AnalogInput, Motor, MotorReading

# Fields of the readings on the two analog inputs of each drive.
_ANALOG_READINGS = {"heave": ("force_lcb", "force_trs"), "surge": ("string_pot", "rotor_angle")}


def heave_motor(world: SharedWorld) -> Motor:
    """Return the motor of heave, on the bus that the world models."""

    def read() -> MotorReading:
        now = world.readings()
        return MotorReading(
            now.heave_counts,
            now.heave_current,
            now.heave_enabled,
            now.heave_fault,
            now.drive_saturated,
            now.bus_voltage,
        )

    return Motor(
        read, lambda current, enable: world.actuate(heave_current=current, heave_enable=enable)
    )


def surge_motor(world: SharedWorld) -> Motor:
    """Return the motor of surge, on a stiff bus of its own."""

    def read() -> MotorReading:
        now = world.readings()
        return MotorReading(now.surge_counts, now.surge_current, now.surge_enabled, now.surge_fault)

    return Motor(
        read, lambda current, enable: world.actuate(surge_current=current, surge_enable=enable)
    )


MOTORS = {"heave": heave_motor, "surge": surge_motor}


def stator(world: SharedWorld) -> Carriage:
    """Return the stator of the magnetic spring."""
    return Carriage(
        lambda: world.readings().stator_position,
        lambda target, enable: world.actuate(stator_target=target, stator_enable=enable),
    )


def analog_inputs(
    world: SharedWorld, axis: str, per_volt: tuple[float, ...]
) -> tuple[AnalogInput, ...]:
    """Return the sensors on the two analog inputs of an axis' drive, units per volt."""
    return tuple(
        AnalogInput(partial(_reading, world, name), scale)
        for name, scale in zip(_ANALOG_READINGS[axis], per_volt, strict=True)
    )


def _reading(world: SharedWorld, name: str) -> float:
    return float(getattr(world.readings(), name))
