"""A modular rig's real devices behind the loop's device interface.

The tick exchanges process data itself; slow lines and load cells go through mailboxes. The
messages of the drivers become the composed `Sense`, by tables that are written once at the start.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rig.kinds.modular.tick import Composition, compose
from rig.processes.mailbox import Mailbox
from rig.wires import bus_axes
from rig.wires.bus_axes import BusDevices
from rig.wires.drive_axes import DriveAxes
from rig.wires.messages import open_mailboxes


class SensorSource(NamedTuple):
    """A sensor and the value of the wiring that it reads: its value is scale * reading + offset."""

    name: str
    device: str  # axis, for an analog input of its drive, or mailbox
    place: int  # among the analog inputs, or the fields of the message
    scale: float
    offset: float


class ModularDevices(BusDevices):
    """All devices of a modular rig on their wires."""

    def __init__(
        self,
        drives: DriveAxes,
        slots: Mapping[str, Mailbox],
        composition: Composition,
        sources: Sequence[SensorSource],
        trigger_divider: int,
    ) -> None:
        """``sources``: one of each sensor; ``trigger_divider``: ticks between two posts of it."""
        self._axes = [axis.name for axis in composition.axes]
        by_name = {source.name: source for source in sources}
        given = [by_name[part.name] for part in composition.sensors]
        polled = dict.fromkeys(each.device for each in given if each.device not in self._axes)
        devices = [*self._axes, *polled]
        composed = compose(composition)
        self._sensors = [
            (part.name, devices.index(each.device), each.place, each.scale, each.offset)
            for part, each in zip(composition.sensors, given, strict=True)
        ]
        inputs = {name: slots[name] for name in (*polled, "inputs")}
        *self._polled, self._panel = inputs.values()
        records = composed.Sense, composed.Command
        super().__init__(drives, inputs, slots.get("outputs"), trigger_divider, *records)

    def attach(self, sense: Any, command: Any) -> None:
        """Look up the place of each axis and sensor in the composed `Sense` and `Command`."""
        self._put_axes = [(name, getattr(sense, name)) for name in self._axes]
        self._put_sensors = [(getattr(sense, name), *source) for name, *source in self._sensors]
        self._put_panel = sense.panel
        self._commands = [getattr(command, name) for name in self._drives.names]
        self._get_waves = command.waves
        sense.wave(math.nan)  # only a simulated basin knows the undisturbed elevation

    def read_in_place(self, now: float) -> None:
        """Store the composed `Sense`."""
        drives = self._drives
        drives.receive()  # before the mailboxes: those of terminals have its values
        messages = [slot.read() for slot in self._polled]
        panel = self._panel.read()
        # After the mailboxes, or a value posted meanwhile would have a negative age.
        time_now = drives.take_time()
        readings = [drives.read(name) for name in self._axes]
        values = [(reading.analog, reading.analog_age) for reading in readings]
        values += [(message, time_now - message.stamp) for message in messages]
        for (name, put), reading in zip(self._put_axes, readings, strict=True):
            put(*drives.sense(name, reading))
        for put, device, place, scale, offset in self._put_sensors:
            reading, age = values[device]
            put(scale * reading[place] + offset, age)
        self._put_panel(panel.e_stop, panel.limit_switch, time_now - panel.stamp)

    def write_in_place(self) -> None:
        """Send the composed `Command`: one command of each axis, then the wave trigger."""
        commands = [get() for get in self._commands]
        self._drives.send([(current, enable) for _, current, enable, _ in commands])
        self._send_waves(self._get_waves)


def connect(config: dict[str, Any], dt: float) -> ModularDevices:
    """Return the devices for a configuration of `rig.kinds.modular.hardware.job`.

    It also has "composition", the composition's text. LinkError if the bus cannot be opened.
    """
    drives, slots = bus_axes.connect(config, open_mailboxes(config["mailboxes"]))
    return ModularDevices(
        drives,
        slots,
        Composition.from_text(config["composition"]),
        [SensorSource(*each) for each in config["sensors"]],
        config["trigger_divider"],
    )
