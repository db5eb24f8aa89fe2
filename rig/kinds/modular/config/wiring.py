"""The wiring of a modular rig: a torque drive for each axis, and the devices of its sensors.

A sensor of the rig file names one value of the wiring as its source: `AXIS.analog_1` is the first
analog input of an axis's drive, `BLOCK.VALUE` a value of a register block, `CELL.fz` a component of
a load cell.
"""

import keyword
from collections.abc import Collection, Iterator, Mapping
from typing import Annotated, NamedTuple

from pydantic import Field

from rig.config.model import RuleViolation
from rig.config.segment import Segment, TerminalBlock
from rig.config.wiring import (
    PANEL_INPUTS,
    WAVE_TRIGGER,
    AnyBlock,
    BlockContent,
    CanBus,
    LoadCell,
    Registers,
    TorqueDrive,
    Wiring,
)
from rig.config.yaml_source import KeyPath
from rig.stations import FIELD_NAME
from rig.wires.messages import ACKNOWLEDGEMENT_SUFFIX, HEALTH_SUFFIX

WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
"""Components of a load cell, in the order of its messages."""
_MAX_VALUES = 256  # of a block, which a mailbox holds
_STAMP = "stamp"  # of every message between processes


class Source(NamedTuple):
    """A value that the wiring gives."""

    device: str  # axis of the drive, register block or load cell
    place: int  # among the values of the device
    key: KeyPath  # in the wiring


class ModularWiring(Wiring):
    """The wiring of a modular rig."""

    can: CanBus | None = None  # the bus of the drives
    ethercat: Segment | None = None  # either this or `can`
    axes: dict[str, TorqueDrive] = Field(min_length=1)  # the drive of each axis
    registers: dict[str, Registers] = Field(default={}, max_length=64)  # polled, for sensors
    terminals: dict[str, TerminalBlock] = Field(default={}, max_length=64)  # for sensors
    load_cells: dict[str, LoadCell] = Field(default={}, max_length=16)  # six-axis, by name
    inputs: Annotated[AnyBlock, PANEL_INPUTS]  # `e_stop` and `limit_switch`; monitoring only
    outputs: Annotated[AnyBlock | None, WAVE_TRIGGER] = None  # `wave_trigger`

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check blocks and nodes, and that names can be those of mailboxes and of their fields."""
        yield from super().check_rules()
        own = ("can", "ethercat", "inputs", "outputs", f"outputs{ACKNOWLEDGEMENT_SUFFIX}")
        taken = dict.fromkeys(own, "of every rig")
        taken |= {f"{axis}{HEALTH_SUFFIX}": f"of the drive of {axis}" for axis in self.axes}
        for field in ("axes", "registers", "terminals", "load_cells"):
            for name in getattr(self, field):
                yield from _name_rules((field, name), name, taken)
                taken[name] = f"one of the {field}"
        for field, name, names in self._sensor_blocks():
            if len(names) > _MAX_VALUES:
                message = f"{len(names)} values; allowed up to {_MAX_VALUES}"
                yield RuleViolation((field, name, "values"), message)
            for at, value in enumerate(names):
                key = (field, name, "values", at, "name")
                yield from _name_rules(key, value, {_STAMP: "the time of every message"})

    def block_content(self, name: str) -> BlockContent:
        """Return the content of a block; that of sensors has no units of its own."""
        for _, block, names in self._sensor_blocks():
            if block == name:
                return BlockContent("values of sensors", dict.fromkeys(names, "1"))
        return super().block_content(name)

    def _sensor_blocks(self) -> Iterator[tuple[str, str, tuple[str, ...]]]:
        """Yield field, name and names of the values of each block of sensors."""
        for name, block in self.registers.items():
            yield "registers", name, tuple(value.name for value in block.values)
        for name, terminals in self.terminals.items():
            yield "terminals", name, tuple(value.name for value in terminals.values)

    def sources(self) -> dict[str, Source]:
        """Return every value that can be the source of a sensor, by its name."""
        inputs = {
            f"{name}.analog_{at + 1}": Source(name, at, ("axes", name, "analog_per_v", at))
            for name, drive in self.axes.items()
            for at in range(len(drive.analog_per_v))
        }
        polled = {
            f"{name}.{value}": Source(name, at, (field, name, "values", at))
            for field, name, names in self._sensor_blocks()
            for at, value in enumerate(names)
        }
        components = {
            f"{name}.{component}": Source(name, at, ("load_cells", name))
            for name in self.load_cells
            for at, component in enumerate(WRENCH)
        }
        return {**inputs, **polled, **components}

    def unused_sources(self, used: Collection[str]) -> dict[str, Source]:
        """Return the sources that the wiring has in vain if only some are used.

        An analog input is needed by a later one of its drive, a component of a load cell by any
        other: the device sends them together.
        """
        sources = self.sources()
        needed = {
            (source.device, at)
            for source in map(sources.__getitem__, used)
            for at in (range(len(WRENCH)) if source.device in self.load_cells
                       else range(source.place + 1) if source.device in self.axes
                       else (source.place,))
        }  # fmt: skip
        return {
            name: source
            for name, source in sources.items()
            if (source.device, source.place) not in needed
        }


def _name_rules(key: KeyPath, name: str, taken: Mapping[str, str]) -> Iterator[RuleViolation]:
    if not FIELD_NAME.fullmatch(name) or keyword.iskeyword(name):
        message = "no name of a signal; allowed [a-z][a-z0-9_]*, no __, no _ at the end"
        yield RuleViolation(key, message, name)
    elif name in taken:
        yield RuleViolation(key, f"this name is {taken[name]}; allowed any other", name)
