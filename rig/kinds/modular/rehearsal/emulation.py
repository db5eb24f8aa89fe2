"""Emulated devices of a wired modular rig, on the far end of the rig's wires (`rig.emulation`)."""

import asyncio
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from rig.campaign import AnyCampaign
from rig.config.problems import ConfigError
from rig.config.wiring import Registers, TorqueDrive, WiringError, wiring_of
from rig.config.yaml_source import SourceMap
from rig.emulation.campaign_sea import campaign_sea
from rig.emulation.devices import EmulatedDevices, emulated_bus, load_cell, modbus_lines
from rig.emulation.process import emulation_process, run_devices
from rig.kinds.modular.checks import check
from rig.kinds.modular.config import ModularWiring, RigFile
from rig.kinds.modular.config.wiring import WRENCH
from rig.kinds.modular.rehearsal import job
from rig.kinds.modular.rehearsal.devices import build_world
from rig.planning.input_files import ConfigSource
from rig.processes.io_processes import IoProcess
from sim_plant.emulators.ft_calibration import Wrench
from sim_plant.emulators.io_coupler import CouplerSettings, DigitalInput, IoCoupler
from sim_plant.emulators.modbus_pdu import Table
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.modes_motors import SharedModes, axis_motor, axis_power, sensor_reading
from sim_plant.emulators.register_map import MappedValue, RegisterMap, RegisterMapUnit
from sim_plant.emulators.running import Emulator
from sim_plant.emulators.torque_drive import PER_VOLT, AnalogInput
from sim_plant.modes.world import World

Read = Callable[[], float]
Blocks = Mapping[str, Registers]

_TICKS_PER_STEP = 5  # the drives advance the world themselves when they need its present state
_TABLES = {
    "coil": Table.COILS, "discrete": Table.DISCRETE_INPUTS,
    "holding": Table.HOLDING, "input": Table.INPUT,
}  # fmt: skip
_BITS = ("coil", "discrete")


def emulator_process(campaign: AnyCampaign) -> IoProcess:
    """Return the emulated devices of a campaign's rig, in its sea, as an I/O process of the run.

    WiringError if the sea has waves, but no output starts them.
    """
    file, rig = campaign.file, campaign.rig
    if file.sea.kind != "calm" and wiring_of(rig).outputs is None:
        raise WiringError(
            f"{rig.name} has no wiring.outputs, so its emulated wave maker could not be started; "
            "add outputs with wave_trigger, or use sea: {kind: calm}"
        )
    plant = ConfigSource(campaign.plant, campaign.plant_locate)
    return _emulated_rig(rig, plant, campaign_sea(campaign), campaign.seed)


def emulate_rig(
    rig: RigFile, plant: dict[str, Any], locate_plant: SourceMap
) -> tuple[IoProcess, str]:
    """Return the emulated devices of a rig without a campaign, and their setting for people.

    ConfigError has all problems of the plant, with the rig, too.
    """
    source = ConfigSource(plant, locate_plant)
    _, problems = job.plant_problems(source, rig, locate_plant, rig.rate_hz)
    if problems:
        raise ConfigError(problems)
    return _emulated_rig(rig, source, {"kind": "calm"}, 0), "calm water"


def emulate_task(path: Path, rig: Path) -> tuple[RigFile, IoProcess, str]:
    """Return the rig of a campaign run on a rig file, its emulated devices and their setting."""
    report = check(path, rig)
    if report.campaign is None:
        raise ConfigError(report.problems, report.unchecked)
    campaign = report.campaign
    setting = f"{campaign.file.sea.description()}, once the rig's wave trigger is on"
    return campaign.rig, emulator_process(campaign), setting


def _emulated_rig(rig: RigFile, plant: ConfigSource, sea: dict[str, Any], seed: int) -> IoProcess:
    """Return the process; the plant has no delay: emulated wires have their own."""
    undelayed = ConfigSource({**plant.mapping, "delay_s": 0.0}, plant.locate)
    world = job.world_settings(undelayed, sea, seed)
    return emulation_process("rig.kinds.modular.rehearsal.emulation", rig, plant=world)


def build_devices(
    rig: RigFile, config: dict[str, Any], loop: asyncio.AbstractEventLoop
) -> EmulatedDevices:
    """Return the devices of the process with this configuration; none has started yet."""
    wiring, dt = wiring_of(rig), 1.0 / rig.rate_hz

    def create_world() -> World:
        return build_world(config["plant"], dt)

    first = create_world()
    world = SharedModes(first, first.rest, dt, loop.time)
    reads = {
        str(sensor.source): sensor_reading(world, name) for name, sensor in rig.sensors.items()
    }
    bus = emulated_bus(wiring, world, loop)
    for name, drive in wiring.axes.items():
        increments = first.model.plant.axes[name].counts_per_revolution
        motor, analog = axis_motor(world, name), _analog(name, drive, reads)
        bus.add_torque_drive(name, drive, motor, analog, increments)
    bus.add_terminals(reads, {"outputs.wave_trigger": partial(_set_trigger, world)})
    units = _modbus_units(wiring, world, reads)
    cells = {name: load_cell(cell, partial(_wrench, name, reads))
             for name, cell in wiring.load_cells.items()}  # fmt: skip
    wires: dict[str, Emulator] = {bus.name: bus}
    wires |= {f"network {name}": cell for name, cell in cells.items()}
    return EmulatedDevices(
        world,
        wires | modbus_lines(wiring.lines, ((wiring.blocks()[n], u) for n, u in units.items())),
        bus.step,
        lambda: world.replace_world(create_world()),
        bus.nodes,
        {**cells, **units},
        {name: axis_power(world, name) for name in wiring.axes},
        lambda: {"frames": bus.frame_count, "readings": world.world.readings()},
        _TICKS_PER_STEP,
    )


def _zero() -> float:
    return 0.0


def _analog(name: str, drive: TorqueDrive, reads: Mapping[str, Read]) -> tuple[AnalogInput, ...]:
    """Return the sensors on a drive's analog inputs, of which some may have no sensor."""
    steps = PER_VOLT * drive.analog_v_per_count  # the drive's raw steps over those of the file
    return tuple(
        AnalogInput(reads.get(f"{name}.analog_{at}", _zero), per_volt * steps)
        for at, per_volt in enumerate(drive.analog_per_v, start=1)
    )


def _wrench(cell: str, reads: Mapping[str, Read]) -> Wrench:
    return Wrench(*(reads.get(f"{cell}.{component}", _zero)() for component in WRENCH))


def _modbus_units(
    wiring: ModularWiring, world: SharedModes, reads: Mapping[str, Read]
) -> dict[str, ModbusUnit]:
    """Return the unit of each register block; blocks with one line and number share theirs."""
    places: dict[tuple[str, int], dict[str, Registers]] = {}
    for name, block in wiring.blocks().items():
        places.setdefault((block.line, block.unit), {})[name] = block
    units: dict[str, ModbusUnit] = {}
    for (line, number), blocks in places.items():
        if len({block.word_order for block in blocks.values()}) > 1:
            raise OSError(f"line {line}, unit {number}: an emulated unit has only one word_order")
        bits = all(block.table in _BITS for block in blocks.values())
        panel = bits and set(blocks) <= {"inputs", "outputs"}
        unit = _coupler(blocks, world) if panel else _register_map(blocks, world, reads)
        units |= dict.fromkeys(blocks, unit)
    return units


def _set_trigger(world: SharedModes, value: float) -> None:
    world.actuate(wave_trigger=int(value))


def _coupler(blocks: Blocks, world: SharedModes) -> IoCoupler:
    """Return an I/O coupler with a watchdog; other inputs up to the last one are not connected."""
    inputs: list[DigitalInput] = []
    outputs: list[str] = []
    for name, block in blocks.items():
        by_address = {block.first + value.at: value.name for value in block.values}
        names = [by_address.get(at, f"{name}_{at}") for at in range(block.first + block.size)]
        if name == "outputs":
            outputs = names
        else:
            inputs = [DigitalInput(each, f"{each}_on", 1) for each in names]

    def write(channel: str, value: float) -> None:
        if channel == "wave_trigger":
            _set_trigger(world, value)

    return IoCoupler(CouplerSettings(inputs=tuple(inputs), outputs=tuple(outputs)), write=write)


def _register_map(blocks: Blocks, world: SharedModes, reads: Mapping[str, Read]) -> RegisterMapUnit:
    """Return a unit with the registers of its blocks where the rig file has them."""
    values: list[MappedValue] = []
    unused: list[tuple[Table, int]] = []
    outputs: dict[tuple[Table, int], Callable[[int], None]] = {}
    stored: dict[int, int] = {}
    counters = []
    for name, block in blocks.items():
        table, taken = _TABLES[block.table], set()
        for value in block.values:
            address = block.first + value.at
            taken |= {address, address + (1 if value.kind in ("u32", "i32", "f32") else 0)}
            if name == "outputs":
                outputs[table, address] = partial(_set_trigger, world)
                continue
            read = reads.get(f"{name}.{value.name}", _zero)
            fault = f"{value.name}_on" if name == "inputs" else ""
            values.append(MappedValue(table, address, value.kind, read, value.scale, fault))
        addresses = range(block.first, block.first + block.size)
        unused += [(table, address) for address in addresses if address not in taken]
        counters += [(table, block.counter)] if block.counter is not None else []
        stored |= {each.first: 0 if each.write else each.value for each in block.prepare}
    registers = RegisterMap(tuple(values), tuple(unused), tuple(counters), outputs, stored)
    order = next(iter(blocks.values())).word_order
    return RegisterMapUnit(
        registers, word_order="upper first" if order == "high first" else "lower first"
    )


if __name__ == "__main__":
    run_devices(RigFile, build_devices)
