"""What moves the flap's state by one tick; another execution of the same step may stand in."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.bench.signals import Actuation, Reading
from sim_plant.flap import oswec
from sim_plant.flap.oswec import FlapParams, FlapState
from sim_plant.units import Flag, NewtonMetre, Second


class Start(NamedTuple):
    """All a stepper is made of."""

    params: FlapParams
    state: FlapState
    normals: list[float]  # noise table
    dt: Second


class Stepper:
    """Moves the flap's state by one tick and samples its sensors; interpreted."""

    def __init__(self, start: Start) -> None:
        self.params, self.state, self._normals, self._dt = start

    def advance(
        self, actuation: Actuation, fresh: Flag, stopped: Flag, excitation: NewtonMetre, tick: int
    ) -> Reading:
        """Step to ``tick``, where the waves excite; give what sensors read there."""
        self.state = state = oswec.step(
            self.params, self.state, actuation, fresh, stopped, excitation, self._normals, self._dt
        )
        return oswec.sample(self.params, state, stopped, tick, self._normals)

    def reading(self, stopped: Flag, tick: int) -> Reading:
        """Give what the sensors read at the present state."""
        return oswec.sample(self.params, self.state, stopped, tick, self._normals)
