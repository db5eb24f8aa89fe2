"""The simulated WaveBot behind the loop's device interface."""

from functools import cached_property
from pathlib import Path
from typing import Any

from controllers.signals import DriveSettings as Settings
from rig.compilation.tick_source import PlantCode
from rig.emulation.in_process import CoupledDevices
from rig.emulation.sea import build_sea
from rig.kinds.wavebot.rehearsal import plant_coupling
from rig.kinds.wavebot.rehearsal.coupled_plant import (
    PLANT_CODE,
    CoupledWorld,
    Noise,
    plant_drive_settings,
)
from rig.kinds.wavebot.rehearsal.noise import interleaved
from rig.kinds.wavebot.tick import Command, Sense
from sim_plant.bem import read_bem
from sim_plant.parameters import Plant
from sim_plant.prescribed import MotionProfile, hoist_cycle_profile
from sim_plant.world import OFF, Stepper, World


class WaveBotPlantDevices(CoupledDevices):
    """The devices of a simulated WaveBot."""

    def __init__(self, world: World, dt: float) -> None:
        super().__init__(world, OFF, dt)
        self._world = world
        self._delay = world.delay
        self._last_settings: Settings | None = None  # the last ones of the drive

    def read(self, now: float) -> Sense:
        self._advance_to(now)
        return plant_coupling.sense(self._world.readings(), self._delay)

    def write(self, command: Command) -> None:
        settings = command.drive.settings
        if settings is not self._last_settings:
            self._configure(settings)
        self._world.actuate(plant_coupling.actuation(command))

    def _configure(self, settings: Settings) -> None:
        changed, self._last_settings = settings != self._last_settings, settings
        if changed and settings.bus_voltage > 0.0:  # all zero where the drive has none
            self._world.configure(plant_drive_settings(settings))

    def coupling(self) -> CoupledWorld:
        """Return the plant as it is between two ticks."""
        return CoupledWorld(self._world, self._noise, self._last_settings)

    @cached_property
    def _noise(self) -> Noise:
        now = self._world.conditions()
        return interleaved(now.params.sensors, now.normals)  # 16 MB

    def plant_code(self) -> PlantCode:
        return PLANT_CODE


def build_world(config: dict[str, Any], dt: float) -> World:
    """Return the rig in its sea for {"plant": mapping, "bem": path, "sea": mapping, "seed": int}.

    "device": "absent" gives the empty basin of a wave calibration, "compiled": false interprets the
    plant with the same results, "hoist" raises and lowers the body from the wave trigger on.
    """
    stepper = Stepper
    if config.get("compiled", True):
        from rig.kinds.wavebot.rehearsal.compiled_plant import CompiledStepper  # noqa: PLC0415  (numba takes a second)

        stepper = CompiledStepper
    plant = Plant.model_validate(config["plant"])
    return World(
        plant,
        build_sea(config["sea"]),
        read_bem(Path(config["bem"])),
        read_bem(Path(config["surge_bem"])),
        dt=dt,
        seed=config["seed"],
        device=config.get("device", "present") == "present",
        stepper=stepper,
        hoist=_hoist_profile(config.get("hoist")),
    )


def _hoist_profile(settings: dict[str, Any] | None) -> MotionProfile | None:
    if settings is None:
        return None
    return hoist_cycle_profile(
        settings["low_m"], settings["high_m"], settings["speed_m_per_s"], settings["turn_s"]
    )


def connect(config: dict[str, Any], dt: float) -> WaveBotPlantDevices:
    """Return the simulated devices for a configuration of `build_world`."""
    return WaveBotPlantDevices(build_world(config, dt), dt)
