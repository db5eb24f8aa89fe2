"""The axes and actuators of a rig's CAN bus in the loop: one exchange of process data a tick.

The devices of a kind of rig receive the answers to the last SYNC, read each axis as `AxisSense`,
and send all commands with the next SYNC. `rig.wires.can_nodes.can_axes` returns the configuration.
"""

import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from controllers.signals import AxisSense, DriveFault
from drivers.canopen.bus_cycle import BusCycle, FrameLink, Node
from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.link import Link
from drivers.canopen.position_actuator import ActuatorSettings, PositionActuator
from drivers.canopen.torque_axis import TorqueAxis, TorqueAxisSettings
from drivers.cia402 import scaling
from drivers.cia402.positioning_drive import PositioningReading
from drivers.cia402.torque_drive import TorqueDriveReading
from rig.processes import handover
from rig.processes.mailbox import Mailbox
from rig.wires.messages import HEALTH_SUFFIX, NodeHealth

# Codes of EMCY and 0x603F: a person must be able to distinguish these two from all others.
_FAULTS = {0x3210: DriveFault.OVERVOLTAGE.value, 0x3220: DriveFault.UNDERVOLTAGE.value}
_GENERAL_FAULT = DriveFault.GENERAL.value
WARM_UP_TIMEOUT_S = 3.0  # s in which every drive must answer every SYNC
_MAX_WARM_UP_AGE_TICKS = 5.0  # of every value of a drive at the end of the warm-up

AxisRequest = tuple[float, int]
"""Current (A) and enable (1) of a torque drive, or target and enable of an actuator."""


class CanAxesSettings(NamedTuple):
    """Constants of the nodes; the current scales are read from the drives later."""

    own_node: int
    heartbeat: float  # s between the loop's own heartbeats
    health_age: float  # s, age of the health messages from which the service process counts as lost
    heartbeat_lost: float  # s without a node's heartbeat until it counts as lost
    actuator_divider: int  # SYNCs per command to an actuator
    axes: dict[str, TorqueAxisSettings]
    actuators: dict[str, ActuatorSettings]


class CanAxes:
    """All nodes of a CAN bus."""

    def __init__(
        self, settings: CanAxesSettings, link: FrameLink, slots: Mapping[str, Mailbox]
    ) -> None:
        """``slots``: the mailboxes of the nodes' health, among others."""
        self.axes = {name: TorqueAxis(each) for name, each in settings.axes.items()}
        self.actuators = {name: PositionActuator(one) for name, one in settings.actuators.items()}
        self.time = 0.0  # s on the monotonic clock, of the last `receive`
        self._settings = settings
        self._health = {name: slots[f"{name}{HEALTH_SUFFIX}"] for name in self.axes}
        nodes: tuple[Node, ...] = (*self.axes.values(), *self.actuators.values())
        self._bus = BusCycle(link, nodes, settings.own_node, settings.heartbeat)
        self._sent = 0

    def warm_up(self, dt: float) -> None:
        """Run bus cycles until every node answers each SYNC; OSError names those that do not.

        The last action is a SYNC: the first tick finds the answers to it.
        """
        until = time.monotonic() + WARM_UP_TIMEOUT_S
        while True:
            self.receive()
            silent = self._silent(_MAX_WARM_UP_AGE_TICKS * dt)
            frames = [axis.command(0.0, 0, self.time) for axis in self.axes.values()]
            for actuator in self.actuators.values():
                frames += actuator.command(0.0, 0, self.time)
            self._bus.send(frames)
            if not silent:
                return
            if time.monotonic() > until:
                raise OSError(
                    f"no process data from {', '.join(silent)} in {WARM_UP_TIMEOUT_S:g} s"
                )
            time.sleep(dt)

    def _silent(self, age: float) -> list[str]:
        """Return the nodes with values older than ``age`` (s), of an actuator a multiple."""
        readings = {name: axis.read(self.time) for name, axis in self.axes.items()}
        silent = [n for n, one in readings.items() if max(one.age, one.analog_age) > age]
        limit = self._settings.actuator_divider * age
        ages = {name: one.read(self.time).age for name, one in self.actuators.items()}
        return silent + [name for name, actuator_age in ages.items() if actuator_age > limit]

    def receive(self) -> float:
        """Process the received frames; return the time (s) afterwards."""
        self.time = self._bus.receive()
        return self.time

    def read(self, name: str) -> TorqueDriveReading:
        """Return an axis' last status."""
        return self.axes[name].read(self.time)

    def read_actuator(self, name: str) -> PositioningReading:
        """Return an actuator's last status."""
        return self.actuators[name].read(self.time)

    def sense(self, name: str, reading: TorqueDriveReading) -> AxisSense:
        """Return an axis' status as the loop's signal: a lost or restarted node is a fault."""
        fault = _FAULTS.get(reading.error, _GENERAL_FAULT) if reading.error else 0
        health: NodeHealth | None = self._health[name].read()
        if fault == 0 and health is not None:
            silent = self.time - health.heartbeat_time > self._settings.heartbeat_lost
            unmonitored = self.time - health.stamp > self._settings.health_age
            # A restarted node has lost its set-up, and only a living service process can report it.
            fault = _GENERAL_FAULT if silent or unmonitored or health.restarts > 0 else 0
        age = reading.age
        return AxisSense(reading.counts, age, reading.current, reading.acting, fault, age)

    def send(self, axes: Sequence[AxisRequest], actuators: Sequence[AxisRequest] = ()) -> None:
        """Send the commands of all nodes in the order of the settings, then SYNC.

        Actuators get theirs in every `actuator_divider`-th call.
        """
        now = self.time
        frames = [
            axis.command(current, enable, now)
            for axis, (current, enable) in zip(self.axes.values(), axes, strict=True)
        ]
        if actuators and self._sent % self._settings.actuator_divider == 0:
            for actuator, (target, enable) in zip(self.actuators.values(), actuators, strict=True):
                frames += actuator.command(target, enable, now)
        self._bus.send(frames)
        self._sent += 1

    def release(self) -> None:
        """Command no current, and actuators to stop where they are."""
        frames = [axis.command(0.0, 0, self.time) for axis in self.axes.values()]
        for actuator in self.actuators.values():
            frames += actuator.release(self.time)
        self._bus.send(frames)

    def close(self) -> None:
        """Give the bus back; cannot raise."""
        self._bus.close()


def connect(config: dict[str, Any], facts: dict[str, Any], slots: Mapping[str, Mailbox]) -> CanAxes:
    """Return the nodes for a configuration of `can_nodes.can_axes`; LinkError without a bus.

    ``facts``: by node the values that the CAN service has read from it.
    """
    settings: CanAxesSettings = handover.loads(CanAxesSettings, config["nodes"])
    scales = {name: _current_scale(config["scales"][name], facts[name]) for name in settings.axes}
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


def _current_scale(settings: dict[str, Any], facts: dict[str, int]) -> scaling.CurrentScale:
    """Return the current scale from values read from the drive, not from the rig file."""
    limit = settings["limit"]
    if settings["kind"] == "amc":
        return scaling.amc_current(facts["amc_peak_current"], limit)
    if settings["kind"] == "rated_torque":
        return scaling.rated_torque_current(facts["rated_torque"], settings["kt"], limit)
    return scaling.rated_current(facts["rated_current"], limit)
