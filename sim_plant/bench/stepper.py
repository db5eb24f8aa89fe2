"""What moves the bench's state by one tick; another execution of the same step may stand in."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.bench import dynamometer
from sim_plant.bench.dynamometer import BenchParams, BenchState
from sim_plant.bench.signals import Actuation, Reading
from sim_plant.units import Flag, Second


class Start(NamedTuple):
    """All a stepper is made of."""

    params: BenchParams
    state: BenchState
    normals: list[float]  # noise table
    dt: Second


class Stepper:
    """Moves the bench's state by one tick and samples its sensors; interpreted."""

    def __init__(self, start: Start) -> None:
        self.params, self.state, self._normals, self._dt = start

    def advance(self, actuation: Actuation, fresh: Flag, stopped: Flag, tick: int) -> Reading:
        """Step to ``tick``; give what sensors read there."""
        self.state = state = dynamometer.step(
            self.params, self.state, actuation, fresh, stopped, self._normals, self._dt
        )
        return dynamometer.sample(self.params, state, stopped, tick, self._normals)

    def reading(self, stopped: Flag, tick: int) -> Reading:
        """Give what the sensors read at the present state."""
        return dynamometer.sample(self.params, self.state, stopped, tick, self._normals)
