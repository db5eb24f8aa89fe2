"""The drive of the rig, in the loop."""

from typing import Any

from rig.realtime.devices import FlatDevices
from rig.wires import can_axes
from rig.wires.messages import open_mailboxes

from wec_winch.tick import Command, Sense


class WiredDevices(FlatDevices):
    def __init__(self, can: can_axes.CanAxes) -> None:
        super().__init__(Sense, Command)
        self._can = can
        self.warm_up, self.close = can.warm_up, can.close

    def attach(self, sense: Any, command: Any) -> None:
        self._sense, self._command = sense, command

    def read_in_place(self, now: float) -> None:
        self._can.receive()
        self._sense.axis(*self._can.sense("motor", self._can.read("motor")))

    def write_in_place(self) -> None:
        _, current, enable, _ = self._command.axis()
        self._can.send([(current, enable)])

    def stop(self, reason: int) -> None:
        self._can.release()


def connect(config: dict[str, Any], dt: float) -> WiredDevices:
    slots = open_mailboxes(config["mailboxes"])
    return WiredDevices(can_axes.connect(config["can"], config["facts"]["can"], slots))
