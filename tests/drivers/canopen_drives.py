"""Set-up of the drives in the CANopen tests, with deadlines for a host that may stall."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

from drivers.canopen.bus_cycle import SYNC
from drivers.canopen.link import Frame
from drivers.canopen.pdo_steps import heartbeat_consumer, rpdo_steps, tpdo_steps
from drivers.canopen.position_actuator import ActuatorSettings
from drivers.canopen.torque_axis import TorqueAxisSettings, layouts
from drivers.cia402 import profile_position, scaling, state_machine
from drivers.cia402.arming import SetupStep, parameter_steps
from drivers.cia402.positioning_drive import PositioningSettings
from drivers.cia402.torque_drive import TORQUE_MODE, TorqueDriveSettings

OWN = 0x7F  # our node
SCALE = scaling.CurrentScale(100.0, 0.01, 4000)  # 0.01 A a step, 40 A at most
SLOW = 5  # SYNCs from one mode display of an emulated drive to the next
TICKS = 2000  # deadline of every transition
MACHINE = state_machine.Params(
    max_status_age=0.5,
    mode_first=1,
    follows=0,
    resume=0,
    reset_ticks=2,
    deadlines=state_machine.Deadlines(0, *(TICKS for _ in range(11))),
)
MOVE = profile_position.Params(
    window=10, settle_ticks=2, immediate=1, handshake_ticks=20, move_ticks=100
)
POSITION = scaling.position_scale(100.0, 1000, -9000, 9000)  # 100 counts a unit, 0 at 1000

# Objects of the two emulated torque drives, as in their files in configs/devices.
DRIVE_OBJECTS: dict[str, int | None] = {
    "device_type": 402,
    "sync_cob_id": 0x80,
    "heartbeat_producer": 100,
    "mode_of_operation": TORQUE_MODE,
    "abort_connection": 2,
    "communication_error": 0,
    "quick_stop_option": 2,
    "fault_reaction_option": 0,
    "encoder_increments": 20000,
    "encoder_motor_revolutions": 1,
    "gear_motor_revolutions": 1,
    "gear_shaft_revolutions": 1,
    "feed": 20000,
    "feed_shaft_revolutions": 1,
    "max_torque": None,
    "max_current": None,
    "position_low": None,
    "position_high": None,
    "amc_peak_current": 1000,
}


def axis_settings(node: int, slow_divider: int = 1, **changes: object) -> TorqueAxisSettings:
    drive = TorqueDriveSettings(MACHINE, SCALE, max_slow_age=1.0)._replace(**changes)
    return TorqueAxisSettings(node, drive, slow_divider)


def actuator_settings(node: int, **changes: object) -> ActuatorSettings:
    drive = PositioningSettings(MACHINE, MOVE, POSITION, velocity=50)._replace(**changes)
    return ActuatorSettings(node, drive)


def drive_steps(
    node: int, watch: int = 2000, deadline: int = 2000, **changes: int
) -> list[SetupStep]:
    """Return the set-up of a drive that monitors the loop's heartbeat for ``watch`` ms."""
    watched = {"heartbeat_consumer": heartbeat_consumer(OWN, watch)}
    pdos = layouts(node, 0)
    return [
        *parameter_steps({**DRIVE_OBJECTS, **watched, **changes}),
        *rpdo_steps(1, pdos.command, 1, deadline),
        *tpdo_steps(1, pdos.status, 1),
        *tpdo_steps(2, pdos.slow, SLOW),
    ]


# Objects of a drive on a foreign stack, which has few; its SYNC COB-ID is only verified.
FOREIGN_OBJECTS = {
    "device_type": 402,
    "sync_cob_id": 0x80,
    "heartbeat_producer": 50,
    "abort_connection": 2,
    "encoder_increments": 20000,
    "rated_current": 10_000,
    "mode_of_operation": TORQUE_MODE,
}


def foreign_steps(node: int, **changes: int) -> tuple[SetupStep, ...]:
    pdos = layouts(node, 0)
    known = frozenset(FOREIGN_OBJECTS)
    return (
        *parameter_steps({**FOREIGN_OBJECTS, **changes}, known, frozenset({"sync_cob_id"})),
        *rpdo_steps(1, pdos.command, 1, 250),
        *tpdo_steps(1, pdos.status, 1),
        *tpdo_steps(2, pdos.slow, 1),
    )


def until(
    condition: Callable[[], object], action: Callable[[], object], timeout_s: float = 10.0
) -> None:
    """Call ``action`` every 5 ms until ``condition`` holds."""
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, "timeout"
        action()
        time.sleep(0.005)


class FakeLink:
    """A link whose far end is the test: stores sent frames and returns the given ones."""

    has_backlog = False

    def __init__(self) -> None:
        self.time = 100.0
        self.sent: list[Frame] = []
        self.incoming: list[Frame] = []
        self.refused_ids: frozenset[int] = frozenset()
        self.closed = False

    def now(self) -> float:
        return self.time

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        self.sent += [Frame(*frame) for frame in frames if frame[0] not in self.refused_ids]
        return [index for index, frame in enumerate(frames) if frame[0] in self.refused_ids]

    def drain(self) -> list[Frame]:
        coming, self.incoming = self.incoming, []
        return coming

    def close(self) -> None:
        self.closed = True

    def frames_of(self, cob_id: int) -> list[bytes]:
        return [data for sent, data in self.sent if sent == cob_id]

    def syncs(self) -> Iterator[Frame]:
        return (frame for frame in self.sent if frame.cob_id == SYNC)
