"""The axes and actuators of a rig's CAN bus in the loop: one exchange of process data a tick.

The answers to the last SYNC are received first, and all commands are sent with the next SYNC.
`rig.wires.can_nodes.can_axes` returns the configuration.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from drivers.canopen.bus_cycle import BusCycle, FrameLink, Node
from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.link import Link
from drivers.canopen.position_actuator import ActuatorSettings, Frames, PositionActuator
from drivers.canopen.torque_axis import TorqueAxis, TorqueAxisSettings
from rig.processes import handover
from rig.processes.mailbox import Mailbox
from rig.wires.drive_axes import AxisRequest, DriveAxes, HealthLimits, current_scale


class CanAxesSettings(NamedTuple):
    """Constants of the nodes; the current scales are read from the drives later."""

    own_node: int
    heartbeat: float  # s between the loop's own heartbeats
    limits: HealthLimits
    actuator_divider: int  # SYNCs per command to an actuator
    axes: dict[str, TorqueAxisSettings]
    actuators: dict[str, ActuatorSettings]


class CanAxes(DriveAxes):
    """All nodes of a CAN bus."""

    def __init__(
        self, settings: CanAxesSettings, link: FrameLink, slots: Mapping[str, Mailbox]
    ) -> None:
        """``slots``: the mailboxes of the nodes' health, among others."""
        self._axes = {name: TorqueAxis(each) for name, each in settings.axes.items()}
        self._actuators = {name: PositionActuator(one) for name, one in settings.actuators.items()}
        nodes: tuple[Node, ...] = (*self._axes.values(), *self._actuators.values())
        self._bus = BusCycle(link, nodes, settings.own_node, settings.heartbeat)
        self._sent = 0
        super().__init__(
            self._axes, self._actuators, settings.actuator_divider, settings.limits, slots
        )

    def receive(self) -> float:
        self.time = self._bus.receive()
        return self.time

    def take_time(self) -> float:
        self.time = self._bus.now()
        return self.time

    def send(self, axes: Sequence[AxisRequest], actuators: Sequence[AxisRequest] = ()) -> None:
        now = self.time
        frames = [
            axis.command(current, enable, now)
            for axis, (current, enable) in zip(self._axes.values(), axes, strict=True)
        ]
        if actuators and self._sent % self._actuator_divider == 0:
            for actuator, (target, enable) in zip(self._actuators.values(), actuators, strict=True):
                frames += actuator.command(target, enable, now)
        self._bus.send(frames)
        self._sent += 1

    def command_nothing(self) -> None:
        self._send_rest(lambda actuator: actuator.command(0.0, 0, self.time))

    def release(self) -> None:
        self._send_rest(lambda actuator: actuator.release(self.time))

    def _send_rest(self, rest: Callable[[PositionActuator], Frames]) -> None:
        """Send no current to the axes, and to each actuator what ``rest`` returns."""
        frames = [axis.command(0.0, 0, self.time) for axis in self._axes.values()]
        for actuator in self._actuators.values():
            frames += rest(actuator)
        self._bus.send(frames)

    def close(self) -> None:
        self._bus.close()


def connect(config: dict[str, Any], facts: dict[str, Any], slots: Mapping[str, Mailbox]) -> CanAxes:
    """Return the nodes for a configuration of `can_nodes.can_axes`; LinkError without a bus.

    ``facts``: by node the values that the CAN service has read from it.
    """
    settings: CanAxesSettings = handover.loads(CanAxesSettings, config["nodes"])
    scales = {name: current_scale(config["scales"][name], facts[name]) for name in settings.axes}
    axes = {
        name: axis._replace(drive=axis.drive._replace(scale=scales[name]))
        for name, axis in settings.axes.items()
    }
    settings = settings._replace(axes=axes)
    nodes: tuple[Node, ...] = (
        *(TorqueAxis(each) for each in axes.values()),
        *(PositionActuator(each) for each in settings.actuators.values()),
    )
    sync_frames = frozenset[int]().union(*(node.sync_dividers for node in nodes))
    return CanAxes(settings, Link(BusSettings.from_json(config["bus"]), sync_frames), slots)
