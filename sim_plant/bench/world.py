"""The bench's world: moved only by advance(dt). No clock, no I/O, seeded."""

from __future__ import annotations

from collections import deque

import numpy as np

from sim_plant.bench import dynamometer
from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.stepper import Start, Stepper
from sim_plant.bench.words import OFF, Actuation, Reading, Truth
from sim_plant.sensors import NORMALS
from sim_plant.units import Second

__all__ = ["OFF", "Actuation", "BenchWorld", "Reading", "Stepper", "Truth"]


class BenchWorld:
    """A dynamometer bench.

    Time order of tick k: sense() gives what was sampled at tick k - delay_ticks, actuate() latches
    a command, advance(dt) moves to tick k + 1 under it. The drive drops out when commands cease.
    """

    def __init__(
        self, plant: BenchPlant, *, dt: float, seed: int, stepper: type[Stepper] = Stepper
    ) -> None:
        """Raises ValueError for a dt outside (0, 2 ms].

        ``stepper`` may be another execution of the same step, equal to the bit.
        """
        if not 0.0 < dt <= 0.002:
            raise ValueError(f"dt must be in (0, 0.002] s, got {dt}")
        self.params = plant.build()
        self._dt = dt
        normals = np.random.default_rng(seed).standard_normal(NORMALS).tolist()
        start = dynamometer.initial(self.params)
        self._stepper = stepper(Start(self.params, start, normals, dt))
        self._actuation = OFF
        self._fresh = 0
        self._pressed = 0
        self._tick = 0
        delay = plant.sensors.delay_ticks.value
        self.delay: Second = delay * dt  # age of a reading
        still = self._stepper.reading(0, 0)
        self._line: deque[Reading] = deque([still] * (delay + 1), maxlen=delay + 1)

    def actuate(self, actuation: Actuation) -> None:
        """Latch a command and reset its age."""
        self._actuation = actuation
        self._fresh = 1

    def press_e_stop(self, pressed: bool = True) -> None:
        """Open the hard-wired stop chain, or close it: the drive's power stage follows."""
        self._pressed = 1 if pressed else 0

    def advance(self, dt: float) -> None:
        """Move one tick on. Raises ValueError for another dt than that of construction."""
        if dt != self._dt:
            raise ValueError(f"this world ticks in {self._dt} s, not {dt} s")
        self._tick += 1
        self._line.append(
            self._stepper.advance(self._actuation, self._fresh, self._pressed, self._tick)
        )
        self._fresh = 0

    def sense(self) -> Reading:
        """Give what came over the wires last."""
        return self._line[0]

    def truth(self) -> Truth:
        """Give what no sensor sees, for tests and comparison with estimates."""
        params, state = self.params, self._stepper.state
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
            self._tick * self._dt,
        )
