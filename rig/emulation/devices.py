"""The emulated devices of a rig: what a kind of rig builds for the process that serves them."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from rig.config.wiring import (
    Actuator,
    AnyLine,
    CanBus,
    LoadCell,
    Registers,
    RtuLine,
    SerialPort,
    TcpLine,
    TorqueDrive,
    Wiring,
)
from rig.emulation.device_files import ACTUATOR_EDS, drive_parts, of_its_model
from rig.emulation.segment import EmulatedSegment, Reads, Writes
from sim_plant.emulators.can_hub import CanHub
from sim_plant.emulators.canopen_node import CanopenNode, NodeParams
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.device_objects import ObjectEntry
from sim_plant.emulators.fault_list import Fault
from sim_plant.emulators.ft_calibration import Calibration, SixAxes, Wrench
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.modbus_rtu import RtuLine as RtuUnits
from sim_plant.emulators.modbus_tcp import TcpUnits
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.net_ft import NetFt, NetFtSettings
from sim_plant.emulators.object_device import ObjectDevice
from sim_plant.emulators.running import Emulator
from sim_plant.emulators.schedule import Schedule
from sim_plant.emulators.serial_line import SerialLine, SerialLineSettings
from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.emulators.torque_drive import AnalogInput, Motor
from sim_plant.emulators.torque_drive import TorqueDrive as EmulatedDrive


class FaultyNode(Protocol):
    """A drive or terminal on a bus, with its faults."""

    @property
    def active(self) -> Mapping[str, float]:
        """The active faults with their values."""

    @property
    def error_codes(self) -> list[int]:
        """The codes of the errors that the device reports."""

    @property
    def state(self) -> int:
        """The state on the bus: NMT or AL."""

    def faults(self) -> tuple[Fault, ...]:
        """Return all faults."""

    def inject(self, name: str, value: float | None = None) -> None:
        """Activate a fault; ValueError for an unknown name."""

    def clear(self, name: str) -> None:
        """End a fault."""

    def restart(self) -> None:
        """Switch the device off and on."""


class HasFaults(Protocol):
    """A device with its own list of faults."""

    @property
    def faults(self) -> DeviceFaults:
        """The faults of the device."""


class EmulatedDevices(NamedTuple):
    """The emulated devices of one rig; all read and actuate one world."""

    world: SharedSimulation[Any, Any]
    wires: Mapping[str, Emulator]  # each with the faults of its link
    step: Callable[[], None]  # advance world and devices to the present
    restart: Callable[[], None]  # replace the present world by one at rest
    nodes: Mapping[str, FaultyNode] = {}
    units: Mapping[str, HasFaults] = {}  # devices other than nodes, by name
    powered: Mapping[str, Callable[[], bool]] = {}  # by motor: whether it has power
    report: Callable[[], dict[str, Any]] = dict  # for the control port's answer to "world"
    ticks_per_step: int = 1


class EmulatedBus:
    """A CAN bus behind socketcand with its nodes, as one of a rig's wires."""

    name = "can"

    def __init__(self, can: CanBus, world: SharedSimulation[Any, Any], schedule: Schedule) -> None:
        self.address = ""
        self.hub = CanHub(schedule)
        self.link = self.hub.link
        self.nodes: dict[str, CanopenNode[ObjectDevice]] = {}  # they have power while the bus runs
        self._endpoint = can.settings().endpoint
        self._world = world
        self._schedule = schedule

    def add_torque_drive(
        self,
        name: str,
        wiring: TorqueDrive,
        motor: Motor,
        analog: tuple[AnalogInput, ...] = (),
        encoder_increments: int = 0,
    ) -> CanopenNode[EmulatedDrive]:
        """Return the drive of a motor, a new node; ``analog``: the sensors on its inputs.

        ``encoder_increments`` 0: those of the drive's object dictionary.
        """
        eds, params = drive_parts(wiring, analog, encoder_increments)
        address = NodeParams(wiring.can_node.node, eds)
        entries = of_its_model(address.entries(), wiring)
        drive = EmulatedDrive(entries, params, self._world, self._schedule.time, motor)
        node = CanopenNode(address, self.hub, self._schedule, drive)
        self.nodes[name] = node
        return node

    def add_actuator(
        self,
        name: str,
        wiring: Actuator,
        create: Callable[[tuple[ObjectEntry, ...]], ObjectDevice],
    ) -> None:
        """Add an actuator, which ``create`` returns for its objects."""
        address = NodeParams(wiring.can_node.node, ACTUATOR_EDS)
        self.nodes[name] = CanopenNode(address, self.hub, self._schedule, create(address.entries()))

    def add_terminals(self, reads: Reads, writes: Writes) -> None:
        """Connect nothing: a CAN bus has no terminals."""

    @property
    def frame_count(self) -> int:
        """The number of frames so far."""
        return self.hub.frame_count

    async def start(self) -> None:
        """Open the bus to other processes and switch its nodes on."""
        host, port = await self.hub.serve(*self._endpoint)
        self.address = f"socketcand {host}:{port}"
        for node in self.nodes.values():
            node.power_on()

    def step(self) -> None:
        """Advance the world to the present and serve the clients of the bus."""
        self._world.catch_up()
        self.hub.poll()

    async def close(self) -> None:
        """Switch the nodes off and disconnect all clients."""
        for node in self.nodes.values():
            node.power_off()
        await self.hub.close()


def emulated_bus(
    wiring: Wiring, world: SharedSimulation[Any, Any], schedule: Schedule
) -> EmulatedBus | EmulatedSegment:
    """Return the bus of a rig's drives."""
    segment, can = wiring.segment(), wiring.can_bus()
    if segment is not None:
        return EmulatedSegment(wiring, segment, world, schedule)
    assert can is not None
    return EmulatedBus(can, world, schedule)


def modbus_lines(
    lines: Mapping[str, AnyLine], units: Iterable[tuple[Registers, ModbusUnit]]
) -> dict[str, Emulator]:
    """Return the Modbus lines of a rig, each with its units where the register blocks are."""
    placed: dict[str, dict[int, ModbusUnit]] = {name: {} for name in lines}
    for block, unit in units:
        placed[block.line][block.unit] = unit
    return {f"line {name}": _modbus_line(line, placed[name]) for name, line in lines.items()}


def _modbus_line(line: AnyLine, units: dict[int, ModbusUnit]) -> Emulator:
    if isinstance(line, TcpLine):
        return TcpUnits(units, port=line.port)
    return RtuUnits(serial_line(line), units)


def serial_line(wire: SerialPort | RtuLine) -> SerialLine:
    """Return a serial line under the path of a port, whose missing folders its start creates."""
    bits = 11 if wire.parity != "N" or wire.stop_bits == 2 else 10
    return SerialLine(SerialLineSettings(Path(wire.port), wire.baud, bits), LinkFaults(seed=1))


def load_cell(
    wiring: LoadCell, read: Callable[[], Wrench], ratings: SixAxes | None = None
) -> NetFt:
    """Return a load cell behind its box; all its ports except the stream's are free ones.

    ``read`` returns the wrench with the rig's signs; ``ratings``: N and N*m, by default all that
    the stream's numbers can carry.
    """
    sign = -1.0 if wiring.turned_over else 1.0

    def of_cell() -> Wrench:
        fx, fy, fz, tx, ty, tz = read()
        return Wrench(fx, sign * fy, sign * fz, tx, sign * ty, sign * tz)

    force, torque = round(wiring.counts_per_force), round(wiring.counts_per_torque)
    largest = (*(_INT32 / force,) * 3, *(_INT32 / torque,) * 3)
    calibration = Calibration(
        counts_per_force=force, counts_per_torque=torque, ratings=ratings or largest
    )
    return NetFt(of_cell, NetFtSettings(wiring.host, wiring.port, 0, 0, calibration=calibration))


_INT32 = 2.0**31 - 1.0
