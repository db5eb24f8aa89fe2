"""Drives as the tests of the CANopen driver set them up; a host may stand still for long."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from drivers.canopen import cia402, profile_position, scaling
from drivers.canopen.arming import (
    Step,
    heartbeat_consumer,
    parameter_steps,
    rpdo_steps,
    tpdo_steps,
)
from drivers.canopen.bus_cycle import SYNC
from drivers.canopen.link import Frame
from drivers.canopen.position_actuator import Settings as ActuatorSettings
from drivers.canopen.torque_axis import TORQUE_MODE, Settings, layouts

OWN = 0x7F  # our node
SCALE = scaling.CurrentScale(100.0, 0.01, 4000)  # 0.01 A a step, 40 A at most
SLOW = 5  # SYNCs from one mode display of an emulated drive to the next
TICKS = 2000  # deadline of every transition
MACHINE = cia402.Params(
    stale=0.5,
    mode_first=1,
    follows=0,
    resume=0,
    reset_ticks=2,
    deadlines=cia402.Deadlines(0, *(TICKS for _ in range(11))),
)
MOVE = profile_position.Params(
    window=10, stand_ticks=2, immediate=1, handshake_ticks=20, move_ticks=100
)
POSITION = scaling.position_scale(100.0, 1000, -9000, 9000)  # 100 counts a unit, 0 at 1000

# What the two emulated torque drives are: as their files in configs/devices say.
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


def axis_settings(node: int, **changes: object) -> Settings:
    return Settings(node, MACHINE, SCALE, slow_age=1.0)._replace(**changes)


def actuator_settings(node: int) -> ActuatorSettings:
    return ActuatorSettings(node, MACHINE, MOVE, POSITION, velocity=50)


def drive_steps(node: int, watch: int = 2000, deadline: int = 2000, **changes: int) -> list[Step]:
    """Set-up of an emulated drive, with the loop's heartbeat watched for so many ms."""
    watched = {"heartbeat_consumer": heartbeat_consumer(OWN, watch)}
    made = layouts(node, 0)
    return [
        *parameter_steps({**DRIVE_OBJECTS, **watched, **changes}),
        *rpdo_steps(1, made.command, 1, deadline),
        *tpdo_steps(1, made.status, 1),
        *tpdo_steps(2, made.slow, SLOW),
    ]


# What a drive on a foreign stack is made to have: few objects, and its SYNC left as it is.
FOREIGN_OBJECTS = {
    "device_type": 402,
    "sync_cob_id": 0x80,
    "heartbeat_producer": 50,
    "abort_connection": 2,
    "encoder_increments": 20000,
    "rated_current": 10_000,
    "mode_of_operation": TORQUE_MODE,
}


def foreign_steps(node: int, **changes: int) -> tuple[Step, ...]:
    made = layouts(node, 0)
    known = frozenset(FOREIGN_OBJECTS)
    return (
        *parameter_steps({**FOREIGN_OBJECTS, **changes}, known, frozenset({"sync_cob_id"})),
        *rpdo_steps(1, made.command, 1, 250),
        *tpdo_steps(1, made.status, 1),
        *tpdo_steps(2, made.slow, 1),
    )


def until(true: Callable[[], object], each: Callable[[], object], patience: float = 10.0) -> None:
    """Do something every 5 ms until something is so."""
    end = time.monotonic() + patience
    while not true():
        assert time.monotonic() < end, "waited in vain"
        each()
        time.sleep(0.005)


class FakeLine:
    """A line whose far end is the test: it keeps what is sent and gives what it is told to give."""

    behind = False

    def __init__(self) -> None:
        self.time = 100.0
        self.sent: list[Frame] = []
        self.coming: list[Frame] = []
        self.refuses: frozenset[int] = frozenset()
        self.closed = False

    def now(self) -> float:
        return self.time

    def send(self, cob_id: int, data: bytes) -> bool:
        if cob_id in self.refuses:
            return False
        self.sent.append(Frame(cob_id, data))
        return True

    def drain(self) -> list[Frame]:
        coming, self.coming = self.coming, []
        return coming

    def close(self) -> None:
        self.closed = True

    def of(self, cob_id: int) -> list[bytes]:
        return [data for sent, data in self.sent if sent == cob_id]

    def syncs(self) -> Iterator[Frame]:
        return (frame for frame in self.sent if frame.cob_id == SYNC)
