"""The simulated WaveBot for ticks compiled together with it (`rig.realtime.coupled_ticks`).

Compiled are the step of the plant, its sensors and the wave maker. Between chunks of ticks the
basin probes are sampled, and settings of the custom drive applied.
"""

from collections.abc import Callable
from typing import Any

from controllers.signals import DriveSettings
from rig.compilation.column import Column
from rig.compilation.tick_source import PlantCode
from rig.emulation.in_process import WholePlant
from rig.kinds.wavebot.rehearsal import plant_coupling
from rig.kinds.wavebot.rehearsal.plant_coupling import Device, Plant
from rig.realtime.tick_memory import FlatMemory
from sim_plant import custom_drive
from sim_plant.sensors import SensorParams
from sim_plant.wavebot import WaveBotParams
from sim_plant.world import Conditions, World

PLANT_CODE = PlantCode((plant_coupling.advance_plant, plant_coupling.sense, plant_coupling.actuate))
_NO_SETTINGS = DriveSettings(0, 0.0, 0.0, 0.0, 0.0, 0)


Noise = tuple[SensorParams, Column]
"""Sensors and their table of noise, of `rig.kinds.wavebot.rehearsal.noise.interleaved`."""


def couple(
    now: Conditions, noise: Noise, settings: DriveSettings = _NO_SETTINGS
) -> tuple[Plant, Device]:
    """Return constants and state of a world; ``settings`` are the last ones of its drive."""
    given = now.tables
    waves: Any = {name: Column(getattr(given, name)) for name in ("elevation", "heave", "surge")}
    tables = given._replace(**waves)
    sensors, normals = noise
    plant = Plant(now.params._replace(sensors=sensors), tables, normals, now.delay)
    sea = now.waves
    return plant, Device(
        now.state, sea, now.delay_line, now.actuation, now.fresh, settings,
        sea.tick, sea.onset_factor,
    )  # fmt: skip


class CoupledWaveBot(WholePlant):
    """A plant whose ticks run compiled; between them settings of its drive are applied."""

    def __init__(
        self, plant: Plant, device: Device, configured: Callable[[Any], WaveBotParams]
    ) -> None:
        """``configured`` returns the constants of the plant for settings of the custom drive."""
        super().__init__(plant, device)
        self._configured = configured

    def attach(self, memory: FlatMemory) -> None:
        """Take the memory on which ticks work from now on."""
        self._memory = memory
        self._settings = memory.bytes_of("device", "settings")
        self._applied = bytes(self._settings)

    def act(self, tick: int) -> None:
        """Apply settings of the drive that a tick has changed."""
        if self._settings != self._applied:
            self._applied = bytes(self._settings)
            device: Device = self._memory.get("device")
            constants = self._configured(plant_drive_settings(device.settings))
            constants = constants._replace(sensors=self.plant.constants.sensors)
            self._memory.set("plant", self.plant._replace(constants=constants))


class CoupledWorld(CoupledWaveBot):
    """A world whose ticks run compiled; between them its basin probes are sampled, too."""

    def __init__(self, world: World, noise: Noise, settings: DriveSettings | None) -> None:
        """``settings``: the last ones that the world's drive got; None: it got none."""
        self._world = world
        plant, device = couple(world.conditions(), noise, settings or _NO_SETTINGS)
        super().__init__(plant, device, world.configured)

    def attach(self, memory: FlatMemory) -> None:
        super().attach(memory)
        self._probes = memory.bytes_of("device", "state", "probes").cast("d")
        self._velocity = memory.number("device", "state", "body", "velocity")
        self._sampled_tick = memory.number("device", "sampled_tick")
        self._sampled_onset = memory.number("device", "sampled_onset")

    def ticks_until_due(self, tick: int) -> int:
        """Return the ticks up to and including that of the next sample of the probes."""
        return max(1, self._world.next_probe_tick - tick + 1)

    def act(self, tick: int) -> None:
        """Sample the probes, and apply settings of the drive that a tick has changed."""
        if tick > self._world.next_probe_tick:
            probes = self._world.sample_probes(
                int(self._sampled_tick[0]), self._sampled_onset[0], self._velocity[0]
            )
            for i, number in enumerate(probes):
                self._probes[i] = number
        super().act(tick)


def plant_drive_settings(settings: DriveSettings) -> custom_drive.DriveSettings:
    """Return the plant's settings of the custom drive for those of a command."""
    scheme, voltage, period, tolerance, _, level = settings
    return custom_drive.DriveSettings(scheme, voltage, period, tolerance, level)
