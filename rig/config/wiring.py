"""The wiring of a WaveBot: buses, lines and their devices. A rehearsal needs no wiring."""

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from rig.config.model import FileModel, RuleViolation, TupleOf, WholeNumber
from rig.config.problems import format_number

Node = Annotated[WholeNumber, Field(ge=1, le=127)]
"""CANopen node number."""
Int32 = Annotated[WholeNumber, Field(ge=-(2**31), le=2**31 - 1)]
"""A signed 32-bit value; no object of a drive is larger."""
Period = Annotated[float, Field(ge=0.002, le=60)]
Divider = Annotated[WholeNumber, Field(ge=1, le=240)]
"""Number of SYNCs per frame."""


def check_below(model: FileModel, low: str, high: str) -> Iterator[RuleViolation]:
    """Yield a violation unless the value of key ``low`` is below that of key ``high``."""
    low_value, high_value = getattr(model, low), getattr(model, high)
    if not low_value < high_value:
        message = f"{format_number(low_value)} is not below {high} = {format_number(high_value)}"
        yield RuleViolation((low,), message, low_value)


class CanBus(FileModel):
    """A CAN bus; interface names and options are python-can's."""

    interface: str = Field(min_length=1)
    channel: str = Field(min_length=1)
    bit_rate: WholeNumber = Field(ge=10_000, le=1_000_000)
    options: dict[str, Any] = Field(default_factory=dict)
    own_node: Node  # of this computer, for its heartbeat
    heartbeat_s: float = Field(ge=0.005, le=1)  # between our heartbeats, sent from the tick
    slow_divider: Divider  # SYNCs between mode display and error code of a drive
    actuator_divider: Divider  # SYNCs between commands to an actuator


class Deadlines(FileModel):
    """Maximum times of a drive's state transitions (CiA 402)."""

    transition_s: float = Field(gt=0, le=10)  # any single transition
    boot_s: float = Field(gt=0, le=60)
    ramp_s: float = Field(gt=0, le=60)  # a complete quick stop or fault reaction
    stale_s: float = Field(gt=0, le=5)  # age at which a statusword becomes invalid


class Drive(FileModel):
    """Settings that drives and actuators of CiA 402 have in common."""

    node: Node
    command_deadline_ms: WholeNumber = Field(ge=1, le=65_535)  # without a command, the drive stops
    heartbeat_lost_ms: WholeNumber = Field(ge=10, le=65_535)  # without our heartbeat, it stops
    heartbeat_ms: WholeNumber = Field(ge=10, le=65_535)  # of the drive itself
    deadlines: Deadlines
    follows: bool  # statusword bit 12 reports that the drive follows a cyclic command
    mode_first: bool  # 0x6061 shows the mode before the drive is enabled
    objects: dict[str, WholeNumber | None]  # by name; null: the drive does not have the object
    read_only: tuple[str, ...] = Field(default=(), strict=False)  # objects that cannot be written


class TorqueDrive(Drive):
    """A drive in cyclic synchronous torque mode."""

    scaling: Literal["amc", "rated_torque", "rated_current"]
    current_limit_a: float = Field(gt=0, le=500)  # clips the command, in addition to all limits
    # Load cells and sensors on the drive's analog inputs: SI unit per volt.
    analog_per_v: tuple[float, ...] = Field(default=(), max_length=4, strict=False)
    analog_v_per_count: float = Field(default=1.0 / 819.2, gt=0, le=1)  # AMC: 819.2 counts a volt


class Actuator(Drive):
    """The stator's actuator, in profile position mode."""

    counts_per_percent: float = Field(ge=-1e7, le=1e7)
    zero_counts: Int32  # position at 0 %
    low_percent: float = Field(ge=-100, le=100)
    high_percent: float = Field(ge=-100, le=100)
    velocity: WholeNumber = Field(ge=1, le=2**32 - 1)  # 0x6081, in the drive's unit
    window_counts: WholeNumber = Field(ge=0, le=2**32 - 1)
    stand_s: float = Field(ge=0, le=10)
    move_s: float = Field(gt=0, le=600)
    homing: bool  # home before every run
    homing_s: float = Field(default=120, gt=0, le=600)

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the scale is not 0 and that the low limit is below the high limit."""
        if self.counts_per_percent == 0.0:
            yield RuleViolation(("counts_per_percent",), "0 gives no position", 0.0)
        yield from check_below(self, "low_percent", "high_percent")


class TcpLine(FileModel):
    """A Modbus/TCP server."""

    kind: Literal["tcp"]
    host: str = Field(min_length=1)
    port: WholeNumber = Field(ge=1, le=65_535)
    timeout_s: float = Field(gt=0, le=10)


class RtuLine(FileModel):
    """A serial line with Modbus RTU."""

    kind: Literal["rtu"]
    port: str = Field(min_length=1)
    baud: WholeNumber = Field(ge=1200, le=4_000_000)
    parity: Literal["N", "E", "O"]
    stop_bits: Literal[1, 2]
    timeout_s: float = Field(gt=0, le=10)
    slowest_s: float = Field(gt=0, le=10)  # time within which the slowest unit has always answered


AnyLine = Annotated[TcpLine | RtuLine, Field(discriminator="kind")]


class RegisterValue(FileModel):
    """One value in a block of registers."""

    name: str
    at: WholeNumber = Field(ge=0, le=2000)
    kind: Literal["bit", "u16", "i16", "u32", "i32", "f32"]
    scale: float = Field(default=1.0, ge=-1e9, le=1e9)
    low: float = Field(default=-1e12, ge=-1e12, le=1e12)  # a value outside low .. high is invalid
    high: float = Field(default=1e12, ge=-1e12, le=1e12)

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the scale is not 0 and that the range is not empty."""
        if self.scale == 0.0:
            yield RuleViolation(("scale",), "0 gives no value", 0.0)
        yield from check_below(self, "low", "high")


class RegisterSetup(FileModel):
    """A register that is written when its line is opened, e.g. the time of a unit's watchdog.

    With ``write: false`` the register is not written, but must already have the value, e.g. the
    status of the watchdog.
    """

    first: WholeNumber = Field(ge=0, le=65_535)
    value: WholeNumber = Field(ge=0, le=65_535)
    read_back: bool = True  # check that the register reads as written
    write: bool = True

    @model_validator(mode="after")
    def _reads_or_writes(self) -> Self:
        if not (self.read_back or self.write):
            raise ValueError("neither written nor read: one of read_back and write must be true")
        return self


class Registers(FileModel):
    """A block of registers of one unit, with the values that are polled or written there."""

    line: str
    unit: WholeNumber = Field(ge=0, le=247)
    table: Literal["coil", "discrete", "input", "holding"]
    first: WholeNumber = Field(ge=0, le=65_535)
    size: WholeNumber = Field(ge=1, le=2000)
    word_order: Literal["high first", "low first"]
    period_s: Period
    # Register of the same table in which the unit counts its updates, if it has one: values with
    # an unchanged count are not new.
    counter: WholeNumber | None = Field(default=None, ge=0, le=65_535)
    values: TupleOf[RegisterValue] = Field(min_length=1, strict=False)
    # holding registers, in the order in which they are set
    prepare: tuple[RegisterSetup, ...] = Field(default=(), strict=False)


class Wiring(FileModel):
    """The wiring of the WaveBot.

    The heave drive's first two analog inputs read the column load cell and the shaft torque
    sensor; those of the surge drive read the string pot and the rotor angle. Slew and stator
    cells, wave probes, power analyser and digital inputs are read over Modbus.
    """

    can: CanBus
    heave: TorqueDrive
    surge: TorqueDrive
    stator: Actuator
    lines: dict[str, AnyLine]
    analyser: Registers  # ac, dc, bus_voltage
    cells: Registers  # slew, stator_a, stator_b
    probes: Registers  # probe_1, probe_2, probe_3
    inputs: Registers  # e_stop, limit_switch: monitoring only, the stop chain is hard-wired
    outputs: Registers  # wave_trigger
    output_expiry_s: float = Field(ge=0.05, le=10)  # age at which an output command expires

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the register blocks, the scales of the analog inputs and the node numbers."""
        yield from check_register_blocks(self, self.lines, SLOT_SIGNALS)
        for name in ("heave", "surge"):
            scales: tuple[float, ...] = getattr(self, name).analog_per_v
            if len(scales) != 2 or not all(scales) or not all(map(math.isfinite, scales)):
                yield RuleViolation(
                    (name, "analog_per_v"), "must be two scales other than 0", scales
                )
        nodes = [self.can.own_node, self.heave.node, self.surge.node, self.stator.node]
        if len(set(nodes)) != len(nodes):
            yield RuleViolation(("can", "own_node"), "two nodes have the same number", nodes)


def check_register_blocks(
    wiring: FileModel, lines: Mapping[str, object], signals: Mapping[str, tuple[str, ...]]
) -> Iterator[RuleViolation]:
    """Yield the violations of register blocks: names of their values, and their lines.

    ``signals`` gives the expected names of the values of each block.
    """
    for name, expected in signals.items():
        block: Registers = getattr(wiring, name)
        names = tuple(value.name for value in block.values)
        if names != expected:
            message = f"must be {', '.join(expected)} in this order"
            yield RuleViolation((name, "values"), message, names)
        if block.line not in lines:
            known = ", ".join(lines) or "none"
            yield RuleViolation((name, "line"), f"no such line; there are {known}", block.line)


SLOT_SIGNALS = {
    "analyser": ("ac", "dc", "bus_voltage"),
    "cells": ("slew", "stator_a", "stator_b"),
    "probes": ("probe_1", "probe_2", "probe_3"),
    "inputs": ("e_stop", "limit_switch"),
    "outputs": ("wave_trigger",),
}
