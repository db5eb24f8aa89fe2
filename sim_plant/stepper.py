"""What moves the plant's state by one tick; another execution of the same step may stand in."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant import wavebot
from sim_plant.signals import Actuation, Readings
from sim_plant.units import Metre, MetrePerSecond, Newton, Second
from sim_plant.wavebot import STILL, Excitation, Hoist, Probes, WaveBotParams, WaveBotState


class Start(NamedTuple):
    """All a stepper is made of."""

    params: WaveBotParams
    state: WaveBotState
    normals: list[float]  # noise table
    dt: Second


class Stepper:
    """Moves the plant's state by one tick and samples its sensors; interpreted."""

    def __init__(self, start: Start) -> None:
        self.params, self.state, self._normals, self._dt = start
        self.excitation = STILL  # at the present tick

    def advance(
        self,
        actuation: Actuation,
        fresh: int,
        heave: Newton,
        surge: Newton,
        tick: int,
        elevation: Metre,
    ) -> Readings:
        """Step to ``tick``, where the waves excite with heave and surge; give what sensors read."""
        after = Excitation(heave, surge)
        self.state = state = wavebot.step(
            self.params, self.state, actuation, fresh, self.excitation, after, self._dt
        )
        self.excitation = after
        return wavebot.sample(self.params, state, tick, elevation, self._normals)

    def readings(self, tick: int, elevation: Metre) -> Readings:
        """Give what the sensors read at the present state."""
        return wavebot.sample(self.params, self.state, tick, elevation, self._normals)

    def motion(self) -> tuple[Metre, MetrePerSecond]:
        """Give heave position and velocity now."""
        hull = self.state.body
        return hull.position, hull.velocity

    def hold(self, hoist: Hoist) -> None:
        """Impose heave in the steps to come, or leave it free."""
        self.state = self.state._replace(hoist=hoist)

    def see(self, probes: Probes) -> None:
        """Put a new sample of the basin probes on the wire."""
        self.state = self.state._replace(probes=probes)
