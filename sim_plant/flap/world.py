"""The flap's world: a flume with one sea, advanced by advance(dt). No clock, no I/O, seeded."""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant import sea_states
from sim_plant.bench.signals import OFF, Actuation, BenchReading, BenchTruth
from sim_plant.bench.wires import PlantInterface
from sim_plant.bench.world import compute_truth
from sim_plant.flap import oswec
from sim_plant.flap.parameters import FlapPlant
from sim_plant.flap.stepper import Stepper
from sim_plant.sea_states import Sea, WaveTables
from sim_plant.units import Flag, Metre, NewtonMetre, Radian, Second
from sim_plant.wave_maker import value_at

MAX_STEP: Second = 0.001
"""Longest step of the driveline under torque: at 2 ms a fast flap crosses the coupling's gap within
one step, and the coupling then transmits half of the motor's torque."""

__all__ = ["OFF", "Actuation", "BenchReading", "FlapTruth", "FlapWorld", "Stepper"]


class FlapTruth(NamedTuple):
    """True state at the present tick; torques are on the flap."""

    driveline: BenchTruth  # its shaft is the flap's; positive power goes to the flap
    radiation: NewtonMetre
    excitation: NewtonMetre
    elevation: Metre
    wave_clock: Second


class FlapWorld(PlantInterface):
    """The flap in its flume, with the bench's signals and a wave maker."""

    def __init__(
        self,
        plant: FlapPlant,
        sea: Sea,
        *,
        dt: float,
        seed: int,
        stepper: type[Stepper] = Stepper,
    ) -> None:
        """Build the flap at rest; other arguments and errors are those of `PlantInterface`.

        Raises ValueError for a sea whose repeat is no multiple of dt, too.
        """
        self.params = plant.build_flap()
        start, delay = oswec.initial(self.params, 0.0), plant.sensors.delay_ticks.value
        self.steps = math.ceil(dt / MAX_STEP - 1e-9)  # of a tick
        super().__init__(
            self.params, start, delay, dt=dt, steps=self.steps, seed=seed, stepper=stepper
        )
        self.onset = float(plant.water.onset.value)  # s
        self._wave_tick = -1  # -1: the wave maker is off
        self._elevation = self._moment = 0.0
        self.change_waves(sea_states.tables(sea, plant.coefficients(), dt))

    @property
    def wave_tick(self) -> int:
        """Ticks since the waves were started; -1 in still water."""
        return self._wave_tick

    @property
    def moment(self) -> NewtonMetre:
        """Excitation of the flap by the waves now."""
        return self._moment

    def make_waves(self, trigger: Flag) -> None:
        """Start the waves at t = 0 of the wave clock, or stop them at once."""
        if trigger == 1 and self._wave_tick < 0:
            self._wave_tick = 0
        elif trigger == 0:
            self._wave_tick = -1

    def release(self, angle: Radian) -> None:
        """Release the flap at rest from an angle: driveline unwound and off, water still."""
        self._stepper.state = oswec.initial(self.params, angle)

    def change_waves(self, tables: WaveTables) -> None:
        """Load another sea (`sea_states.tables`) into the wave maker and stop it."""
        self._elevations: list[float] = tables.elevation.tolist()
        self._moments: list[float] = tables.excitation.tolist()
        self._wave_tick = -1

    def set_angle(self, angle: Radian) -> None:
        """Put the flap at rest at an angle by hand; the uncoupled driveline is unaffected.

        Raises ValueError for a flap that is coupled to its motor.
        """
        if self.params.coupled == 1:
            raise ValueError("a flap on its driveline cannot be turned by hand")
        self._stepper.state = oswec.turn_to(self._stepper.state, angle)

    def elevation(self) -> Metre:
        """Return the undisturbed elevation at the flap now."""
        return self._elevation

    def truth(self) -> FlapTruth:
        """Return the true state, for tests and comparison with estimates."""
        state = self._stepper.state
        return FlapTruth(
            compute_truth(self.params.driveline, state.driveline, self._tick * self._dt),
            -state.body.radiation,
            self._moment,
            self._elevation,
            max(self._wave_tick, 0) * self._dt,
        )

    def _step_plant(self) -> BenchReading:
        last_moment, fresh = self._moment, self._fresh
        self._elevation = self._moment = 0.0
        if self._wave_tick >= 0:
            self._wave_tick += 1
            at = (0, len(self._moments), self._wave_tick, self.onset, self._dt)
            self._elevation = value_at(self._elevations, *at)
            self._moment = value_at(self._moments, *at)
        for step in range(1, self.steps):
            moment = last_moment + (self._moment - last_moment) * step / self.steps
            self._stepper.advance(self._actuation, fresh, self._stop_pressed, self._tick, moment)
            fresh = 0
        return self._stepper.advance(
            self._actuation, fresh, self._stop_pressed, self._tick, self._moment
        )
