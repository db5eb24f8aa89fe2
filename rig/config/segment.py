"""The parts of an EtherCAT segment in a rig file: the line of slaves, and the values of terminals.

EtherCAT is a registered trade mark and patented technology, licensed by Beckhoff Automation GmbH.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from rig.config.model import FileModel, RuleViolation, TupleOf, WholeNumber
from rig.config.problems import format_number

Object = Annotated[WholeNumber, Field(ge=0, le=0xFFFF)]
"""Index of an object, or of a mapping."""
Sub = Annotated[WholeNumber, Field(ge=0, le=0xFF)]
"""Sub-index of an object."""
Unsigned32 = Annotated[WholeNumber, Field(ge=0, le=2**32 - 1)]
Cycle = Annotated[WholeNumber, Field(ge=1, le=2**32 - 1)]
"""Time between two pulses of SYNC0, in ns."""
ObjectType = Literal["u8", "i8", "u16", "i16", "u32", "i32"]
ValueType = Literal["bit", "u8", "i8", "u16", "i16", "u32", "i32", "u64", "i64", "f32", "f64"]

_LEAST_TICKS = 3  # without a frame, until the slaves or the loop may stop the rig

RESERVED = ("segment", "ethercat")
"""Names of faults of the whole line, and of its cable, at emulated devices."""
TORQUE_DRIVE, POSITION_DRIVE, ANY_DRIVE = "torque drive", "position drive", "drive"
"""Types of devices whose process data are those of the drivers; `ANY_DRIVE`: either."""


class ProcessValue(FileModel):
    """A value in the process data, or several of one type in a row."""

    name: str = ""  # empty: a gap
    object: Object = 0
    sub: Sub = 0  # of the first
    type: ValueType  # with its number of bits
    count: WholeNumber = Field(default=1, ge=1, le=256)  # their mean is the value
    invalid_mask: Unsigned32 = 0  # bits of a status: with one of them the slave's inputs are wrong

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that a status is one whole number."""
        if self.invalid_mask and (self.type[0] == "f" or self.count > 1):
            message = "a status is one whole number or bit; allowed no count, and no type f"
            yield RuleViolation(("invalid_mask",), message, self.invalid_mask)


class Pdo(FileModel):
    """A process data object with its values, in their order."""

    pdo: Object = 0  # index of its mapping; 0: fixed in the slave
    values: TupleOf[ProcessValue] = Field(min_length=1)


class ObjectSetting(FileModel):
    """An object that is written and read back before a run."""

    object: Object
    sub: Sub
    type: ObjectType  # with its number of bits
    value: WholeNumber = Field(ge=-(2**31), le=2**32 - 1)  # that is written

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the value fits its type."""
        bits, signed = int(self.type[1:]), self.type[0] == "i"
        low, high = -(1 << bits - 1) if signed else 0, (1 << bits - signed) - 1
        if not low <= self.value <= high:
            message = f"does not fit {self.type}; allowed {low} .. {high}"
            yield RuleViolation(("value",), message, self.value)


class SlaveDevice(FileModel):
    """Identity, process data and settings of a slave; a file of `configs/devices`."""

    title: str = Field(min_length=1)  # name for people
    type: Literal["coupler", "terminal", "torque drive", "position drive", "drive"]
    """`drive` is either of the two drives."""
    vendor: Unsigned32  # vendor number (0x1018:01)
    product: Unsigned32  # product code (0x1018:02)
    revision: Unsigned32 | None = None  # None: any
    mailbox: bool  # CoE: it has objects
    sync0: bool = False  # it works with SYNC0 only
    # ns, cycles of which its SYNC0 must have one; none: that of any tick
    sync0_cycles_ns: tuple[Cycle, ...] = Field(default=(), strict=False)
    outputs: tuple[Pdo, ...] = Field(default=(), strict=False)  # in the order of 0x1C12
    inputs: tuple[Pdo, ...] = Field(default=(), strict=False)  # in the order of 0x1C13
    objects: tuple[ObjectSetting, ...] = Field(default=(), strict=False)
    """Written and read back before a run."""

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that names are unique, and that what has no mailbox has nothing to set."""
        names = Counter(value.name for value in self.values() if value.name)
        for name, number in names.items():
            if number > 1:
                yield RuleViolation(("inputs",), f"{number} values have the name {name}", name)
        for key, first in (("outputs", 0x1600), ("inputs", 0x1A00)):
            # Without a mailbox the PDOs are fixed, and nobody uses the index.
            for at, pdo in enumerate(getattr(self, key) if self.mailbox else ()):
                if pdo.pdo and not first <= pdo.pdo < first + 0x200:
                    message = f"{pdo.pdo:#06x} is no mapping of {key}; allowed {first:#06x} .. "
                    message += f"{first + 0x1FF:#06x}"
                    yield RuleViolation((key, at, "pdo"), message, pdo.pdo)
        if self.objects and not self.mailbox:
            yield RuleViolation(("objects",), "a slave without mailbox has no objects to write")

    def values(self) -> Iterator[ProcessValue]:
        """Yield all values of both directions."""
        for pdo in (*self.outputs, *self.inputs):
            yield from pdo.values


class Slave(FileModel):
    """A slave of the line; identity here replaces that of its device file."""

    name: str = Field(min_length=1, max_length=32)  # of the slave, in messages and in `slave` keys
    device: SlaveDevice  # device file by name or path, or a slave of an ESI file: FILE.xml#TYPE
    vendor: Unsigned32 | None = None  # replaces that of the device file
    product: Unsigned32 | None = None  # replaces that of the device file
    revision: Unsigned32 | None = None  # replaces that of the device file
    objects: tuple[ObjectSetting, ...] = Field(default=(), strict=False)  # besides its device's
    sync0: bool | None = None
    """Whether it works with SYNC0, a pulse in each cycle of the clock; none: if it must."""

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that a slave which needs SYNC0 has it, and that what has objects has a mailbox."""
        if self.device.sync0 and self.sync0 is False:
            yield self.violation("sync0", "the device works with SYNC0 only; allowed true")
        if self.objects and not self.device.mailbox:
            message = "a slave without mailbox has no objects to write"
            yield RuleViolation(("objects",), message)

    @property
    def has_sync0(self) -> bool:
        """Whether it is set up for SYNC0."""
        return self.device.sync0 if self.sync0 is None else self.sync0

    @property
    def identity(self) -> tuple[int, int, int | None]:
        """Vendor, product and revision that the slave must report; None: any revision."""
        own = self.device
        return (
            own.vendor if self.vendor is None else self.vendor,
            own.product if self.product is None else self.product,
            own.revision if self.revision is None else self.revision,
        )


class Segment(FileModel):
    """An EtherCAT segment: the network interface and its slaves in the order of the cable."""

    interface: str = Field(min_length=1, max_length=15)  # 15: the longest name in Linux
    line: TupleOf[Slave] = Field(min_length=1, max_length=256)
    watchdog_ms: float = Field(ge=1, le=6000)  # without frames for longer, outputs fall
    lost_ms: float = Field(ge=2, le=5000)  # inputs of this age mean a lost segment
    clock: Literal["free run", "distributed"] = "free run"
    """`distributed`: the loop follows the clock of the first slave that has one."""
    frame_at: float = Field(default=0.5, ge=0, le=0.9)  # of a cycle of that clock, before SYNC0
    actuator_divider: WholeNumber = Field(default=10, ge=1, le=240)  # ticks between two commands

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the names of the slaves are unique."""
        if self.interface == "lo":
            yield self.violation("interface", "lo is no network card; allowed any other interface")
        seen: set[str] = set()
        for place, slave in enumerate(self.line):
            if slave.name in RESERVED:
                message = f"{slave.name} means something else; allowed any other name"
                yield RuleViolation(("line", place, "name"), message, slave.name)
            if slave.name in seen:
                message = f"{slave.name} is the name of an earlier slave; allowed any other"
                yield RuleViolation(("line", place, "name"), message, slave.name)
            seen.add(slave.name)
            if slave.has_sync0 and self.clock != "distributed":
                message = "needs clock: distributed of the segment"
                yield RuleViolation(("line", place, "sync0"), message, slave.sync0)

    def rate_rules(self, rate: int) -> Iterator[RuleViolation]:
        """Yield a violation for each time that does not fit a rate of the loop (Hz).

        Some late frames must not exceed it, and SYNC0 comes with each tick.
        """
        least = _LEAST_TICKS * 1e3 / rate
        for key in ("watchdog_ms", "lost_ms"):
            if getattr(self, key) < least:
                yield self.violation(
                    key,
                    f"{format_number(getattr(self, key))} is less than {_LEAST_TICKS} ticks at "
                    f"rate_hz = {rate}; allowed at least {format_number(least)} ms",
                )
        tick = round(1e9 / rate)
        for place, slave in enumerate(self.line):
            cycles = slave.device.sync0_cycles_ns
            if slave.has_sync0 and cycles and tick not in cycles:
                message = f"its SYNC0 must come each {' or '.join(map(str, cycles))} ns, but comes "
                message += f"with each tick of {tick} ns; allowed rate_hz = "
                message += " or ".join(format_number(1e9 / each) for each in cycles)
                yield RuleViolation(("line", place, "device"), message)

    def places(self) -> dict[str, int]:
        """Return the place of each slave by its name, 0 next to the computer."""
        return {slave.name: place for place, slave in enumerate(self.line)}


class OtherValue(FileModel):
    """A value of the process data that is added to another, ``scale`` times."""

    slave: str  # of the line
    value: str  # of its device
    scale: float = Field(ge=-1e9, le=1e9)  # per unit of the process data


class TerminalValue(FileModel):
    """A value of a rig that a terminal has: ``scale`` times that of the process data, + offset."""

    name: str  # as the rig names the value
    slave: str  # of the line
    value: str  # of its device
    scale: float = Field(default=1.0, ge=-1e9, le=1e9)  # value per unit of the process data
    offset: float = Field(default=0.0, ge=-1e12, le=1e12)  # added to the scaled value
    plus: OtherValue | None = None  # e.g. a load cell that pulls the other way, with a scale < 0
    low: float = Field(default=-1e12, ge=-1e12, le=1e12)  # a value outside low .. high is invalid
    high: float = Field(default=1e12, ge=-1e12, le=1e12)  # greatest valid value

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the scale is not 0 and that the range is not empty."""
        if self.scale == 0.0:
            yield RuleViolation(("scale",), "0 gives no value", 0.0)
        yield from self.check_below("low", "high")


class TerminalBlock(FileModel):
    """Values of terminals that belong together; all are read in every tick, or written."""

    description: ClassVar[str] = "values of terminals"

    values: TupleOf[TerminalValue] = Field(min_length=1)

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that names are unique."""
        for at, value in enumerate(self.values):
            if value.name in [each.name for each in self.values[:at]]:
                message = f"{value.name} is the name of an earlier value; allowed any other"
                yield RuleViolation(("values", at, "name"), message, value.name)
