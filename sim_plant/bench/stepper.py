"""Interpreted execution of the bench's step; a compiled execution may replace it."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.bench import dynamometer
from sim_plant.bench.dynamometer import BenchParams, BenchState
from sim_plant.bench.signals import Actuation, BenchReading
from sim_plant.units import Flag, Second


class StepperInputs(NamedTuple):
    """Constructor argument of a stepper."""

    params: BenchParams
    state: BenchState
    normals: list[float]  # noise table
    dt: Second


class Stepper:
    """Interpreted stepper: advances the bench's state by one tick and samples its sensors."""

    def __init__(self, start: StepperInputs) -> None:
        self.params, self.state, self._normals, self._dt = start

    def advance(self, actuation: Actuation, fresh: Flag, stopped: Flag, tick: int) -> BenchReading:
        """Step to ``tick`` and return the sensor readings there."""
        self.state = state = dynamometer.step(
            self.params, self.state, actuation, fresh, stopped, self._normals, self._dt
        )
        return dynamometer.sample(self.params, state, stopped, tick, self._normals)

    def reading(self, stopped: Flag, tick: int) -> BenchReading:
        """Return the sensor readings at the present state."""
        return dynamometer.sample(self.params, self.state, stopped, tick, self._normals)
