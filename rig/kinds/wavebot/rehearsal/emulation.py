"""Emulated devices of a wired WaveBot: one process, one world, on the far end of the rig's wires.

`rig sim RIG` starts the process alone, `rig run ... --sim` as the first I/O process of a run. It
uses only the wires' settings of the rig file: addresses, node numbers, units. The control port
(`rig.emulation.control`) switches faults of the devices.
"""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from rig.config.shipped_files import shipped_folder
from rig.config.wiring import Actuator, Registers, TorqueDrive
from rig.emulation.addresses import occupied_addresses, unreachable_addresses
from rig.emulation.control import ControlServer, FaultTargets
from rig.emulation.process import modbus_line, serve_devices, without_delay
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.rehearsal.devices import build_world
from rig.processes.io_process import report_event, run_io_process
from rig.processes.io_processes import IoProcess
from sim_plant.emulators.actuator_units import ActuatorParams
from sim_plant.emulators.can_hub import CanHub
from sim_plant.emulators.canopen_node import CanopenNode, NodeParams
from sim_plant.emulators.foreign_node import ForeignNode
from sim_plant.emulators.io_coupler import CouplerSettings, DigitalInput, IoCoupler
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.power_analyser import (
    AnalyserSettings,
    Block,
    PowerAnalyser,
    Quantity,
    Terminals,
)
from sim_plant.emulators.power_analyser import TerminalValues as Terminal
from sim_plant.emulators.running import Emulator, running
from sim_plant.emulators.shared_world import SharedWorld
from sim_plant.emulators.stator_actuator import StatorActuator
from sim_plant.emulators.strain_amplifier import AmplifierSettings, StrainAmplifier
from sim_plant.emulators.torque_drive import AnalogInput, Axis, Scaling, TorqueDriveParams
from sim_plant.emulators.torque_drive import TorqueDrive as Drive
from sim_plant.signals import Readings
from sim_plant.world import World

if TYPE_CHECKING:
    from rig.planning.campaign.files import Campaign

EDS_FOLDER = shipped_folder() / "devices"
AMC_EDS, RATED_EDS, ACTUATOR_EDS = (
    EDS_FOLDER / f"{name}.eds"
    for name in ("amc_torque_drive", "cia402_torque_drive", "nanotec_actuator")
)
PROCESS_NAME = "emulated devices"
AXES = ("heave", "surge")
READY_TIMEOUT_S = 30.0  # s until all devices are ready: the plant is compiled first
_CELL_RATING, _PROBE_RATING = 20_000.0, 5.0  # N and m, of the amplifiers
_ANALYSER_ITEMS: tuple[tuple[Block, Quantity], ...] = (
    ("sum", "P"), ("element_1", "P"), ("element_1", "U"),
)  # fmt: skip
_ANALOG_READINGS = {"heave": ("force_lcb", "force_trs"), "surge": ("string_pot", "rotor_angle")}


def emulator_process(campaign: "Campaign") -> IoProcess:
    """Return the emulated devices of a campaign's rig, in its sea, as an I/O process of the run."""
    from rig.kinds.wavebot.rehearsal import job  # noqa: PLC0415  (scipy: seconds, and the devices need none)

    return emulated_rig_process(campaign.rig, job.plant_settings(campaign))


def emulated_rig_process(rig: RigFile, plant: dict[str, Any]) -> IoProcess:
    """Return a rig's emulated devices as an I/O process; ``plant`` as of `job.plant_settings`."""
    config = {"rig": rig.model_dump(mode="json"), "plant": plant}
    return IoProcess(
        PROCESS_NAME,
        "rig.kinds.wavebot.rehearsal.emulation",
        config,
        (),
        READY_TIMEOUT_S,
        starts_first=True,
    )


class EmulatedWaveBot:
    """All devices of one rig."""

    def __init__(
        self,
        rig: RigFile,
        world: SharedWorld,
        loop: asyncio.AbstractEventLoop,
        create_world: Callable[[], World],
    ) -> None:
        """``create_world`` returns a world at rest, for a restart."""
        wiring = rig.wiring
        if wiring is None:
            raise ValueError(f"{rig.name} has no wiring to hang emulated devices on")
        self._wiring = wiring
        self._world = world
        self.hub = CanHub(loop)
        shared = self.hub, loop, world
        heave, surge = (
            _torque_drive_params("heave", wiring.heave),
            _torque_drive_params("surge", wiring.surge),
        )
        in_heave = Drive(heave[0], heave[1], *shared)
        self.foreign = ForeignNode(in_heave, self.hub, loop)
        self.nodes: dict[str, CanopenNode] = {
            "heave": in_heave,
            "surge": Drive(surge[0], surge[1], *shared),
            "stator": StatorActuator(
                NodeParams(wiring.stator.node, ACTUATOR_EDS),
                _actuator_params(wiring.stator),
                *shared,
            ),
        }
        self.units: dict[str, ModbusUnit] = {}
        self.lines: dict[str, Emulator] = dict(self._create_lines())
        links = {"can": self.hub.link, **{f"line {n}": one.link for n, one in self.lines.items()}}
        self.control = ControlServer(
            FaultTargets(
                self.nodes,
                {**self.units, "foreign node": self.foreign},
                links,
                world,
                lambda: world.replace_world(create_world()),
                {axis: partial(self._powered, axis) for axis in AXES},
                self._report,
            )
        )

    async def serve(self, ended: asyncio.Event) -> None:
        """Serve the devices until ``ended``; report a JSON line with their addresses when ready."""
        can = self._wiring.can
        host, port = can.options.get("host", "127.0.0.1"), int(can.options.get("port", 0))
        host, port = await self.hub.serve(host, port)
        for node in self.nodes.values():
            node.power_on()
        try:
            async with running(self.lines) as addresses:
                await self.control.start()
                fixed = {"can": f"socketcand {host}:{port}", "control": self.control.address}
                report_event(event="ready", facts={**fixed, **addresses})
                while not ended.is_set():
                    self._world.catch_up()
                    self.hub.poll()
                    self.foreign.poll()
                    self.control.update_power()
                    with suppress(TimeoutError):
                        await asyncio.wait_for(ended.wait(), 5 * self._world.dt)
        finally:
            await self.control.close()
            for node in self.nodes.values():
                node.power_off()
            await self.hub.close()

    def _powered(self, axis: str) -> bool:
        return bool(getattr(self._world.actuation, f"{axis}_enable"))

    def _report(self) -> dict[str, Any]:
        now = self._world.readings()
        return {
            "frames": self.hub.frame_count,
            "currents": {axis: getattr(now, f"{axis}_current") for axis in AXES},
        }

    def _create_lines(self) -> dict[str, Emulator]:
        """Return the Modbus lines, each with its units."""
        wiring = self._wiring
        units_by_name: dict[str, tuple[Registers, ModbusUnit]] = {
            "analyser": (wiring.analyser, self._analyser()),
            "cells": (wiring.cells, self._amplifier(_cell_forces, _CELL_RATING)),
            "probes": (wiring.probes, self._amplifier(_probe_elevations, _PROBE_RATING)),
            "io": (wiring.inputs, self._coupler()),
        }
        self.units = {name: unit for name, (_, unit) in units_by_name.items()}
        lines: dict[str, Emulator] = {}
        for name, line in wiring.lines.items():
            units = {at.unit: unit for at, unit in units_by_name.values() if at.line == name}
            lines[name] = modbus_line(line, units)
        return lines

    def _analyser(self) -> PowerAnalyser:
        world = self._world

        def terminals() -> Terminals:
            now = world.readings()
            dc = Terminal(voltage=now.bus_voltage, power=now.power_dc)
            at = world.time - now.analyser_age
            return Terminals(at, element_1=dc, sum=Terminal(power=now.power_ac))

        return PowerAnalyser(terminals, AnalyserSettings(update_period=0.0, items=_ANALYSER_ITEMS))

    def _amplifier(self, channels: Any, rating: float) -> StrainAmplifier:
        world = self._world
        return StrainAmplifier(lambda: channels(world.readings()), AmplifierSettings(rating))

    def _coupler(self) -> IoCoupler:
        world = self._world

        def write(channel: str, value: float) -> None:
            world.actuate(wave_trigger=int(value))

        names = [value.name for value in self._wiring.inputs.values]
        inputs = tuple(DigitalInput(name, f"{name}_on", 1) for name in names)
        settings = CouplerSettings(inputs=inputs, outputs=("wave_trigger",))
        return IoCoupler(settings, write=write)


def _torque_drive_params(name: str, drive: TorqueDrive) -> tuple[NodeParams, TorqueDriveParams]:
    amc = drive.scaling == "amc"
    inputs = tuple(
        AnalogInput(reading, scale)
        for reading, scale in zip(_ANALOG_READINGS[name], drive.analog_per_v, strict=True)
    )
    return (
        NodeParams(drive.node, AMC_EDS if amc else RATED_EDS),
        TorqueDriveParams(Axis(name), Scaling.AMC if amc else Scaling.RATED, analog=inputs),
    )


def _actuator_params(actuator: Actuator) -> ActuatorParams:
    return ActuatorParams()


def _cell_forces(read: Readings) -> tuple[float, ...]:
    return read.force_slew, read.force_stator_a, read.force_stator_b


def _probe_elevations(read: Readings) -> tuple[float, ...]:
    return read.probe_1, read.probe_2, read.probe_3


def _create_devices(config: dict[str, Any], loop: asyncio.AbstractEventLoop) -> EmulatedWaveBot:
    rig = RigFile.model_validate(config["rig"])
    if rig.wiring is not None and (
        problems := (*unreachable_addresses(rig.wiring), *occupied_addresses(rig.wiring))
    ):
        raise OSError("\n".join(problems))
    dt, plant = 1.0 / rig.rate_hz, without_delay(config["plant"])

    def create_world() -> World:
        return build_world(plant, dt)

    return EmulatedWaveBot(rig, SharedWorld(create_world(), dt, loop.time), loop, create_world)


def serve(job: dict[str, Any]) -> None:
    """Serve until terminated, or until the loop and the I/O processes have ended."""
    serve_devices(job, _create_devices)


if __name__ == "__main__":
    run_io_process(serve)
