"""Interpreted execution of the plant's step; a compiled execution may replace it."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant import wavebot
from sim_plant.signals import Actuation, Readings
from sim_plant.units import Metre, MetrePerSecond, Newton, Second
from sim_plant.wavebot import NO_EXCITATION, Excitation, Hoist, Probes, WaveBotParams, WaveBotState


class StepperInputs(NamedTuple):
    """Constructor argument of a stepper."""

    params: WaveBotParams
    state: WaveBotState
    normals: list[float]  # noise table
    dt: Second


class Stepper:
    """Interpreted stepper: advances the plant's state by one tick and samples its sensors."""

    def __init__(self, start: StepperInputs) -> None:
        self.params, self.state, self._normals, self._dt = start
        self.excitation = NO_EXCITATION  # at the present tick

    def advance(
        self,
        actuation: Actuation,
        fresh: int,
        heave: Newton,
        surge: Newton,
        tick: int,
        elevation: Metre,
    ) -> Readings:
        """Step to ``tick`` with the excitation forces there; return the readings."""
        excitation = Excitation(heave, surge)
        self.state = state = wavebot.step(
            self.params, self.state, actuation, fresh, self.excitation, excitation, self._dt
        )
        self.excitation = excitation
        return wavebot.sample(self.params, state, tick, elevation, self._normals)

    def readings(self, tick: int, elevation: Metre) -> Readings:
        """Return the sensor readings at the present state."""
        return wavebot.sample(self.params, self.state, tick, elevation, self._normals)

    def motion(self) -> tuple[Metre, MetrePerSecond]:
        """Return the present heave position and velocity."""
        body_state = self.state.body
        return body_state.position, body_state.velocity

    def set_hoist(self, hoist: Hoist) -> None:
        """Impose heave in the steps to come, or leave it free."""
        self.state = self.state._replace(hoist=hoist)

    def set_probes(self, probes: Probes) -> None:
        """Set a new sample of the basin probes."""
        self.state = self.state._replace(probes=probes)
