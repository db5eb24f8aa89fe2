"""Emulated devices of a wired WaveBot, on the far end of the rig's wires (`rig.emulation`)."""

import asyncio
from collections.abc import Callable
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.config.pydantic_errors import validate
from rig.config.wiring import AnyBlock, Registers, wiring_of
from rig.config.yaml_source import SourceMap
from rig.emulation.devices import (
    EmulatedBus,
    EmulatedDevices,
    emulated_bus,
    modbus_lines,
)
from rig.emulation.process import emulation_process, run_devices, without_delay
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.rehearsal.bem_files import bem_settings
from rig.kinds.wavebot.rehearsal.devices import build_world
from rig.processes.io_processes import IoProcess
from sim_plant.emulators.actuator_units import ActuatorParams
from sim_plant.emulators.canopen_node import CanopenNode
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
from sim_plant.emulators.shared_world import SharedWorld
from sim_plant.emulators.stator_actuator import StatorActuator
from sim_plant.emulators.strain_amplifier import AmplifierSettings, StrainAmplifier
from sim_plant.emulators.wavebot_motors import MOTORS, analog_inputs, stator
from sim_plant.parameters import Plant
from sim_plant.world import World

if TYPE_CHECKING:
    from rig.kinds.wavebot.campaign import Campaign

_TICKS_PER_STEP = 5  # the drives advance the world themselves when they need its present state
_CELL_RATING, _PROBE_RATING = 20_000.0, 5.0  # N and m, of the amplifiers
_CELLS = ("force_slew", "force_stator_a", "force_stator_b")  # fields of `Readings`
_PROBES = ("probe_1", "probe_2", "probe_3")
_ANALYSER_ITEMS: tuple[tuple[Block, Quantity], ...] = (
    ("sum", "P"), ("element_1", "P"), ("element_1", "U"),
)  # fmt: skip


def emulator_process(campaign: "Campaign") -> IoProcess:
    """Return the emulated devices of a campaign's rig, in its sea, as an I/O process of the run."""
    from rig.kinds.wavebot.rehearsal import job  # noqa: PLC0415  (scipy: seconds, and the devices need none)

    return _emulated_rig(campaign.rig, job.plant_settings(campaign))


def emulate_rig(
    rig: RigFile, plant: dict[str, Any], locate_plant: SourceMap
) -> tuple[IoProcess, str]:
    """Return the emulated devices of a rig without a campaign, and their setting for people.

    ConfigError has all problems of the plant.
    """
    validate(plant, locate_plant, Plant)
    settings: dict[str, Any] = {
        "plant": plant,
        **bem_settings(plant, locate_plant),
        "sea": {"kind": "calm"},
        "seed": 0,
        "device": "present",
    }
    return _emulated_rig(rig, settings), "calm water"


def emulate_task(path: Path, rig: Path) -> tuple[RigFile, IoProcess, str]:
    """Return the rig of a campaign run on a rig file, its emulated devices and their setting."""
    from rig.kinds.wavebot.campaign import open_campaign  # noqa: PLC0415
    from rig.kinds.wavebot.rehearsal import job  # noqa: PLC0415  (scipy: seconds)

    campaign = open_campaign(path, job.problems, rig)
    setting = f"{campaign.file.sea.description()}, once the rig's wave trigger is on"
    return campaign.rig, emulator_process(campaign), setting


def _emulated_rig(rig: RigFile, plant: dict[str, Any]) -> IoProcess:
    """Return a rig's emulated devices as an I/O process; ``plant`` as of `job.plant_settings`."""
    return emulation_process("rig.kinds.wavebot.rehearsal.emulation", rig, plant=plant)


def build_devices(
    rig: RigFile, config: dict[str, Any], loop: asyncio.AbstractEventLoop
) -> EmulatedDevices:
    """Return the devices of the process with this configuration; none has started yet."""
    wiring, dt, plant = wiring_of(rig), 1.0 / rig.rate_hz, without_delay(config["plant"])

    def create_world() -> World:
        return build_world(plant, dt)

    world = SharedWorld(create_world(), dt, loop.time)
    bus = emulated_bus(wiring, world, loop)
    heave, _ = (
        bus.add_torque_drive(
            name, drive, MOTORS[name](world), analog_inputs(world, name, drive.analog_per_v)
        )
        for name, drive in (("heave", wiring.heave), ("surge", wiring.surge))
    )
    bus.add_actuator(
        "stator",
        wiring.stator,
        lambda entries: StatorActuator(entries, ActuatorParams(), world, loop.time, stator(world)),
    )
    bus.add_terminals(_terminal_reads(world), {"outputs.wave_trigger": partial(_trigger, world)})
    devices: dict[str, tuple[AnyBlock, ModbusUnit]] = {
        "analyser": (wiring.analyser, _analyser(world)),
        "cells": (wiring.cells, _amplifier(world, _CELLS, _CELL_RATING)),
        "probes": (wiring.probes, _amplifier(world, _PROBES, _PROBE_RATING)),
        "io": (wiring.inputs, _coupler(world, wiring.inputs)),
    }
    units = {
        name: (block, unit)
        for name, (block, unit) in devices.items()
        if isinstance(block, Registers)
    }
    foreign = {}
    if isinstance(bus, EmulatedBus) and isinstance(heave, CanopenNode):
        foreign["foreign node"] = ForeignNode(heave, bus.hub, loop)

    def step() -> None:
        bus.step()
        for each in foreign.values():
            each.poll()

    def powered(axis: str) -> bool:
        return bool(getattr(world.actuation, f"{axis}_enable"))

    def report() -> dict[str, Any]:
        now = world.readings()
        currents = {axis: getattr(now, f"{axis}_current") for axis in MOTORS}
        return {"frames": bus.frame_count, "currents": currents}

    return EmulatedDevices(
        world,
        {bus.name: bus, **modbus_lines(wiring.lines, units.values())},
        step,
        lambda: world.replace_world(create_world()),
        bus.nodes,
        {**{name: unit for name, (_, unit) in units.items()}, **foreign},
        {axis: partial(powered, axis) for axis in MOTORS},
        report,
        _TICKS_PER_STEP,
    )


def _analyser(world: SharedWorld) -> PowerAnalyser:
    def terminals() -> Terminals:
        now = world.readings()
        dc = Terminal(voltage=now.bus_voltage, power=now.power_dc)
        at = world.time - now.analyser_age
        return Terminals(at, element_1=dc, sum=Terminal(power=now.power_ac))

    return PowerAnalyser(terminals, AnalyserSettings(update_period=0.0, items=_ANALYSER_ITEMS))


def _amplifier(world: SharedWorld, fields: tuple[str, ...], rating: float) -> StrainAmplifier:
    channels = attrgetter(*fields)
    return StrainAmplifier(lambda: channels(world.readings()), AmplifierSettings(rating))


def _trigger(world: SharedWorld, value: float) -> None:
    world.actuate(wave_trigger=int(value))


def _terminal_reads(world: SharedWorld) -> dict[str, Callable[[], float]]:
    """Return the values that EtherCAT terminals may measure, by block and name."""

    def reading(field: str) -> float:
        value: float = getattr(world.readings(), field)
        return value

    fields = {f"cells.{field.removeprefix('force_')}": field for field in _CELLS}
    fields |= {f"probes.{field}": field for field in _PROBES}
    return {name: partial(reading, field) for name, field in fields.items()}


def _coupler(world: SharedWorld, block: AnyBlock) -> IoCoupler:
    def write(channel: str, value: float) -> None:
        _trigger(world, value)

    inputs = tuple(DigitalInput(value.name, f"{value.name}_on", 1) for value in block.values)
    return IoCoupler(CouplerSettings(inputs=inputs, outputs=("wave_trigger",)), write=write)


if __name__ == "__main__":
    run_devices(RigFile, build_devices)
