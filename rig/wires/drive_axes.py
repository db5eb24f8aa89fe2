"""The axes and actuators of a rig's bus in the loop: one exchange of process data a tick.

The devices of a kind of rig receive the newest statuses, read each axis as `AxisSense`, and send
all commands for the next cycle. `rig.wires.can_axes` exchanges them on a CAN bus,
`rig.wires.segment_axes` on an EtherCAT segment.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from controllers.signals import AxisSense, DriveFault
from drivers.cia402 import error_codes, scaling
from drivers.cia402.positioning_drive import PositioningDrive, PositioningReading
from drivers.cia402.torque_drive import TorqueDrive, TorqueDriveReading
from rig.processes.mailbox import Mailbox
from rig.wires.messages import HEALTH_SUFFIX, NodeHealth
from rig.wires.pace import Pace

# Codes of emergencies and 0x603F: a person must be able to distinguish these two from all others.
_FAULTS = {0x3210: DriveFault.OVERVOLTAGE.value, 0x3220: DriveFault.UNDERVOLTAGE.value}
_GENERAL_FAULT, _LOST = DriveFault.GENERAL.value, DriveFault.FIELDBUS_LOST.value
WARM_UP_TIMEOUT_S = 3.0  # s in which every drive must answer in every cycle
_MAX_WARM_UP_AGE_TICKS = 5.0  # of every value of a drive at the end of the warm-up

AxisRequest = tuple[float, int]
"""Current (A) and enable (1) of a torque drive, or target and enable of an actuator."""


class HealthLimits(NamedTuple):
    """Ages from which the bus counts as lost, as the service process knows it."""

    health_age: float  # s, of the health messages: the service process is lost
    heartbeat_lost: float  # s without a sign of life of a node


class DriveAxes(ABC):
    """All drives of a bus; a subclass exchanges their values."""

    def __init__(
        self,
        axes: Mapping[str, TorqueDrive],
        actuators: Mapping[str, PositioningDrive],
        actuator_divider: int,
        limits: HealthLimits,
        slots: Mapping[str, Mailbox],
    ) -> None:
        """``actuator_divider``: cycles per command to an actuator; ``slots``: with the health."""
        self.time = 0.0  # s on the monotonic clock, of the last `receive`
        self._drives, self._positioning = axes, actuators
        self._actuator_divider, self._limits = actuator_divider, limits
        self._health = {name: slots[f"{name}{HEALTH_SUFFIX}"] for name in axes}

    clock_correction: Callable[[], int] | None = None
    """Correction (ns) of the loop's next deadline, if the bus has a clock that leads."""

    def wire_report(self) -> dict[str, Any]:
        """Return what the record keeps of the bus, as JSON values; empty: nothing."""
        return {}

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the axes, in the order of their commands."""
        return tuple(self._drives)

    @abstractmethod
    def receive(self) -> float:
        """Take what has arrived; return the time (s) afterwards, which is `time`, too."""

    @abstractmethod
    def take_time(self) -> float:
        """Set `time` to the present and return it."""

    @abstractmethod
    def send(self, axes: Sequence[AxisRequest], actuators: Sequence[AxisRequest] = ()) -> None:
        """Send the commands of all drives in the order of the settings.

        Actuators get theirs in every ``actuator_divider``-th call.
        """

    @abstractmethod
    def release(self) -> None:
        """Command no current, and actuators to stop where they are."""

    @abstractmethod
    def close(self) -> None:
        """Give the bus back; cannot raise."""

    def trouble(self) -> str:
        """Return why the bus is not ready for a run besides silent drives; empty if it is."""
        return ""

    def warm_up(self, dt: float) -> None:
        """Run cycles until every drive answers; OSError names those that do not.

        The last action is a command: the first tick finds the answers to it.
        """
        until = time.monotonic() + WARM_UP_TIMEOUT_S
        self._pace = Pace(round(1e9 * dt))
        while True:
            self.receive()
            silent, trouble = self._silent(_MAX_WARM_UP_AGE_TICKS * dt), self.trouble()
            self.command_nothing()
            if not silent and not trouble:
                return
            if time.monotonic() > until:
                text = f"no process data from {', '.join(silent)} in {WARM_UP_TIMEOUT_S:g} s"
                raise OSError(trouble if trouble else text)
            self._pace.wait(self.clock_correction() if self.clock_correction else 0)

    @abstractmethod
    def command_nothing(self) -> None:
        """Send no current and no motion to all drives, without releasing actuators."""

    def _silent(self, age: float) -> list[str]:
        """Return the drives with values older than ``age`` (s), of an actuator a multiple."""
        readings = {name: axis.read(self.time) for name, axis in self._drives.items()}
        silent = [n for n, one in readings.items() if max(one.age, one.analog_age) > age]
        limit = self._actuator_divider * age
        ages = {name: one.read(self.time).age for name, one in self._positioning.items()}
        return silent + [name for name, actuator_age in ages.items() if actuator_age > limit]

    def read(self, name: str) -> TorqueDriveReading:
        """Return an axis' last status."""
        return self._drives[name].read(self.time)

    def read_actuator(self, name: str) -> PositioningReading:
        """Return an actuator's last status."""
        return self._positioning[name].read(self.time)

    def limit_flags(self, name: str) -> int:
        """Return why the last command of an axis differs from the request: scaling.LimitFlag."""
        return self._drives[name].limit_flags

    def sense(self, name: str, reading: TorqueDriveReading) -> AxisSense:
        """Return an axis' status as the loop's signal.

        A lost bus is a fault, too: its own, unless the drive reports another cause.
        """
        error = reading.error
        fault = _FAULTS.get(error, _GENERAL_FAULT) if error else 0
        if (fault == 0 or error_codes.is_communication(error)) and self._is_lost(name):
            fault = _LOST
        age = reading.age
        return AxisSense(reading.counts, age, reading.current, reading.acting, fault, age)

    def _is_lost(self, name: str) -> bool:
        """Return whether the bus has lost a drive, or nobody monitors the drive any more.

        A restarted node has lost its set-up, and only a living service process can report it.
        """
        health: NodeHealth | None = self._health[name].read()
        if health is None:
            return False
        silent = self.time - health.heartbeat_time > self._limits.heartbeat_lost
        unmonitored = self.time - health.stamp > self._limits.health_age
        return silent or unmonitored or health.restarts > 0


def current_scale(settings: Mapping[str, Any], facts: Mapping[str, int]) -> scaling.CurrentScale:
    """Return the current scale from values read from the drive, not from the rig file."""
    limit = settings["limit"]
    if settings["kind"] == "amc":
        return scaling.amc_current(facts["amc_peak_current"], limit)
    if settings["kind"] == "rated_torque":
        return scaling.rated_torque_current(facts["rated_torque"], settings["kt"], limit)
    return scaling.rated_current(facts["rated_current"], limit)
