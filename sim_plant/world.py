"""The World: one rig in one sea, moved only by advance(dt). No clock, no I/O, seeded."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from sim_plant import body, custom_drive, magnetic_spring, pto, wavebot
from sim_plant.bem import Bem
from sim_plant.custom_drive import DriveSettings
from sim_plant.parameters import Plant
from sim_plant.sensors import NORMALS
from sim_plant.units import (
    Metre,
    MetrePerSecond,
    MetrePerSecondSquared,
    Newton,
    NewtonPerMetre,
    Second,
)
from sim_plant.wavebot import Actuation, Readings
from sim_plant.waves import Sea, tables

__all__ = ["Actuation", "DriveSettings", "Readings", "Stepper", "Truth", "World"]

OFF = Actuation(0.0, 0, 0.0, 0, 0, 0.0, 0, 1)


class Truth(NamedTuple):
    """What no sensor sees, at the present tick; forces are on the body."""

    position: Metre
    velocity: MetrePerSecond
    acceleration: MetrePerSecondSquared
    excitation: Newton
    radiation: Newton  # memory part; the A_inf part is in the inertia
    drag: Newton
    motor: Newton
    spring: Newton
    friction: Newton  # drivetrain
    spring_rate: NewtonPerMetre  # acting table rate
    elevation: Metre
    time: Second  # since construction
    wave_clock: Second  # since the trigger's last rising edge; 0 before the first


class Stepper:
    """Moves the plant's state by one tick and samples its sensors; interpreted."""

    def __init__(
        self, params: wavebot.WaveBotParams, state: wavebot.WaveBotState, normals: list[float]
    ) -> None:
        self.params = params
        self.state = state
        self._normals = normals

    def advance(
        self,
        actuation: Actuation,
        fresh: int,
        excitation_now: Newton,
        excitation_next: Newton,
        tick: int,
        elevation: Metre,
        dt: Second,
    ) -> Readings:
        """Step to ``tick`` and give what the sensors read there."""
        self.state = state = wavebot.step(
            self.params, self.state, actuation, fresh, excitation_now, excitation_next, dt
        )
        return wavebot.sample(self.params, state, tick, elevation, self._normals)

    def readings(self, tick: int, elevation: Metre) -> Readings:
        """Give what the sensors read at the present state."""
        return wavebot.sample(self.params, self.state, tick, elevation, self._normals)


class World:
    """A WaveBot in heave.

    Time order of tick k: readings() gives what was sampled at tick k - delay_ticks, actuate()
    latches a command, advance(dt) moves to tick k + 1 under it. From motion to force a loop thus
    has a delay of delay_ticks dt + dt/2 (hold) + the current loop's time constant.
    """

    def __init__(
        self,
        plant: Plant,
        sea: Sea,
        bem: Bem,
        *,
        dt: float,
        seed: int,
        stepper: type[Stepper] = Stepper,
    ) -> None:
        """Raises ValueError if the sea's repeat period is no whole number of dt, or dt > 5 ms.

        ``stepper`` may be another execution of the same step, equal to the bit.
        """
        if not 0.0 < dt <= 0.005:
            raise ValueError(f"dt must be in (0, 0.005] s, got {dt}")
        table = tables(sea, bem, dt)
        self.params = plant.build()
        self.sea = sea
        self._dt = dt
        self._elevations: list[float] = table.elevation.tolist()
        self._excitations: list[float] = table.excitation.tolist()
        self._length = len(self._excitations)
        self._ramp = float(plant.waves.onset.value)
        self._ramp_ticks = math.ceil(self._ramp / dt)
        normals = np.random.default_rng(seed).standard_normal(NORMALS)
        start = wavebot.initial(self.params, float(plant.stator.start.value), 0.0)
        self._stepper = stepper(self.params, start, normals.tolist())
        self._actuation = OFF
        self._fresh = 0
        self._tick = 0
        self._wave_tick = -1  # -1: the wave maker stands
        self._wave_clock = 0.0
        self._excitation = 0.0
        self._elevation = 0.0
        first = self._stepper.readings(0, 0.0)
        delay = plant.sensors.delay_ticks.value
        self._line: deque[Readings] = deque([first] * (delay + 1), maxlen=delay + 1)

    def actuate(self, actuation: Actuation) -> None:
        """Latch a command and reset its age; a rising wave_trigger starts the wave clock at 0."""
        if actuation.wave_trigger != self._actuation.wave_trigger:
            self._switch_waves(actuation.wave_trigger)
        self._actuation = actuation
        self._fresh = 1

    def configure(self, settings: DriveSettings) -> None:
        """Set the custom drive; a plant with the commercial drive ignores it.

        Raises ValueError naming every setting out of range.
        """
        custom_drive.check(settings)

    def advance(self, dt: float) -> None:
        """Move one tick on. Raises ValueError for another dt than that of construction."""
        if dt != self._dt:
            raise ValueError(f"this world ticks in {self._dt} s, not {dt} s")
        self._tick = tick = self._tick + 1
        now = after = self._excitation
        elevation = self._elevation
        if self._wave_tick >= 0:
            self._wave_tick = wave_tick = self._wave_tick + 1
            index = wave_tick % self._length
            elevation, after = self._elevations[index], self._excitations[index]
            if wave_tick < self._ramp_ticks:
                onset = wavebot.wave_ramp(wave_tick * dt, self._ramp)
                elevation, after = onset * elevation, onset * after
            self._elevation, self._excitation = elevation, after
        self._line.append(
            self._stepper.advance(self._actuation, self._fresh, now, after, tick, elevation, dt)
        )
        self._fresh = 0

    def readings(self) -> Readings:
        """Give the values sampled delay_ticks ago."""
        return self._line[0]

    def truth(self) -> Truth:
        """Give the true motion and forces now, for tests and comparison with estimates."""
        params, state = self.params, self._stepper.state
        motor = pto.motor_force(params.pto, state.drive.current)
        applied = self._excitation + motor + state.passive
        return Truth(
            state.body.position,
            state.body.velocity,
            body.acceleration(params.body, state.body, applied),
            self._excitation,
            body.radiation(params.body, state.body),
            body.drag(params.body, state.body.velocity),
            motor,
            magnetic_spring.force(params.spring, state.stator.rate, state.body.position),
            pto.friction(params.pto, state.body.velocity),
            state.stator.rate,
            self._elevation,
            self._tick * self._dt,
            max(self._wave_tick, 0) * self._dt,
        )

    def release(self, position: Metre) -> None:
        """Hold the body at a heave position (m) and let it go: start of a free decay."""
        stator = self._stepper.state.stator.position
        self._stepper.state = wavebot.initial(self.params, stator, position)

    def _switch_waves(self, trigger: int) -> None:
        """Start the waves at t = 0 of their clock, or still the water at once."""
        self._wave_tick = 0 if trigger == 1 else -1
        onset = wavebot.wave_ramp(0.0, self._ramp) * trigger
        self._elevation = onset * self._elevations[0]
        self._excitation = onset * self._excitations[0]
