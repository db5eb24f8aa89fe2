"""How a rig is wired: buses, lines and what hangs on them. A rehearsal needs none of it."""

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from rig.config.model import Broken, FileModel, Several, Whole
from rig.config.problems import number_text

Node = Annotated[Whole, Field(ge=1, le=127)]
"""CANopen node number."""
Signed = Annotated[Whole, Field(ge=-(2**31), le=2**31 - 1)]
"""An object of a drive has 32 bits at most."""
Period = Annotated[float, Field(ge=0.002, le=60)]
Divider = Annotated[Whole, Field(ge=1, le=240)]
"""How many SYNCs lie between two frames."""


def below(model: FileModel, low: str, high: str) -> Iterator[Broken]:
    """What is wrong where one number of a model is not below another."""
    least, most = getattr(model, low), getattr(model, high)
    if not least < most:
        text = f"{number_text(least)} is not below {high} = {number_text(most)}"
        yield Broken((low,), text, least)


class CanBus(FileModel):
    """A CAN bus; interface names and options are python-can's."""

    interface: str = Field(min_length=1)
    channel: str = Field(min_length=1)
    bit_rate: Whole = Field(ge=10_000, le=1_000_000)
    options: dict[str, Any] = Field(default_factory=dict)
    own_node: Node  # of this computer, for its heartbeat
    heartbeat_s: float = Field(ge=0.005, le=1)  # between our heartbeats, sent from the tick
    slow_divider: Divider  # SYNCs between mode display and error code of a drive
    actuator_divider: Divider  # SYNCs between commands to an actuator


class Deadlines(FileModel):
    """How long a drive may take for its transitions (CiA 402)."""

    transition_s: float = Field(gt=0, le=10)  # any one step up or down
    boot_s: float = Field(gt=0, le=60)
    ramp_s: float = Field(gt=0, le=60)  # a quick stop or fault reaction to its end
    stale_s: float = Field(gt=0, le=5)  # age from which a statusword says nothing


class Drive(FileModel):
    """What drives and actuators of CiA 402 have in common."""

    node: Node
    command_deadline_ms: Whole = Field(ge=1, le=65_535)  # the drive reacts if no command comes
    heartbeat_lost_ms: Whole = Field(ge=10, le=65_535)  # and if our heartbeat does not
    heartbeat_ms: Whole = Field(ge=10, le=65_535)  # its own
    deadlines: Deadlines
    follows: bool  # statusword bit 12 says that the drive follows a cyclic command
    mode_first: bool  # 0x6061 shows the mode before the drive is enabled
    objects: dict[str, Whole | None]  # by name; null: the drive has it not
    read_only: tuple[str, ...] = Field(default=(), strict=False)  # objects it lets nobody set


class TorqueDrive(Drive):
    """A drive in cyclic synchronous torque mode."""

    scaling: Literal["amc", "rated_torque", "rated_current"]
    current_limit_a: float = Field(gt=0, le=500)  # the command is held at it, beside all limits
    # Load cells and sensors on the drive's analog inputs: our unit per volt.
    analog_per_v: tuple[float, ...] = Field(default=(), max_length=4, strict=False)
    analog_v_per_count: float = Field(default=1.0 / 819.2, gt=0, le=1)  # AMC: 819.2 counts a volt


class Actuator(Drive):
    """The stator's actuator, in profile position mode."""

    counts_per_percent: float = Field(ge=-1e7, le=1e7)
    zero_counts: Signed  # where the stator stands at 0 %
    low_percent: float = Field(ge=-100, le=100)
    high_percent: float = Field(ge=-100, le=100)
    velocity: Whole = Field(ge=1, le=2**32 - 1)  # 0x6081, in the drive's unit
    window_counts: Whole = Field(ge=0, le=2**32 - 1)
    stand_s: float = Field(ge=0, le=10)
    move_s: float = Field(gt=0, le=600)
    homing: bool  # home it before every run
    homing_s: float = Field(default=120, gt=0, le=600)

    def broken_rules(self) -> Iterator[Broken]:
        """The travel has an inside."""
        if self.counts_per_percent == 0.0:
            yield Broken(("counts_per_percent",), "0 gives no position", 0.0)
        yield from below(self, "low_percent", "high_percent")


class TcpLine(FileModel):
    """A Modbus/TCP server."""

    kind: Literal["tcp"]
    host: str = Field(min_length=1)
    port: Whole = Field(ge=1, le=65_535)
    timeout_s: float = Field(gt=0, le=10)


class RtuLine(FileModel):
    """A serial line with Modbus RTU."""

    kind: Literal["rtu"]
    port: str = Field(min_length=1)
    baud: Whole = Field(ge=1200, le=4_000_000)
    parity: Literal["N", "E", "O"]
    stop_bits: Literal[1, 2]
    timeout_s: float = Field(gt=0, le=10)
    slowest_s: float = Field(gt=0, le=10)  # in which the slowest unit has answered for certain


AnyLine = Annotated[TcpLine | RtuLine, Field(discriminator="kind")]


class RegisterValue(FileModel):
    """One value in a block of registers."""

    name: str
    at: Whole = Field(ge=0, le=2000)
    kind: Literal["bit", "u16", "i16", "u32", "i32", "f32"]
    scale: float = Field(default=1.0, ge=-1e9, le=1e9)
    low: float = Field(default=-1e12, ge=-1e12, le=1e12)  # a value outside is not believed
    high: float = Field(default=1e12, ge=-1e12, le=1e12)

    def broken_rules(self) -> Iterator[Broken]:
        """A scale of nothing is none, and some value can be believed."""
        if self.scale == 0.0:
            yield Broken(("scale",), "0 gives no value", 0.0)
        yield from below(self, "low", "high")


class Written(FileModel):
    """A register that a unit is given when its line is opened, e.g. its watchdog's time.

    With ``write: false`` nothing is written: it must read so by then, e.g. the watchdog's status.
    """

    first: Whole = Field(ge=0, le=65_535)
    value: Whole = Field(ge=0, le=65_535)
    read_back: bool = True  # it must then read as it was written
    write: bool = True

    @model_validator(mode="after")
    def _for_something(self) -> Self:
        if not (self.read_back or self.write):
            raise ValueError("neither written nor read: one of read_back and write must be true")
        return self


class Registers(FileModel):
    """A block of registers of one unit, and what it is polled or written for."""

    line: str
    unit: Whole = Field(ge=0, le=247)
    table: Literal["coil", "discrete", "input", "holding"]
    first: Whole = Field(ge=0, le=65_535)
    size: Whole = Field(ge=1, le=2000)
    word_order: Literal["high first", "low first"]
    period_s: Period
    # Register of the same table in which the unit counts its updates, if it does: values it has
    # shown before are no new ones.
    counter: Whole | None = Field(default=None, ge=0, le=65_535)
    values: Several[RegisterValue] = Field(min_length=1, strict=False)
    prepare: tuple[Written, ...] = Field(default=(), strict=False)  # holding registers, in order


class Wiring(FileModel):
    """The WaveBot's wires.

    Load cells: column load cell and shaft torque sensor on the heave drive's first two analog
    inputs, string pot and rotor angle on those of the surge drive; slew and stator cells, wave
    probes, power analyser and digital inputs over Modbus.
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
    output_expiry_s: float = Field(ge=0.05, le=10)  # age from which an output command is let go

    def broken_rules(self) -> Iterator[Broken]:
        """Every block has its values and its line; every drive its inputs."""
        yield from line_rules(self, self.lines, SLOT_SIGNALS)
        for name in ("heave", "surge"):
            scales: tuple[float, ...] = getattr(self, name).analog_per_v
            if len(scales) != 2 or not all(scales) or not all(map(math.isfinite, scales)):
                yield Broken((name, "analog_per_v"), "must be two scales other than 0", scales)
        nodes = [self.can.own_node, self.heave.node, self.surge.node, self.stator.node]
        if len(set(nodes)) != len(nodes):
            yield Broken(("can", "own_node"), "two nodes have one number", nodes)


def line_rules(
    wiring: FileModel, lines: Mapping[str, object], words: Mapping[str, tuple[str, ...]]
) -> Iterator[Broken]:
    """What is wrong with blocks of registers: their values, by name, and the lines they are on."""
    for name, wanted in words.items():
        block: Registers = getattr(wiring, name)
        got = tuple(value.name for value in block.values)
        if got != wanted:
            yield Broken((name, "values"), f"must be {', '.join(wanted)} in this order", got)
        if block.line not in lines:
            known = ", ".join(lines) or "none"
            yield Broken((name, "line"), f"no such line; there are {known}", block.line)


SLOT_SIGNALS = {
    "analyser": ("ac", "dc", "bus_voltage"),
    "cells": ("slew", "stator_a", "stator_b"),
    "probes": ("probe_1", "probe_2", "probe_3"),
    "inputs": ("e_stop", "limit_switch"),
    "outputs": ("wave_trigger",),
}
