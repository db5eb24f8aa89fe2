"""The simulated WaveBot behind the loop's device seam."""

from pathlib import Path
from typing import Any

import numpy as np

from controllers.signals import AxisSense, DriveSense, PanelSense, ProbeSense, SpringSense
from controllers.signals import DriveSettings as Settings
from rig.kinds.wavebot import Command, LoadSense, PowerSense, Sense, WaveSense
from sim_plant import waves
from sim_plant.bem import read_bem
from sim_plant.custom_drive import DriveSettings
from sim_plant.parameters import Plant
from sim_plant.prescribed import Profile, raised_and_lowered
from sim_plant.waves import Sea
from sim_plant.world import OFF, Actuation, Stepper, World


def build_sea(description: dict[str, Any]) -> Sea:
    """The sea that a campaign describes; ValueError if it has no repeat period."""
    kind = description["kind"]
    if kind == "calm":
        return waves.calm()
    if kind == "regular":
        return waves.regular(description["amplitude_m"], description["frequency_hz"])
    if kind == "jonswap":
        return waves.jonswap(
            description["hs_m"],
            description["tp_s"],
            description["gamma"],
            description["repeat_s"],
            description["seed"],
        )
    if kind == "components":
        return waves.components(
            description["repeat_s"],
            description["cycles"],
            description["amplitude_m"],
            description["phase_rad"],
        )
    return waves.recorded(np.array(description["elevation_m"]), description["rate_hz"])


# What a NamedTuple's own constructor ends in: nine of them a tick are a tenth of a rehearsal.
_word = tuple.__new__
_UNTOUCHED = PanelSense(0, 0, 0.0)  # nobody presses a button in a rehearsal


class PlantDevices:
    """The devices of a simulated WaveBot.

    The world moves when it is read, up to the planned time of the tick: one step on the virtual
    clock, more when ticks of the real clock were lost (a plant does not wait for a late loop).
    """

    def __init__(self, world: World, dt: float) -> None:
        self._world = world
        self._delay = world.delay
        self._dt = dt
        self._ticks = 0
        self._told: Settings | None = None  # of the drive, the last word

    def warm_up(self, dt: float) -> None:
        """Nothing to warm up."""

    def read(self, now: float) -> Sense:
        tick = round(now / self._dt)
        while self._ticks < tick:
            self._world.advance(self._dt)
            self._ticks += 1
        (
            counts, current, enabled, fault,
            surge_counts, surge_current, surge_enabled, surge_fault,
            lcb, trs, slew, stator_a, stator_b, string_pot, rotor_angle,
            stator, arrived, ac, dc, bus_voltage, analyser_age,
            saturated, dump, conducting, elevation, probe_1, probe_2, probe_3, probe_age,
        ) = self._world.readings()  # fmt: skip
        late = self._delay
        load = (lcb, trs, slew, stator_a, stator_b, string_pot, rotor_angle, late)
        return Sense(
            _word(AxisSense, (counts, late, current, enabled, fault, late)),
            _word(AxisSense, (surge_counts, late, surge_current, surge_enabled, surge_fault, late)),
            _word(LoadSense, load),
            _word(SpringSense, (stator, arrived, late)),
            _word(PowerSense, (ac, dc, bus_voltage, analyser_age)),
            _word(DriveSense, (conducting, saturated, dump)),
            _word(ProbeSense, (probe_1, probe_2, probe_3, probe_age)),
            _word(WaveSense, (elevation,)),
            _UNTOUCHED,
        )

    def write(self, command: Command) -> None:
        heave, surge, spring, (conducting, settings), waves = command
        if settings is not self._told:
            self._configure(settings)
        _, current, enable, _ = heave
        _, target, move = spring
        _, aside, hold, _ = surge
        self._world.actuate(
            _word(Actuation, (current, enable, target, move, waves, aside, hold, conducting))
        )

    def _configure(self, settings: Settings) -> None:
        changed, self._told = settings != self._told, settings
        if changed and settings.bus_voltage > 0.0:  # all zero where the drive has none
            scheme, voltage, period, tolerance, _, level = settings
            self._world.configure(DriveSettings(scheme, voltage, period, tolerance, level))

    def stop(self, reason: int) -> None:
        self._world.actuate(OFF)

    def close(self) -> None:
        """Nothing to release."""


def stepper(compiled: bool) -> type[Stepper]:
    """The compiled step, or the interpreted one, which needs no compiler and gives the same."""
    if not compiled:
        return Stepper
    from rig.execution.rehearsal.compiled_plant import CompiledStepper  # noqa: PLC0415  (numba takes a second)

    return CompiledStepper


def build_world(config: dict[str, Any], dt: float) -> World:
    """The rig in its sea, for {"plant": mapping, "bem": path, "sea": mapping, "seed": int}.

    "device": "absent" is the empty basin of a wave calibration, "compiled": false interprets it,
    "hoist" raises and lowers the body from the wave trigger on.
    """
    plant = Plant.model_validate(config["plant"])
    path = Path(config["bem"])
    return World(
        plant,
        build_sea(config["sea"]),
        read_bem(path),
        read_bem(path.with_name(plant.surge.bem)),
        dt=dt,
        seed=config["seed"],
        device=config.get("device", "present") == "present",
        stepper=stepper(config.get("compiled", True)),
        hoist=_hoist(config.get("hoist")),
    )


def _hoist(told: dict[str, Any] | None) -> Profile | None:
    if told is None:
        return None
    return raised_and_lowered(told["low_m"], told["high_m"], told["speed_m_per_s"], told["turn_s"])


def connect(config: dict[str, Any], dt: float) -> PlantDevices:
    """The simulated devices for what `build_world` takes."""
    return PlantDevices(build_world(config, dt), dt)
