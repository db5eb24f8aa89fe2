"""The bench's world: moved only by advance(dt). No clock, no I/O, seeded."""

from __future__ import annotations

import numpy as np

from sim_plant.bench import dynamometer
from sim_plant.bench.dynamometer import BenchParams, BenchState
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.signals import OFF, Actuation, Reading, Truth
from sim_plant.bench.stepper import Start, Stepper
from sim_plant.bench.wires import Wires, checked
from sim_plant.sensors import NORMALS
from sim_plant.units import Count, Radian, Second

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
        self._slipped: Count = 0
        self._braking = True

    def slip_coupling(self, angle: Radian) -> None:
        """Let the shaft slip in its coupling: its encoder stands ahead of the motor for good."""
        self._slipped += round(self.params.sensors.shaft_counts * angle)

    def lose_brake(self, lost: bool = True) -> None:
        """Take the brake's current away, whatever is asked for, or give it back."""
        self._braking = not lost

    def truth(self) -> Truth:
        """Give what no sensor sees, for tests and comparison with estimates."""
        return true_state(self.params, self._stepper.state, self._tick * self._dt)

    def _move(self) -> Reading:
        wires = self._actuation
        if not self._braking:
            wires = wires._replace(brake_current_a=0.0)
        reading = self._stepper.advance(wires, self._fresh, self._pressed, self._tick)
        if self._slipped:
            reading = reading._replace(shaft_counts=reading.shaft_counts + self._slipped)
        return reading


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
