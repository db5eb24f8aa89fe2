"""The bench's world: moved only by advance(dt). No clock, no I/O, seeded."""

from __future__ import annotations

import numpy as np

from sim_plant.bench import dynamometer
from sim_plant.bench.dynamometer import BenchParams, BenchState
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.stepper import Start, Stepper
from sim_plant.bench.wires import Wires, checked
from sim_plant.bench.words import OFF, Actuation, Reading, Truth
from sim_plant.sensors import NORMALS
from sim_plant.units import Second

__all__ = ["OFF", "Actuation", "BenchWorld", "Reading", "Stepper", "Truth"]


class BenchWorld(Wires):
    """A dynamometer bench."""

    def __init__(
        self, plant: BenchPlant, *, dt: float, seed: int, stepper: type[Stepper] = Stepper
    ) -> None:
        """Raises ValueError for a dt outside (0, 2 ms].

        ``stepper`` may be another execution of the same step, equal to the bit.
        """
        self.params = plant.build()
        normals = np.random.default_rng(seed).standard_normal(NORMALS).tolist()
        start = Start(self.params, dynamometer.initial(self.params), normals, checked(dt))
        self._stepper = stepper(start)
        super().__init__(dt, plant.sensors.delay_ticks.value, self._stepper.reading(0, 0))

    def truth(self) -> Truth:
        """Give what no sensor sees, for tests and comparison with estimates."""
        return true_state(self.params, self._stepper.state, self._tick * self._dt)

    def _move(self) -> Reading:
        return self._stepper.advance(self._actuation, self._fresh, self._pressed, self._tick)


def true_state(params: BenchParams, state: BenchState, time: Second) -> Truth:
    """Give what no sensor sees of a state."""
    return Truth(
        state.motor_angle,
        state.motor_velocity,
        state.shaft_angle,
        state.shaft_velocity,
        state.shaft_torque,
        params.motor.torque_per_current * state.drive.current,
        state.friction,
        state.brake.torque,
        state.power,
        time,
    )
