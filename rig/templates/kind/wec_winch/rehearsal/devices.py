"""The simulated float, in the loop's own process: m a = F - K x - D v."""

from typing import Any

from controllers.signals import AxisSense

from wec_winch.tick import Command, Sense


class SimulatedFloat:
    def __init__(self, plant: dict[str, float], rig: dict[str, Any], dt: float) -> None:
        self._plant, self._dt = plant, dt
        self._per_count, self._per_ampere = rig["metres_per_count"], rig["newtons_per_ampere"]
        self._x = self._v = self._current = 0.0
        self._on = 0

    def warm_up(self, dt: float) -> None:
        pass

    def read(self, now: float) -> Sense:
        plant, dt = self._plant, self._dt
        force = self._per_ampere * self._current - plant["stiffness_n_per_m"] * self._x
        self._v += dt * (force - plant["damping_n_s_per_m"] * self._v) / plant["mass_kg"]
        self._x += dt * self._v
        counts = round(self._x / self._per_count)
        return Sense(AxisSense(counts, 0.0, self._current, self._on, 0, 0.0))

    def write(self, command: Command) -> None:
        self._on = command.axis.enable
        self._current = command.axis.current if self._on else 0.0

    def stop(self, reason: int) -> None:
        self._on, self._current = 0, 0.0

    def close(self) -> None:
        pass


def connect(config: dict[str, Any], dt: float) -> SimulatedFloat:
    return SimulatedFloat(config["plant"], config["rig"], dt)
