"""Interpreted execution of the flap's step; a compiled execution may replace it."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.bench.signals import Actuation, BenchReading
from sim_plant.flap import oswec
from sim_plant.flap.oswec import FlapParams, FlapState
from sim_plant.units import Flag, NewtonMetre, Second


class StepperInputs(NamedTuple):
    """Constructor argument of a stepper."""

    params: FlapParams
    state: FlapState
    normals: list[float]  # noise table
    dt: Second


class Stepper:
    """Interpreted stepper: advances the flap's state by one tick and samples its sensors."""

    def __init__(self, start: StepperInputs) -> None:
        self.params, self.state, self._normals, self._dt = start

    def advance(
        self,
        actuation: Actuation,
        fresh: Flag,
        stopped: Flag,
        excitation: NewtonMetre,
        tick: int,
    ) -> BenchReading:
        """Step to ``tick`` with the wave excitation moment there; return the sensor readings."""
        self.state = state = oswec.step(
            self.params, self.state, actuation, fresh, stopped, excitation, self._normals, self._dt
        )
        return oswec.sample(self.params, state, stopped, tick, self._normals)

    def reading(self, stopped: Flag, tick: int) -> BenchReading:
        """Return the sensor readings at the present state."""
        return oswec.sample(self.params, self.state, stopped, tick, self._normals)
