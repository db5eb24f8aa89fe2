"""The World: one rig in one sea, advanced only by advance(dt). No clock, no I/O, seeded."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim_plant import body, custom_drive, magnetic_spring, pto, sea_states, wave_maker, wavebot
from sim_plant.basin import SAMPLE_RATE, Basin
from sim_plant.bem import Bem
from sim_plant.custom_drive import DriveSettings
from sim_plant.parameters import Plant
from sim_plant.parts.bus import BusState
from sim_plant.prescribed import MotionProfile, blend_in
from sim_plant.sea_states import Sea
from sim_plant.sensors import NOISE_LENGTH
from sim_plant.signals import OFF, Actuation, Readings
from sim_plant.stepper import Stepper, StepperInputs
from sim_plant.surge import SurgeState
from sim_plant.units import (
    Metre,
    MetrePerSecond,
    MetrePerSecondSquared,
    Newton,
    NewtonPerMetre,
    Second,
)
from sim_plant.wavebot import NO_HOIST, Excitation, Hoist, Probes, WaveBotParams, WaveBotState

__all__ = ["OFF", "Actuation", "DriveSettings", "Readings", "Stepper", "Truth", "World"]

BLEND_TIME = 2.0  # s, blend from the body's motion into the prescribed motion


class Truth(NamedTuple):
    """True state at the present tick; forces are on the body, in heave unless named otherwise."""

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


class Conditions(NamedTuple):
    """A world between two ticks, for callers that execute the step themselves from then on."""

    params: WaveBotParams
    state: WaveBotState
    tables: wave_maker.WaveMakerTables
    waves: wave_maker.WaveMakerState
    normals: Sequence[float]  # noise table
    delay_line: tuple[Readings, ...]  # readings not yet delivered, oldest first
    delay: Second  # of a reading
    actuation: Actuation  # last command
    fresh: int  # 1: it arrived after the last step


class World:
    """A WaveBot in its basin, or the empty basin.

    Order of calls in tick k: readings() returns the sample of tick k - delay_ticks, actuate()
    latches a command, advance(dt) steps to tick k + 1 under it. A loop thus has a delay from motion
    to force of delay_ticks dt + dt/2 (hold) + the current loop's time constant.
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
        hoist: MotionProfile | None = None,
    ) -> None:
        """Raise ValueError if the sea's repeat period is not a multiple of dt, or dt > 5 ms.

        ``device=False`` is the empty basin of a wave calibration: waves and probes only; all other
        readings keep their rest values. ``stepper`` may be another execution of the same step with
        bitwise equal results. ``hoist`` moves the body while the wave trigger is on.
        """
        if not 0.0 < dt <= 0.005:
            raise ValueError(f"dt must be in (0, 0.005] s, got {dt}")
        table = sea_states.tables(sea, bem, dt)
        self.params = plant.build()
        self.sea = sea
        self._plant = plant
        self._dt = dt
        onset = float(plant.waves.onset.value)
        self._tables = wave_maker.WaveMakerTables(
            table.elevation.tolist(),
            table.excitation.tolist(),
            sea_states.excitation(sea, surge_bem, dt).tolist(),
            onset,
            math.ceil(onset / dt),
        )
        self._normals = normals = np.random.default_rng(seed).standard_normal(NOISE_LENGTH).tolist()
        self._basin = Basin(
            sea, bem, plant.probes(), plant.probe_channel(), normals, dt=dt, device=device
        )
        start = wavebot.initial(self.params, float(plant.stator.start.value), 0.0)
        self._stepper = stepper(StepperInputs(self.params, start, normals, dt))
        self._device = device
        self._profile: MotionProfile | None = None
        self._hoist = hoist
        self._hoist_start_tick = 0
        self._actuation = OFF
        self._fresh = 0
        self._tick = 0
        self._probe_sample_count = 0
        self._waves = wave_maker.STILL_WATER
        self._sample_probes()
        self._rest_readings = self._stepper.readings(0, 0.0)
        delay = plant.sensors.delay_ticks.value
        self.delay: Second = delay * dt  # age of the readings
        self._delay_line: deque[Readings] = deque(
            [self._rest_readings] * (delay + 1), maxlen=delay + 1
        )

    def actuate(self, actuation: Actuation) -> None:
        """Latch a command and reset its age; a rising wave_trigger starts the wave clock at 0."""
        if actuation.wave_trigger != self._actuation.wave_trigger:
            self._switch_waves(actuation.wave_trigger)
        self._actuation = actuation
        self._fresh = 1

    def configured(self, settings: DriveSettings) -> WaveBotParams:
        """Return the constants with settings of the custom drive; a commercial one ignores them.

        Raises ValueError with the name of every setting out of range.
        """
        if self.params.electrics.custom == 0:
            return self.params
        custom_drive.check_settings(settings)
        return self._plant.build(settings)

    def configure(self, settings: DriveSettings) -> None:
        """Change the settings of the custom drive at once, as `configured` does."""
        self._stepper.params = self.params = self.configured(settings)

    def prescribe(self, profile: MotionProfile) -> None:
        """Impose heave by a hoist: position and velocity over time since this call.

        The body joins the motion within 2 s. All forces continue to act and all sensors to measure.
        """
        self._hoist_start_tick = self._tick
        self._profile = blend_in(profile, *self.motion(), BLEND_TIME)

    def motion(self) -> tuple[Metre, MetrePerSecond]:
        """Return the true heave position and velocity now: the cheap part of `truth`."""
        return self._stepper.motion()

    def release(self, position: Metre | None = None) -> None:
        """Release the body from the hoist's position, or at rest from a heave position (m).

        With a position, drives are off, surge is at rest at its balance and the water is still.
        """
        self._profile = None
        self._stepper.set_hoist(NO_HOIST)
        if position is not None:
            stator = self._stepper.state.stator.position
            self._stepper.state = wavebot.initial(self.params, stator, position)

    def advance(self, dt: float) -> None:
        """Advance by one tick. Raises ValueError for another dt than that of construction."""
        if dt != self._dt:
            raise ValueError(f"this world advances by {self._dt} s, got {dt} s")
        self._tick = tick = self._tick + 1
        self._waves = waves = wave_maker.step(self._tables, self._waves, dt)
        _, _, _, elevation, heave, surge = waves
        if self._profile is not None:
            self._impose_motion(self._profile)
        stepper = self._stepper
        if self._device:
            readings = stepper.advance(self._actuation, self._fresh, heave, surge, tick, elevation)
        else:
            readings = self._empty_basin_readings(elevation)
        self._delay_line.append(readings)
        self._fresh = 0
        if tick >= self._next_probe_tick:
            self._sample_probes()

    def readings(self) -> Readings:
        """Return the readings sampled delay_ticks ago."""
        return self._delay_line[0]

    def conditions(self) -> Conditions:
        """Return the present conditions of a world with a device.

        They do not include the basin probes, which the caller samples (`sample_probes`): the probes
        depend on the body, but only the log on them.
        """
        return Conditions(
            self.params,
            self._stepper.state,
            self._tables,
            self._waves,
            self._normals,
            tuple(self._delay_line),
            self.delay,
            self._actuation,
            self._fresh,
        )

    @property
    def next_probe_tick(self) -> int:
        """Tick at which the probes are to be sampled, after the step to it."""
        return self._next_probe_tick

    def truth(self) -> Truth:
        """Return the true motion and forces now, for tests and comparison with estimates."""
        params, state = self.params, self._stepper.state
        body_state, drive_state = state.body, state.electrics.drive
        motor = pto.motor_force(params.pto, drive_state.current)
        waves = self._waves
        applied = waves.heave + motor + state.passive_force + state.hoist.force
        return Truth(
            body_state.position,
            body_state.velocity,
            body.acceleration(params.body, body_state, applied),
            waves.heave,
            body.radiation(params.body, body_state),
            body.drag(params.body, body_state.velocity),
            motor,
            magnetic_spring.force(params.spring, state.stator.rate, body_state.position),
            pto.friction(params.pto, body_state.velocity, state.surge.guide_force),
            state.hoist.force,
            state.stator.rate,
            state.surge,
            waves.surge,
            state.electrics.bus,
            waves.elevation,
            self._tick * self._dt,
            max(waves.tick, 0) * self._dt,
        )

    def _impose_motion(self, profile: MotionProfile) -> None:
        end = (self._tick - self._hoist_start_tick) * self._dt
        middle = profile(end - 0.5 * self._dt)
        self._stepper.set_hoist(Hoist(1, *middle, *profile(end), 0.0))

    def sample_probes(self, wave_tick: int, onset: float, velocity: MetrePerSecond) -> Probes:
        """Sample the probes; the rig receives the sample one tick later.

        ``wave_tick`` and ``onset`` are those of the waves, ``velocity`` that of the hull.
        """
        probe_1, probe_2, probe_3 = self._basin.sample(wave_tick, onset, velocity)
        self._probe_sample_count += 1
        self._next_probe_tick = math.ceil(
            self._probe_sample_count / (SAMPLE_RATE * self._dt) - 1.0e-6
        )
        return Probes(probe_1, probe_2, probe_3, 0.0)

    def _sample_probes(self) -> None:
        _, velocity = self._stepper.motion()
        waves = self._waves
        self._probes = self.sample_probes(waves.tick, waves.onset_factor, velocity)
        self._stepper.set_probes(self._probes)

    def _empty_basin_readings(self, elevation: Metre) -> Readings:
        """Return the readings of a basin without a device."""
        probe_1, probe_2, probe_3, age = self._probes
        self._probes = Probes(probe_1, probe_2, probe_3, age + self._dt)
        return self._rest_readings._replace(
            elevation=elevation,
            probe_1=probe_1,
            probe_2=probe_2,
            probe_3=probe_3,
            probe_age=age + self._dt,
        )

    def _switch_waves(self, trigger: int) -> None:
        """Start the waves at t = 0 of the wave clock, or stop them at once."""
        self._waves = waves = wave_maker.switch(self._tables, trigger, self._dt)
        self._stepper.excitation = Excitation(waves.heave, waves.surge)
        if self._hoist is not None:
            position, _ = self.motion()
            self.prescribe(self._hoist if trigger else lambda _: (position, 0.0))
