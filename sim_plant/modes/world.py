"""The World of coupled modes: one rig in one sea, advanced only by advance(dt)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_plant import sea_states
from sim_plant.modes import building
from sim_plant.modes import plant as modes
from sim_plant.modes import readings as reading
from sim_plant.modes.bem import mode_bem
from sim_plant.modes.building import PlantModel
from sim_plant.modes.plant import ModesParams
from sim_plant.sea_states import Sea
from sim_plant.sensors import NOISE_LENGTH
from sim_plant.wave_maker import onset_ramp


class Actuation(NamedTuple):
    """Commands from the control computer to the rig."""

    drives: Sequence[float]  # current (A) and enable (0 or 1) of each axis, one after the other
    wave_trigger: int  # 1: the wave maker runs; its rising edge is t = 0 of the wave clock


class Truth(NamedTuple):
    """True state at the present tick, in the order of the plant file's modes and axes."""

    position: tuple[float, ...]  # of each mode, m or rad
    velocity: tuple[float, ...]
    excitation: tuple[float, ...]  # of each mode, N or N m
    shaft_force: tuple[float, ...]  # of each axis, mean over the last step, N or N m on the body
    electric_power: tuple[float, ...]  # W, mean over the last step, absorbed negative
    elevation: float  # m
    time: float  # s, since construction
    wave_clock: float  # s, since the trigger's last rising edge; 0 before the first


class Conditions(NamedTuple):
    """A world between two ticks, for callers that execute the step themselves from then on."""

    params: ModesParams
    state: list[float]
    delay_line: tuple[tuple[float, ...], ...]  # readings not yet delivered, oldest first
    table: NDArray[np.float64]  # of `excitation_table`
    onset: float  # s
    onset_ticks: int  # after which the sea has its full height
    wave_tick: int  # since the wave maker was started; -1 while it is off
    waves: Sequence[float]  # excitation of each mode, then the elevation
    normals: Sequence[float]  # noise table
    actuation: Actuation  # last command
    fresh: int  # 1: it arrived after the last step


class Stepper:
    """Interpreted stepper: advances the plant's state by one tick and samples its sensors."""

    def __init__(
        self, params: ModesParams, state: list[float], normals: Sequence[float], dt: float
    ) -> None:
        self._params = params
        self._normals = normals
        self._dt = dt
        self.state = state
        self._readings = [0.0] * reading.reading_size(params)
        self._excitation: Sequence[float] = [0.0] * params.modes

    def set_excitation(self, excitation: Sequence[float]) -> None:
        """Set the excitation of the modes at the present tick, N or N m."""
        self._excitation = excitation

    def advance(
        self,
        drives: Sequence[float],
        fresh: int,
        excitation: Sequence[float],
        tick: int,
        elevation: float,
    ) -> tuple[float, ...]:
        """Step to `tick` with the excitation there; return the readings."""
        modes.step(self._params, self.state, drives, fresh, self._excitation, excitation, self._dt)
        self._excitation = excitation
        return self.readings(tick, elevation)

    def readings(self, tick: int, elevation: float) -> tuple[float, ...]:
        """Return the sensor readings at the present state."""
        reading.sample(self._params, self.state, tick, elevation, self._normals, self._readings)
        return tuple(self._readings)

    def numbers(self) -> list[float]:
        """Return the present state."""
        return list(self.state)

    def set_motion(self, position: Sequence[float], velocity: Sequence[float]) -> None:
        """Set positions and velocities of the modes, and of the motors that move with them."""
        modes.place(self._params, self.state, position, velocity)


class World:
    """A rig of coupled modes in its basin.

    Order of calls in tick k: readings() returns the sample of tick k - delay_ticks, actuate()
    latches a command, advance(dt) steps to tick k + 1 under it. Readings are numbers in the order
    counts, current, enabled, fault of each axis, each sensor, the undisturbed elevation.
    """

    def __init__(
        self,
        model: PlantModel,
        sea: Sea,
        *,
        dt: float,
        seed: int,
        stepper: type[Stepper] = Stepper,
    ) -> None:
        """Raise ValueError if dt suits neither the plant's fastest motion nor the sea.

        `stepper` may be another execution of the same step with bitwise equal results.
        """
        if not 0.0 < dt <= 0.005:
            raise ValueError(f"dt must be in (0, 0.005] s, got {dt}")
        plant, params = model.plant, model.params
        building.check_step(model, dt)
        self.model = model
        self.sea = sea
        self._dt = dt
        self._onset = float(plant.wave_onset_s)
        self._onset_ticks = math.ceil(self._onset / dt)
        self._table = excitation_table(model, sea, dt)
        self._normals = normals = np.random.default_rng(seed).standard_normal(NOISE_LENGTH).tolist()
        state = building.initial_state(model)
        self._stepper = stepper(params, state, normals, dt)
        self._actuation = self.rest = Actuation((0.0, 0.0) * params.axes, 0)
        self._fresh = 0
        self._tick = 0
        self._wave_tick = -1  # since the wave maker was started; -1 while it is off
        self._still = [0.0] * (params.modes + 1)
        self._waves = self._still  # excitation of each mode, then the elevation
        ticks = delay_ticks(plant.delay_s, dt)
        self.delay = ticks * dt  # s, age of the readings
        self._delay_line: deque[tuple[float, ...]] = deque(
            [self._stepper.readings(0, 0.0)] * (ticks + 1), maxlen=ticks + 1
        )

    def actuate(self, actuation: Actuation) -> None:
        """Latch a command and reset its age; a rising wave_trigger starts the wave clock at 0."""
        if actuation.wave_trigger != self._actuation.wave_trigger:
            self._wave_tick = 0 if actuation.wave_trigger else -1
            self._waves = self._waves_now()
            self._stepper.set_excitation(self._waves[:-1])
        self._actuation = actuation
        self._fresh = 1

    def advance(self, dt: float) -> None:
        """Advance by one tick. Raises ValueError for another dt than that of construction."""
        if dt != self._dt:
            raise ValueError(f"this world advances by {self._dt} s, got {dt} s")
        self._tick += 1
        if self._wave_tick >= 0:
            self._wave_tick += 1
            self._waves = self._waves_now()
        elevation = self._waves[-1]
        readings = self._stepper.advance(
            self._actuation.drives, self._fresh, self._waves[:-1], self._tick, elevation
        )
        self._delay_line.append(readings)
        self._fresh = 0

    def readings(self) -> tuple[float, ...]:
        """Return the readings sampled `delay` ago."""
        return self._delay_line[0]

    def conditions(self) -> Conditions:
        """Return the present conditions."""
        return Conditions(
            self.model.params,
            self._stepper.numbers(),
            tuple(self._delay_line),
            self._table,
            self._onset,
            self._onset_ticks,
            self._wave_tick,
            self._waves,
            self._normals,
            self._actuation,
            self._fresh,
        )

    def release(self, position: Sequence[float], velocity: Sequence[float] | None = None) -> None:
        """Set the motion of the modes (m or rad), at rest without `velocity`."""
        self._stepper.set_motion(position, velocity or [0.0] * len(position))

    def truth(self) -> Truth:
        """Return the true motion and forces now, for tests and comparison with estimates."""
        params, state = self.model.params, self._stepper.numbers()
        n, first = params.modes, modes.motion_size(params)
        axes = range(first, first + params.axes * modes.AXIS_SIZE, modes.AXIS_SIZE)
        return Truth(
            tuple(state[:n]),
            tuple(state[n : 2 * n]),
            tuple(self._waves[:-1]),
            tuple(state[at + modes.SHAFT_FORCE] for at in axes),
            tuple(state[at + modes.ELECTRIC_POWER] for at in axes),
            self._waves[-1],
            self._tick * self._dt,
            max(self._wave_tick, 0) * self._dt,
        )

    def _waves_now(self) -> list[float]:
        if self._wave_tick < 0:
            return self._still
        row: list[float] = self._table[self._wave_tick % self._table.shape[0]].tolist()
        if self._wave_tick < self._onset_ticks:
            factor = onset_ramp(self._wave_tick * self._dt, self._onset)
            return [factor * value for value in row]
        return row


def excitation_table(model: PlantModel, sea: Sea, dt: float) -> NDArray[np.float64]:
    """Return excitation of each mode and elevation over one repeat period, (ticks, modes + 1).

    Raises ValueError as `sea_states.tables`.
    """
    count = len(model.bem.modes)
    columns = [sea_states.excitation(sea, mode_bem(model.bem, k), dt) for k in range(count)]
    return np.column_stack([*columns, sea_states.elevation_at(sea, 0.0, dt)])


def delay_ticks(delay: float, dt: float) -> int:
    """Return the delay of a reading in ticks, rounded up: a loop reads only at its ticks."""
    return math.ceil(delay / dt - 1.0e-6)
