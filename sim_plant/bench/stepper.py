"""Interpreted execution of the step of bench or flap; a compiled execution may replace it."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

from sim_plant.bench import dynamometer
from sim_plant.bench.signals import Actuation, BenchReading
from sim_plant.units import Flag, NewtonMetre, Second


class StepperInputs(NamedTuple):
    """Constructor argument of a stepper."""

    params: Any  # of the stepper's plant
    state: Any
    normals: list[float]  # noise table
    dt: Second


class Stepper:
    """Interpreted stepper: advances the plant's state by one tick and samples its sensors."""

    plant: ClassVar[Any] = dynamometer  # module with the functions `step` and `sample`

    def __init__(self, start: StepperInputs) -> None:
        self.params, self.state, self._normals, self._dt = start

    def advance(
        self,
        actuation: Actuation,
        fresh: Flag,
        stopped: Flag,
        tick: int,
        *excitation: NewtonMetre,
    ) -> BenchReading:
        """Step to ``tick``, a flap with the wave excitation moment there; return the readings."""
        self.state = self.plant.step(
            self.params, self.state, actuation, fresh, stopped, *excitation, self._normals, self._dt
        )
        return self.reading(stopped, tick)

    def reading(self, stopped: Flag, tick: int) -> BenchReading:
        """Return the sensor readings at the present state."""
        reading: BenchReading = self.plant.sample(
            self.params, self.state, stopped, tick, self._normals
        )
        return reading
