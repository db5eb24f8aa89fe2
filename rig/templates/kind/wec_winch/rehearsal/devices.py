"""The float at its motor: m a = F - K x - D v, in the loop's own process or behind a drive."""

from typing import Any, NamedTuple

from controllers.signals import AxisSense
from rig.emulation.in_process import PlantDevices

from wec_winch.tick import Command, Sense


class Actuation(NamedTuple):
    current: float  # A
    enable: int


REST = Actuation(0.0, 0)


class Float:
    delay = 0.0

    def __init__(self, config: dict[str, Any]) -> None:
        self._plant, rig = config["plant"], config["rig"]
        self._per_count, self._per_ampere = rig["metres_per_count"], rig["newtons_per_ampere"]
        self._x = self._v = 0.0
        self.actuation = REST

    def actuate(self, actuation: Actuation) -> None:
        self.actuation = actuation if actuation.enable else REST

    def advance(self, dt: float) -> None:
        plant = self._plant
        force = self._per_ampere * self.actuation.current - plant["stiffness_n_per_m"] * self._x
        self._v += dt * (force - plant["damping_n_s_per_m"] * self._v) / plant["mass_kg"]
        self._x += dt * self._v

    @property
    def counts(self) -> int:
        return round(float(self._x / self._per_count))


class SimulatedFloat(PlantDevices):
    def __init__(self, plant: Float, dt: float) -> None:
        super().__init__(plant, REST, dt)
        self._float = plant

    def read(self, now: float) -> Sense:
        self._advance_to(now)
        current, on = self._float.actuation
        return Sense(AxisSense(self._float.counts, 0.0, current, on, 0, 0.0))

    def write(self, command: Command) -> None:
        self._float.actuate(Actuation(command.axis.current, command.axis.enable))


def connect(config: dict[str, Any], dt: float) -> SimulatedFloat:
    return SimulatedFloat(Float(config), dt)
