"""The World: one rig in one sea, moved only by advance(dt). No clock, no I/O, seeded."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim_plant import body, custom_drive, magnetic_spring, pto, wave_maker, wavebot, waves
from sim_plant.basin import RATE, Basin
from sim_plant.bem import Bem
from sim_plant.bus import BusState
from sim_plant.custom_drive import DriveSettings
from sim_plant.parameters import Plant
from sim_plant.prescribed import Profile, taken_up
from sim_plant.sensors import NORMALS
from sim_plant.signals import OFF, Actuation, Readings
from sim_plant.stepper import Start, Stepper
from sim_plant.surge import SurgeState
from sim_plant.units import (
    Metre,
    MetrePerSecond,
    MetrePerSecondSquared,
    Newton,
    NewtonPerMetre,
    Second,
)
from sim_plant.wavebot import FREE, Excitation, Hoist, Probes, WaveBotParams, WaveBotState
from sim_plant.waves import Sea

__all__ = ["OFF", "Actuation", "DriveSettings", "Readings", "Stepper", "Truth", "World"]

TAKE_UP = 2.0  # s in which a hoist takes the body from where it is into the prescribed motion


class Truth(NamedTuple):
    """What no sensor sees, at the present tick; forces are on the body, in heave unless told."""

    position: Metre
    velocity: MetrePerSecond
    acceleration: MetrePerSecondSquared
    excitation: Newton
    radiation: Newton  # memory part; the A_inf part is in the inertia
    drag: Newton
    motor: Newton
    spring: Newton
    friction: Newton  # drivetrain
    hoist: Newton  # mean over the last step
    spring_rate: NewtonPerMetre  # acting table rate
    surge: SurgeState
    surge_excitation: Newton
    bus: BusState  # of the custom drive
    elevation: Metre
    time: Second  # since construction
    wave_clock: Second  # since the trigger's last rising edge; 0 before the first


class Beginning(NamedTuple):
    """What a world starts from, for who steps it by other means."""

    params: WaveBotParams
    state: WaveBotState
    tables: wave_maker.Tables
    normals: Sequence[float]  # noise table
    line: tuple[Readings, ...]  # on their way to the rig, oldest first
    delay: Second  # that they take


class World:
    """A WaveBot in its basin, or the empty basin.

    Time order of tick k: readings() gives what was sampled at tick k - delay_ticks, actuate()
    latches a command, advance(dt) moves to tick k + 1 under it. From motion to force a loop thus
    has a delay of delay_ticks dt + dt/2 (hold) + the current loop's time constant.
    """

    def __init__(
        self,
        plant: Plant,
        sea: Sea,
        bem: Bem,
        surge_bem: Bem,
        *,
        dt: float,
        seed: int,
        device: bool = True,
        stepper: type[Stepper] = Stepper,
        hoist: Profile | None = None,
    ) -> None:
        """Raises ValueError if the sea's repeat period is no whole number of dt, or dt > 5 ms.

        ``device=False`` is the empty basin of a wave calibration: waves and probes only, all other
        readings stand at their resting values. ``stepper`` may be another execution of the same
        step, equal to the bit. ``hoist`` moves the body while the wave trigger is on.
        """
        if not 0.0 < dt <= 0.005:
            raise ValueError(f"dt must be in (0, 0.005] s, got {dt}")
        table = waves.tables(sea, bem, dt)
        self.params = plant.build()
        self.sea = sea
        self._plant = plant
        self._dt = dt
        onset = float(plant.waves.onset.value)
        self._tables = wave_maker.Tables(
            table.elevation.tolist(),
            table.excitation.tolist(),
            waves.excitation(sea, surge_bem, dt).tolist(),
            onset,
            math.ceil(onset / dt),
        )
        self._normals = normals = np.random.default_rng(seed).standard_normal(NORMALS).tolist()
        self._basin = Basin(
            sea, bem, plant.probes(), plant.probe_channel(), normals, dt=dt, device=device
        )
        start = wavebot.initial(self.params, float(plant.stator.start.value), 0.0)
        self._stepper = stepper(Start(self.params, start, normals, dt))
        self._device = device
        self._profile: Profile | None = None
        self._hoist = hoist
        self._held_at = 0
        self._actuation = OFF
        self._fresh = 0
        self._tick = 0
        self._looks = 0  # samples of the probes so far
        self._sea_now = wave_maker.STILL
        self._look()
        self._still = self._stepper.readings(0, 0.0)
        delay = plant.sensors.delay_ticks.value
        self.delay: Second = delay * dt  # age of the readings
        self._line: deque[Readings] = deque([self._still] * (delay + 1), maxlen=delay + 1)

    def actuate(self, actuation: Actuation) -> None:
        """Latch a command and reset its age; a rising wave_trigger starts the wave clock at 0."""
        if actuation.wave_trigger != self._actuation.wave_trigger:
            self._switch_waves(actuation.wave_trigger)
        self._actuation = actuation
        self._fresh = 1

    def configure(self, settings: DriveSettings) -> None:
        """Set the custom drive, at once; a plant with the commercial drive ignores it.

        Raises ValueError naming every setting out of range.
        """
        if self.params.electrics.custom == 0:
            return
        custom_drive.check(settings)
        self.params = self._plant.build(settings)
        self._stepper.params = self.params

    def prescribe(self, profile: Profile) -> None:
        """Let a hoist impose heave: position and velocity over time since this call.

        The body is taken into the motion within 2 s. All forces act and all sensors read on.
        """
        self._held_at = self._tick
        self._profile = taken_up(profile, *self.motion(), TAKE_UP)

    def motion(self) -> tuple[Metre, MetrePerSecond]:
        """Give the true heave position and velocity now: the cheap part of `truth`."""
        return self._stepper.motion()

    def release(self, position: Metre | None = None) -> None:
        """Let the body go: from where a hoist has it, or at rest from a heave position (m).

        With a position, drives are off, surge stands at its balance and the water is still.
        """
        self._profile = None
        self._stepper.hold(FREE)
        if position is not None:
            stator = self._stepper.state.stator.position
            self._stepper.state = wavebot.initial(self.params, stator, position)

    def advance(self, dt: float) -> None:
        """Move one tick on. Raises ValueError for another dt than that of construction."""
        if dt != self._dt:
            raise ValueError(f"this world ticks in {self._dt} s, not {dt} s")
        self._tick = tick = self._tick + 1
        self._sea_now = now = wave_maker.step(self._tables, self._sea_now, dt)
        _, _, _, elevation, heave, surge = now
        if self._profile is not None:
            self._impose(self._profile)
        stepper = self._stepper
        if self._device:
            read = stepper.advance(self._actuation, self._fresh, heave, surge, tick, elevation)
        else:
            read = self._empty(elevation)
        self._line.append(read)
        self._fresh = 0
        if tick >= self._next_look:
            self._look()

    def readings(self) -> Readings:
        """Give the values sampled delay_ticks ago."""
        return self._line[0]

    def beginning(self) -> Beginning:
        """Give what a device's world starts from; to be asked before the first step.

        The basin's probes are not in it: they see the body but nothing sees them but the log.
        """
        return Beginning(
            self.params,
            self._stepper.state,
            self._tables,
            self._normals,
            tuple(self._line),
            self.delay,
        )

    def truth(self) -> Truth:
        """Give the true motion and forces now, for tests and comparison with estimates."""
        params, state = self.params, self._stepper.state
        hull, driven = state.body, state.electrics.drive
        motor = pto.motor_force(params.pto, driven.current)
        now = self._sea_now
        applied = now.heave + motor + state.passive + state.hoist.force
        return Truth(
            hull.position,
            hull.velocity,
            body.acceleration(params.body, hull, applied),
            now.heave,
            body.radiation(params.body, hull),
            body.drag(params.body, hull.velocity),
            motor,
            magnetic_spring.force(params.spring, state.stator.rate, hull.position),
            pto.friction(params.pto, hull.velocity, state.surge.guide),
            state.hoist.force,
            state.stator.rate,
            state.surge,
            now.surge,
            state.electrics.bus,
            now.elevation,
            self._tick * self._dt,
            max(now.tick, 0) * self._dt,
        )

    def _impose(self, profile: Profile) -> None:
        end = (self._tick - self._held_at) * self._dt
        middle = profile(end - 0.5 * self._dt)
        self._stepper.hold(Hoist(1, *middle, *profile(end), 0.0))

    def _look(self) -> None:
        """Sample the probes; the rig sees the sample one tick later."""
        _, velocity = self._stepper.motion()
        one, two, three = self._basin.sample(self._sea_now.tick, self._sea_now.share, velocity)
        self._seen = Probes(one, two, three, 0.0)
        self._stepper.see(self._seen)
        self._looks += 1
        self._next_look = math.ceil(self._looks / (RATE * self._dt) - 1.0e-6)

    def _empty(self, elevation: Metre) -> Readings:
        """Give what is read with no device in the basin."""
        one, two, three, age = self._seen
        self._seen = Probes(one, two, three, age + self._dt)
        return self._still._replace(
            elevation=elevation, probe_1=one, probe_2=two, probe_3=three, probe_age=age + self._dt
        )

    def _switch_waves(self, trigger: int) -> None:
        """Start the waves at t = 0 of their clock, or still the water at once."""
        self._sea_now = now = wave_maker.switch(self._tables, trigger, self._dt)
        self._stepper.excitation = Excitation(now.heave, now.surge)
        if self._hoist is not None:
            stopped, _ = self.motion()
            self.prescribe(self._hoist if trigger else lambda _: (stopped, 0.0))
