"""The drive of the rig, in the loop."""

from typing import Any

from rig.wires import can_axes
from rig.wires.messages import open_mailboxes

from wec_winch.tick import Command, Sense


class WiredDevices:
    def __init__(self, can: can_axes.CanAxes) -> None:
        self._can = can
        self.warm_up, self.close = can.warm_up, can.close

    def read(self, now: float) -> Sense:
        self._can.receive()
        return Sense(self._can.sense("motor", self._can.read("motor")))

    def write(self, command: Command) -> None:
        self._can.send([(command.axis.current, command.axis.enable)])

    def stop(self, reason: int) -> None:
        self._can.release()


def connect(config: dict[str, Any], dt: float) -> WiredDevices:
    slots = open_mailboxes(config["mailboxes"])
    return WiredDevices(can_axes.connect(config["can"], config["facts"]["can"], slots))
