"""The flap's world: a flume with one sea, moved only by advance(dt). No clock, no I/O, seeded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim_plant import waves
from sim_plant.bench.signals import OFF, Actuation, Reading, Truth
from sim_plant.bench.wires import Wires, checked
from sim_plant.bench.world import true_state
from sim_plant.flap import oswec
from sim_plant.flap.body import FlapBodyState
from sim_plant.flap.parameters import FlapPlant
from sim_plant.flap.stepper import Start, Stepper
from sim_plant.sensors import NORMALS
from sim_plant.units import Flag, Metre, NewtonMetre, Radian, Second
from sim_plant.wave_maker import ramp
from sim_plant.waves import Sea, WaveTables

__all__ = ["OFF", "Actuation", "FlapTruth", "FlapWorld", "Reading", "Stepper"]


class FlapTruth(NamedTuple):
    """What no sensor sees, at the present tick; torques are on the flap."""

    driveline: Truth  # its shaft is the flap's; its power, positive, goes to the flap
    radiation: NewtonMetre
    excitation: NewtonMetre
    elevation: Metre
    wave_clock: Second


class FlapWorld(Wires):
    """The flap in its flume, on the wires of the bench and a wave maker."""

    def __init__(
        self,
        plant: FlapPlant,
        sea: Sea,
        *,
        dt: float,
        seed: int,
        stepper: type[Stepper] = Stepper,
    ) -> None:
        """Raises ValueError for a dt outside (0, 2 ms] or if the sea repeats in no whole dt.

        ``stepper`` may be another execution of the same step, equal to the bit.
        """
        self.params = plant.build_flap()
        table = waves.tables(sea, plant.coefficients(), checked(dt))
        self._elevations: list[float] = table.elevation.tolist()
        self._moments: list[float] = table.excitation.tolist()
        self._onset = float(plant.water.onset.value)
        self._wave_tick = -1  # -1: the wave maker stands
        self._elevation = self._moment = 0.0
        normals = np.random.default_rng(seed).standard_normal(NORMALS).tolist()
        start = oswec.initial(self.params, 0.0)
        self._stepper = stepper(Start(self.params, start, normals, dt))
        super().__init__(dt, plant.sensors.delay_ticks.value, self._stepper.reading(0, 0))

    def make_waves(self, trigger: Flag) -> None:
        """Start the waves at t = 0 of their clock, or still the water at once."""
        if trigger == 1 and self._wave_tick < 0:
            self._wave_tick = 0
        elif trigger == 0:
            self._wave_tick = -1

    def release(self, angle: Radian) -> None:
        """Let the flap go at rest from an angle, the driveline unwound and off, the water still."""
        self._stepper.state = oswec.initial(self.params, angle)

    def change_waves(self, tables: WaveTables) -> None:
        """Put another sea on the wave maker (`waves.tables`); the water is still until it runs."""
        self._elevations, self._moments = tables.elevation.tolist(), tables.excitation.tolist()
        self._wave_tick = -1

    def place(self, angle: Radian) -> None:
        """Put the flap to rest at an angle by hand; the driveline, uncoupled, does not notice.

        Raises ValueError for a flap that is coupled to its motor.
        """
        if self.params.coupled == 1:
            raise ValueError("a flap on its driveline cannot be turned by hand")
        state = self._stepper.state
        line = state.driveline._replace(shaft_angle=angle, shaft_velocity=0.0, shaft_torque=0.0)
        rest = FlapBodyState(angle, 0.0, 0.0, 0.0)
        self._stepper.state = state._replace(driveline=line, body=rest)

    def elevation(self) -> Metre:
        """Give the undisturbed elevation at the flap now."""
        return self._elevation

    def truth(self) -> FlapTruth:
        """Give what no sensor sees, for tests and comparison with estimates."""
        state = self._stepper.state
        return FlapTruth(
            true_state(self.params.driveline, state.driveline, self._tick * self._dt),
            -state.body.radiation,
            self._moment,
            self._elevation,
            max(self._wave_tick, 0) * self._dt,
        )

    def _move(self) -> Reading:
        self._elevation = self._moment = 0.0
        if self._wave_tick >= 0:
            self._wave_tick += 1
            index = self._wave_tick % len(self._moments)
            onset = ramp(self._wave_tick * self._dt, self._onset)
            self._elevation = onset * self._elevations[index]
            self._moment = onset * self._moments[index]
        return self._stepper.advance(
            self._actuation, self._fresh, self._pressed, self._moment, self._tick
        )
