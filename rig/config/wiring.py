"""The parts of a rig's wiring: buses, lines, ports, drives, register blocks.

A rehearsal needs no wiring. The wiring of each kind of rig is a subclass of `Wiring` with such
parts as fields, so its wires, drives and register blocks are found by the types of its fields.
"""

import difflib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Protocol, Self, TypeVar

from pydantic import Discriminator, Field, Tag, model_validator

from drivers.canopen.bus_settings import SOCKETCAND_PORT, BusSettings
from drivers.cia402.drive_objects import BY_NAME
from drivers.modbus.registers import BIT_TABLES, MAX_SIZE, REGISTER_COUNT
from rig.config.model import FileModel, RuleViolation, TupleOf, WholeNumber
from rig.config.problems import format_number, format_value
from rig.config.segment import (
    ANY_DRIVE,
    POSITION_DRIVE,
    TORQUE_DRIVE,
    Segment,
    SlaveDevice,
    TerminalBlock,
)
from rig.config.yaml_source import KeyPath

Node = Annotated[WholeNumber, Field(ge=1, le=127)]
"""CANopen node number."""
Int32 = Annotated[WholeNumber, Field(ge=-(2**31), le=2**31 - 1)]
"""A signed 32-bit value; no object of a drive is larger."""
Period = Annotated[float, Field(ge=0.002, le=60)]
_RELATIVE_TOLERANCE = 1e-6
Divider = Annotated[WholeNumber, Field(ge=1, le=240)]
"""Number of SYNCs per frame."""


class CanBus(FileModel):
    """A CAN bus; interface names and options are python-can's."""

    interface: str = Field(min_length=1)  # python-can's name: socketcan, socketcand, pcan, ...
    channel: str = Field(min_length=1)  # as python-can names it: can0, PCAN_USBBUS1, ...
    bit_rate: WholeNumber = Field(ge=10_000, le=1_000_000)  # of the bus, bit/s
    options: dict[str, Any] = Field(default_factory=dict)
    """Further arguments of python-can, unchanged."""
    own_node: Node  # of this computer, for its heartbeat
    heartbeat_s: float = Field(ge=0.005, le=1)  # between our heartbeats, sent from the tick
    slow_divider: Divider  # SYNCs between mode display and error code of a drive
    actuator_divider: Divider  # SYNCs between commands to an actuator

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the TCP port of socketcand, which the emulated bus opens, too."""
        port = self.options.get("port", SOCKETCAND_PORT)
        if self.interface == "socketcand" and not (type(port) is int and 1 <= port <= 65_535):
            message = f"{format_value(port)} is no TCP port; allowed 1 .. 65535"
            yield RuleViolation(("options", "port"), message, port)

    def settings(self) -> BusSettings:
        """Return the settings with which programs open the bus."""
        options = tuple(self.options.items())
        return BusSettings(self.interface, self.channel, self.bit_rate, options)


class Deadlines(FileModel):
    """Maximum times of a drive's state transitions (CiA 402)."""

    transition_s: float = Field(gt=0, le=10)  # any single transition
    boot_s: float = Field(gt=0, le=60)  # from power-on or reset until the drive answers
    ramp_s: float = Field(gt=0, le=60)  # a complete quick stop or fault reaction
    stale_s: float = Field(gt=0, le=5)  # age at which a statusword becomes invalid


class CanNode(NamedTuple):
    """The settings of a drive as a node of a CAN bus."""

    node: int
    command_deadline_ms: int
    heartbeat_lost_ms: int
    heartbeat_ms: int


class Drive(FileModel, ABC):
    """Settings that drives and actuators of CiA 402 have in common.

    On a CAN bus a drive is a node. On an EtherCAT segment it is the slave of its name.
    """

    node: Node | None = None
    # Without a command, and without our heartbeat, the drive stops.
    command_deadline_ms: Annotated[WholeNumber, Field(ge=1, le=65_535)] | None = None
    """Time without a command after which the drive stops."""
    heartbeat_lost_ms: Annotated[WholeNumber, Field(ge=10, le=65_535)] | None = None
    """Time without our heartbeat after which the drive stops."""
    heartbeat_ms: Annotated[WholeNumber, Field(ge=10, le=65_535)] | None = None  # of the drive
    slave_type: ClassVar[str]  # of its slave on a segment
    deadlines: Deadlines  # time limits of state changes
    follows: bool  # statusword bit 12 reports that the drive follows a cyclic command
    mode_first: bool  # 0x6061 shows the mode before the drive is enabled
    objects: dict[str, WholeNumber | None]  # by name; null: the drive does not have the object
    read_only: tuple[str, ...] = Field(default=(), strict=False)  # objects that cannot be written

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the names of objects are known."""
        for name in self.objects:
            if name not in BY_NAME:
                near = difflib.get_close_matches(name, BY_NAME, n=1)
                hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(BY_NAME)}"
                message = f"no such object; {hint}"
                yield RuleViolation(("objects", name), message, self.objects[name])

    @property
    @abstractmethod
    def description(self) -> str:
        """The description of the device for people."""

    @property
    def can_node(self) -> CanNode:
        """The settings of a drive on a CAN bus, which has them all."""
        values = [getattr(self, key) for key in CanNode._fields]
        assert None not in values
        return CanNode(*values)


class TorqueDrive(Drive):
    """A drive in cyclic synchronous torque mode."""

    slave_type: ClassVar[str] = TORQUE_DRIVE

    scaling: Literal["amc", "rated_torque", "rated_current"]
    """Units of torque and current in process data."""
    current_limit_a: float = Field(gt=0, le=500)  # clips the command, in addition to all limits
    analog_per_v: tuple[float, ...] = Field(default=(), max_length=4, strict=False)
    """SI unit per volt of each analog input, to which load cells and sensors may be wired."""
    analog_v_per_count: float = Field(default=1.0 / 819.2, gt=0, le=1)  # AMC: 819.2 counts a volt

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the objects, and that no analog input has the scale 0."""
        yield from super().check_rules()
        for at, scale in enumerate(self.analog_per_v):
            if scale == 0.0:
                yield RuleViolation(("analog_per_v", at), "0 gives no value", scale)

    @property
    def description(self) -> str:
        """The description of the device for people."""
        scale = self.scaling.replace("_", " ")
        return (
            f"torque drive, {'AMC scaling' if self.scaling == 'amc' else f'scaled by its {scale}'}"
        )


class Actuator(Drive):
    """An actuator that moves a part of the rig between rows, in profile position mode."""

    description: ClassVar[str] = "actuator: profile position, homing"
    slave_type: ClassVar[str] = POSITION_DRIVE

    counts_per_percent: float = Field(ge=-1e7, le=1e7)
    """Increments of the drive per percent of the travel."""
    zero_counts: Int32  # position at 0 %
    low_percent: float = Field(ge=-100, le=100)  # lowest position
    high_percent: float = Field(ge=-100, le=100)  # highest position
    velocity: WholeNumber = Field(ge=1, le=2**32 - 1)  # 0x6081, in the drive's unit
    window_counts: WholeNumber = Field(ge=0, le=2**32 - 1)  # around the goal: arrived
    stand_s: float = Field(ge=0, le=10)
    """Time at the goal, within the window, until the move has ended."""
    move_s: float = Field(gt=0, le=600)  # timeout of a move
    homing: bool  # home before every run
    homing_s: float = Field(default=120, gt=0, le=600)  # timeout of homing

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the objects, that the scale is not 0 and the low limit below the high limit."""
        yield from super().check_rules()
        if self.counts_per_percent == 0.0:
            yield RuleViolation(("counts_per_percent",), "0 gives no position", 0.0)
        yield from self.check_below("low_percent", "high_percent")


class SerialPort(FileModel):
    """A serial port; a path under /dev/serial/by-id always names the same adapter."""

    description: ClassVar[str] = "device with a serial port of its own"

    port: str = Field(min_length=1)  # path of the serial port
    baud: WholeNumber = Field(ge=1200, le=4_000_000)  # bit rate, 1/s
    parity: Literal["N", "E", "O"]  # none, even or odd
    stop_bits: Literal[1, 2]  # of a character
    rts_cts: bool = False  # hardware handshake
    echo: bool = False  # a two-wire RS-485 adapter that receives its own bytes
    low_latency: bool = False  # request the adapter's driver to deliver bytes at once


class UdpDevice(FileModel):
    """A device with a UDP port of its own."""

    description: ClassVar[str] = "device on the network"
    protocol: ClassVar[str] = "UDP"

    host: str = Field(min_length=1)  # numeric address: resolving a name could block
    port: WholeNumber = Field(ge=1, le=65_535)  # of UDP


class LoadCell(UdpDevice):
    """A six-axis load cell of ATI with a Net F/T box."""

    description: ClassVar[str] = "ATI Net F/T"
    protocol: ClassVar[str] = "RDT over UDP"

    counts_per_force: float = Field(gt=0, le=1e9)  # of the sensor's calibration
    counts_per_torque: float = Field(gt=0, le=1e9)  # of the sensor's calibration
    force_unit: Literal["lbf", "N", "klbf", "kN", "kgf", "gf"]  # of counts_per_force
    torque_unit: Literal["lbf-in", "lbf-ft", "N-m", "N-mm", "kgf-cm", "kN-m"]
    """Of counts_per_torque."""
    model: Literal["net_ft", "axia"]  # defines the meaning of the status bits
    rate_hz: float = Field(ge=0, le=100_000)  # of its sample counter; 0: unknown
    turned_over: bool  # mounted upside down: y and z change sign
    quiet_s: float = Field(gt=0, le=5)  # without samples: the box gets a new request
    silence_s: float = Field(gt=0, le=5)  # without samples: the cell counts as silent


class TcpLine(FileModel):
    """A Modbus/TCP server."""

    kind: Literal["tcp"]  # Modbus/TCP
    host: str = Field(min_length=1)  # name or address of the server or gateway
    port: WholeNumber = Field(ge=1, le=65_535)  # of TCP
    timeout_s: float = Field(gt=0, le=10)  # of each answer


class RtuLine(FileModel):
    """A serial line with Modbus RTU."""

    kind: Literal["rtu"]  # Modbus RTU
    port: str = Field(min_length=1)
    """Path under /dev/serial/by-id, which always names the same adapter."""
    baud: WholeNumber = Field(ge=1200, le=4_000_000)  # bit rate, 1/s
    parity: Literal["N", "E", "O"]  # none, even or odd
    stop_bits: Literal[1, 2]  # of each character
    timeout_s: float = Field(gt=0, le=10)  # of each answer
    slowest_s: float = Field(gt=0, le=10)  # time within which the slowest unit has always answered


AnyLine = Annotated[TcpLine | RtuLine, Field(discriminator="kind")]


class RegisterValue(FileModel):
    """One value in a block of registers."""

    name: str  # as the rig names the value
    at: WholeNumber = Field(ge=0, le=2000)  # place in the block, from 0
    kind: Literal["bit", "u16", "i16", "u32", "i32", "f32"]
    """Type: bit, integer (u, i) or floating point (f) with its bits."""
    scale: float = Field(default=1.0, ge=-1e9, le=1e9)  # value per unit of the register
    low: float = Field(default=-1e12, ge=-1e12, le=1e12)  # a value outside low .. high is invalid
    high: float = Field(default=1e12, ge=-1e12, le=1e12)  # greatest valid value

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the scale is not 0 and that the range is not empty."""
        if self.scale == 0.0:
            yield RuleViolation(("scale",), "0 gives no value", 0.0)
        yield from self.check_below("low", "high")


class RegisterSetup(FileModel):
    """A register that is written when its line is opened, e.g. the time of a unit's watchdog.

    With ``write: false`` the register is not written, but must already have the value, e.g. the
    status of the watchdog.
    """

    first: WholeNumber = Field(ge=0, le=65_535)  # address
    value: WholeNumber = Field(ge=0, le=65_535)  # of the register
    read_back: bool = True  # check that the register reads as written
    write: bool = True  # false: the register must already have the value

    @model_validator(mode="after")
    def _reads_or_writes(self) -> Self:
        if not (self.read_back or self.write):
            raise ValueError("neither written nor read: one of read_back and write must be true")
        return self


class Registers(FileModel):
    """A block of registers of one unit, with the values that are polled or written there."""

    line: str  # name in `lines`
    unit: WholeNumber = Field(ge=0, le=247)  # address of the unit
    table: Literal["coil", "discrete", "input", "holding"]  # Modbus table of the block
    first: WholeNumber = Field(ge=0, le=65_535)  # address of the first register
    size: WholeNumber = Field(ge=1, le=2000)  # number of registers
    word_order: Literal["high first", "low first"]  # order of the registers of a 32-bit value
    period_s: Period  # between two requests
    # Register of the same table in which the unit counts its updates, if it has one: values with
    # an unchanged count are not new.
    counter: WholeNumber | None = Field(default=None, ge=0, le=65_535)
    values: TupleOf[RegisterValue] = Field(min_length=1, strict=False)
    # holding registers, in the order in which they are set
    prepare: tuple[RegisterSetup, ...] = Field(default=(), strict=False)

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that one request can read the block, and that every value is in it."""
        if self.size > MAX_SIZE[self.table]:
            message = f"{self.size} cannot be read at once; allowed up to {MAX_SIZE[self.table]}"
            yield self.violation("size", message)
        if self.first + self.size > _ADDRESSES:
            message = f"{self.first} + size = {self.size} is beyond the last address, 65535"
            yield self.violation("first", message)
        kinds = ["bit"] if self.table in BIT_TABLES else [k for k in REGISTER_COUNT if k != "bit"]
        for at, value in enumerate(self.values):
            key, count = ("values", at), REGISTER_COUNT[value.kind]
            if value.kind not in kinds:
                message = f"{value.kind} is not in a table {self.table}; allowed {', '.join(kinds)}"
                yield RuleViolation((*key, "kind"), message, value.kind)
            elif value.at > self.size - count:
                message = (
                    f"{value.at} is beyond the block: {value.kind} takes {count} of its size = "
                    f"{self.size}; allowed at + {count} <= size"
                )
                yield RuleViolation((*key, "at"), message, value.at)
            if value.name in [each.name for each in self.values[:at]]:
                message = f"{value.name} is the name of an earlier value; allowed any other"
                yield RuleViolation((*key, "name"), message, value.name)


_ADDRESSES = 0x10000

AnyBlock = Annotated[
    Annotated[Registers, Tag("registers")] | Annotated[TerminalBlock, Tag("terminals")],
    Discriminator(lambda block: "registers" if _has_line(block) else "terminals"),
]
"""Values of a device: registers of a Modbus unit, or values of EtherCAT terminals."""


def _has_line(block: Any) -> bool:
    return isinstance(block, Registers) or (isinstance(block, dict) and "line" in block)


class BlockContent(NamedTuple):
    """Annotation of a field that is a register block: its device and the values expected in it."""

    device: str  # for people
    signals: Mapping[str, str]  # units of the values by name, in this order
    written: bool = False  # True: a run writes the block; False: it is polled


PANEL_INPUTS = BlockContent(
    "I/O coupler: digital inputs", {"e_stop": "flag", "limit_switch": "flag"}
)
"""The digital inputs of a rig; they are for monitoring only: the stop chain is hard-wired."""
WAVE_TRIGGER = BlockContent("I/O coupler: digital outputs", {"wave_trigger": "flag"}, written=True)
"""The output that starts the wave maker."""

WirePart = CanBus | Segment | TcpLine | RtuLine | SerialPort | UdpDevice


class Wire(NamedTuple):
    """One wire of a rig."""

    name: str  # CAN, EtherCAT, line io, servo, ...
    kind: Literal["can", "ethercat", "tcp", "udp", "serial"]
    part: WirePart

    @property
    def address(self) -> str:
        """The wire's address, for people."""
        if isinstance(self.part, CanBus):
            return f"{self.part.interface} {self.part.channel}"
        if isinstance(self.part, Segment):
            return self.part.interface
        if isinstance(self.part, TcpLine | UdpDevice):
            return f"{self.part.host}:{self.part.port}"
        return self.part.port


class Wiring(FileModel):
    """The wiring of a rig: Modbus lines, and the parts that its kind has as further fields.

    A field is a part, or a mapping of parts by their names.
    """

    lines: dict[str, AnyLine] = Field(default_factory=dict)  # Modbus lines by name, TCP or RTU
    output_expiry_s: float = Field(default=0.25, ge=0.05, le=10)  # age of an output's command

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that every register block has the expected values and a line, every node its own.

        Names of values must be those of the block's content, in its order.
        """
        parts = tuple(self._parts())
        for key, block in parts:
            if not isinstance(block, Registers | TerminalBlock):
                continue
            expected = tuple(self.block_content(key[-1]).signals)
            names = tuple(value.name for value in block.values)
            if names != expected:
                message = f"must be {', '.join(expected)} in this order"
                yield RuleViolation((*key, "values"), message, names)
            if isinstance(block, TerminalBlock):
                yield from self._terminal_rules(key, block)
            elif block.line not in self.lines:
                known = ", ".join(self.lines) or "none"
                yield RuleViolation((*key, "line"), f"no such line; there are {known}", block.line)
        yield from self._drive_rules()
        yield from self._port_rules()
        nodes = [((*key, "node"), part.node) for key, part in parts
                 if isinstance(part, Drive) and part.node is not None]  # fmt: skip
        nodes += [
            ((*key, "own_node"), part.own_node) for key, part in parts if isinstance(part, CanBus)
        ]
        taken: dict[int, str] = {}
        for key, node in nodes:
            if node in taken:
                message = f"{node} is the number of {taken[node]}, too; two nodes need two numbers"
                yield RuleViolation(key, message, node)
            taken[node] = ".".join(key)

    def _port_rules(self) -> Iterator[RuleViolation]:
        """Check that no two wires have one serial port: a program alone can open it."""
        taken: dict[str, str] = {}
        for key, part in self._parts():
            if isinstance(part, RtuLine | SerialPort):
                if part.port in taken:
                    message = f"is the port of {taken[part.port]}, too; two wires need two ports"
                    yield RuleViolation((*key, "port"), message, part.port)
                taken[part.port] = ".".join(key)

    def _drive_rules(self) -> Iterator[RuleViolation]:
        """Check that all drives are nodes of the one bus, or slaves of the one segment."""
        can, segment = self.can_bus(), self.segment()
        drives = [(key, part) for key, part in self._parts() if isinstance(part, Drive)]
        if can is not None and segment is not None:
            yield RuleViolation(("ethercat",), "a rig has one bus for its drives; here is can, too")
        elif drives and can is None and segment is None:
            yield RuleViolation((), "the drives need a bus; allowed can or ethercat")
        elif segment is not None:
            for key, drive in drives:
                given = [each for each in CanNode._fields if getattr(drive, each) is not None]
                for each in given:
                    message = "belongs to a CAN bus; a slave of a segment has watchdog_ms instead"
                    yield RuleViolation((*key, each), message, getattr(drive, each))
                yield from self._slave_rules(segment, key, drive)
        else:
            for key, drive in drives:
                for each in CanNode._fields:
                    if getattr(drive, each) is None:
                        yield RuleViolation((*key, each), "missing; a node of a CAN bus has it")

    def _slave_rules(
        self, segment: Segment, key: tuple[str, ...], drive: Drive
    ) -> Iterator[RuleViolation]:
        """Check that a drive is the slave of its name."""
        found = next((slave for slave in segment.line if slave.name == key[-1]), None)
        if found is None:
            names = ", ".join(segment.places())
            yield RuleViolation(key, f"no slave has this name; the line has {names}")
        elif found.device.type not in (drive.slave_type, ANY_DRIVE):
            message = (
                f"the slave of this name is a {found.device.type}; allowed a {drive.slave_type}"
            )
            yield RuleViolation(key, message)

    def _terminal_rules(
        self, key: tuple[str, ...], block: TerminalBlock
    ) -> Iterator[RuleViolation]:
        """Check that each value is one of a slave of the line, in the block's direction."""
        segment = self.segment()
        slaves = {each.name: each.device for each in segment.line} if segment else {}
        written = self.block_content(key[-1]).written
        for at, each in enumerate(block.values):
            place: KeyPath = (*key, "values", at)
            parts = [(place, each.slave, each.value)]
            if each.plus is not None:
                parts.append(((*place, "plus"), each.plus.slave, each.plus.value))
            for part in parts:
                yield from _source_rules(slaves, written, *part)

    def rate_rules(self, rate: int) -> Iterator[RuleViolation]:
        """Yield a violation for each drive or time that does not fit the rate of the loop (Hz)."""
        yield from self._interpolation_rules(rate)
        if segment := self.segment():
            for key, message, value in segment.rate_rules(rate):
                yield RuleViolation(("ethercat", *key), message, value)

    def _interpolation_rules(self, rate: int) -> Iterator[RuleViolation]:
        """Yield a violation for each drive whose interpolation time (0x60C2) is not the tick.

        ``rate`` in Hz. The drive would reach the command of a tick too early or too late.
        """
        for key, part in self._parts():
            if isinstance(part, TorqueDrive):
                time = part.objects.get("interpolation_time")
                exponent = part.objects.get("interpolation_exponent")
                if time is None or exponent is None:
                    continue
                ticks = rate * time * 10.0**exponent
                if abs(ticks - 1.0) > _RELATIVE_TOLERANCE:
                    yield RuleViolation(
                        (*key, "objects", "interpolation_time"),
                        f"{time} x 10^{exponent} s lasts {format_number(ticks)} ticks at rate_hz = "
                        f"{rate}; allowed only one tick, {format_number(1.0 / rate)} s",
                        time,
                    )

    def wires(self) -> tuple[Wire, ...]:
        """Return every wire: buses and ports in the order of the fields, then the lines."""
        found = []
        for (*_, name), part in self._parts():
            if isinstance(part, CanBus):
                found.append(Wire("CAN", "can", part))
            elif isinstance(part, Segment):
                found.append(Wire("EtherCAT", "ethercat", part))
            elif isinstance(part, SerialPort):
                found.append(Wire(name.replace("_", " "), "serial", part))
            elif isinstance(part, UdpDevice):
                found.append(Wire(name.replace("_", " "), "udp", part))
        for name, line in self.lines.items():
            kind: Literal["tcp", "serial"] = "tcp" if isinstance(line, TcpLine) else "serial"
            found.append(Wire(f"line {name}", kind, line))
        return tuple(found)

    def can_bus(self) -> CanBus | None:
        """Return the CAN bus; None without one."""
        return next((part for _, part in self._parts() if isinstance(part, CanBus)), None)

    def segment(self) -> Segment | None:
        """Return the EtherCAT segment; None without one."""
        return next((part for _, part in self._parts() if isinstance(part, Segment)), None)

    def drives(self) -> dict[str, Drive]:
        """Return the drives and actuators on the bus by name."""
        return {key[-1]: part for key, part in self._parts() if isinstance(part, Drive)}

    def blocks(self) -> dict[str, Registers]:
        """Return the register blocks by name."""
        return {key[-1]: part for key, part in self._parts() if isinstance(part, Registers)}

    def terminal_blocks(self) -> dict[str, TerminalBlock]:
        """Return the blocks of terminals by name."""
        return {key[-1]: part for key, part in self._parts() if isinstance(part, TerminalBlock)}

    def block_content(self, name: str) -> BlockContent:
        """Return the annotation of a block."""
        metadata = type(self).model_fields[name].metadata
        return next(each for each in metadata if isinstance(each, BlockContent))

    def _parts(self) -> Iterator[tuple[tuple[str, ...], object]]:
        """Yield key and part of every field, and of every entry of a field that is a mapping."""
        for field in type(self).model_fields:
            value = getattr(self, field)
            yield (field,), value
            if isinstance(value, dict):
                yield from (((field, name), part) for name, part in value.items())


def _source_rules(
    slaves: Mapping[str, SlaveDevice], written: bool, key: KeyPath, slave: str, value: str
) -> Iterator[RuleViolation]:
    """Check that a slave of the line has a value in a direction."""
    if slave not in slaves:
        known = ", ".join(slaves) or "none: there is no ethercat"
        yield RuleViolation((*key, "slave"), f"no such slave; the line has {known}", slave)
        return
    device = slaves[slave]
    pdos = device.outputs if written else device.inputs
    names = [each.name for pdo in pdos for each in pdo.values if each.name]
    if value not in names:
        direction, other = ("output", "input") if written else ("input", "output")
        if value in [each.name for each in device.values()]:
            fault = f"is an {other} of {slave}, and this block needs {direction}s"
        else:
            fault = f"{slave} has no such {direction}"
        message = f"{fault}; allowed {', '.join(names) or 'none'}"
        yield RuleViolation((*key, "value"), message, value)


W_co = TypeVar("W_co", bound=Wiring, covariant=True)


class WiringError(ValueError):
    """A wiring that must not be powered; the message lists all reasons."""


class _WiredRigFile(Protocol[W_co]):
    @property
    def name(self) -> str: ...

    @property
    def wiring(self) -> W_co | None: ...


def wiring_of(rig: _WiredRigFile[W_co]) -> W_co:
    """Return the wiring of a rig file; WiringError if it has none."""
    if rig.wiring is None:
        raise WiringError(f"{rig.name} has no wiring: it can only be rehearsed")
    return rig.wiring
