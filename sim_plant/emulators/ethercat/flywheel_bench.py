"""The bench behind the drives of a segment that stands alone: a flywheel, a carriage."""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.emulators.stator_actuator import Carriage
from sim_plant.emulators.torque_drive import Motor, MotorReading
from sim_plant.units import Ampere, Flag, Percent, Second


class FlywheelParams(NamedTuple):
    """Motor with a flywheel."""

    inertia: float = 0.02  # kg m^2
    torque_constant: float = 1.0  # N m/A
    damping: float = 0.05  # N m s/rad
    current_lag: Second = 0.001  # time constant of the current loop
    counts_per_turn: int = 20_000
    most_current: Ampere = 60.0


class FlywheelCommand(NamedTuple):
    """Command of the drive."""

    current: Ampere = 0.0
    enable: Flag = 0


class Flywheel:
    """A motor on a stiff bus with a flywheel; angle 0 at the start."""

    def __init__(self, params: FlywheelParams) -> None:
        self.params = params
        self.angle = 0.0  # rad
        self.speed = 0.0  # rad/s
        self.current: Ampere = 0.0
        self._command = FlywheelCommand()

    def actuate(self, command: FlywheelCommand, /) -> None:
        """Latch a command."""
        self._command = command

    def advance(self, dt: Second) -> None:
        """Advance by one tick: exact for current and speed while the command is constant."""
        params, command = self.params, self._command
        target = command.current if command.enable else 0.0
        target = max(-params.most_current, min(params.most_current, target))
        self.current += (target - self.current) * -math.expm1(-dt / params.current_lag)
        final = params.torque_constant * self.current / params.damping
        before = self.speed
        rate = params.damping / params.inertia
        self.speed += (final - before) * -math.expm1(-dt * rate)
        self.angle += final * dt - (self.speed - before) / rate

    @property
    def counts(self) -> int:
        """Encoder counts."""
        return math.floor(self.angle / (2.0 * math.pi) * self.params.counts_per_turn)

    @property
    def enabled(self) -> Flag:
        """Whether the motor has power."""
        return self._command.enable


SharedFlywheel = SharedSimulation[Flywheel, FlywheelCommand]


def flywheel_motor(world: SharedFlywheel) -> Motor:
    """Return the motor of the flywheel."""

    def read() -> MotorReading:
        wheel = world.world
        return MotorReading(wheel.counts, wheel.current, wheel.enabled)

    return Motor(read, lambda current, enable: world.actuate(current=current, enable=enable))


class CarriageCommand(NamedTuple):
    """Command of the actuator."""

    target: Percent = 0.0
    enable: Flag = 0


class SlidingCarriage:
    """A carriage that follows its actuator with a lag and stays where it is without power."""

    lag: Second = 0.005

    def __init__(self) -> None:
        self.position: Percent = 0.0
        self._command = CarriageCommand()

    def actuate(self, command: CarriageCommand, /) -> None:
        """Latch a command."""
        self._command = command

    def advance(self, dt: Second) -> None:
        """Advance by one tick."""
        if self._command.enable:
            self.position += (self._command.target - self.position) * -math.expm1(-dt / self.lag)


SharedCarriage = SharedSimulation[SlidingCarriage, CarriageCommand]


def sliding_carriage(world: SharedCarriage) -> Carriage:
    """Return the carriage for its actuator."""
    return Carriage(
        lambda: world.world.position,
        lambda target, enable: world.actuate(target=target, enable=enable),
    )
