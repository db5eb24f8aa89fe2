"""CANopen torque axis and actuator as subjects of the conformance test, cycled over a bus.

The bus controller checks the bits of a frame, so a device can only send wrong frames, frames of a
wrong length, or frames at a wrong time.
"""

from __future__ import annotations

import random
import struct
from collections import deque
from collections.abc import Sequence

from drive_402 import PARAMS, Drive

from drivers.canopen.bus_cycle import SYNC, BusCycle
from drivers.canopen.link import Frame
from drivers.canopen.position_actuator import ActuatorSettings, PositionActuator
from drivers.canopen.torque_axis import TorqueAxis, TorqueAxisSettings
from drivers.cia402 import profile_position as move
from drivers.cia402.positioning_drive import PositioningSettings
from drivers.cia402.scaling import CurrentScale, PositionScale
from drivers.cia402.torque_drive import TorqueDriveSettings

NODE, STEP = 5, 0.001
WATCHDOG = 0.05  # s without a command after which the drive removes power by itself


class FaultyBus:
    """A node and its bus; the node's position counts milliseconds."""

    has_backlog = False

    def __init__(self, profile: bool) -> None:
        self.time, self.fault, self.delay = 0.0, "none", 0.0
        self.drive = Drive()
        self._profile = profile
        self.drive.mode_display = 1 if profile else 10
        self._random = random.Random(7)
        self._in_transit: deque[tuple[float, Frame]] = deque()
        self._controlword, self._commanded_at = 0, 0.0
        self.powered_off = False

    def now(self) -> float:
        return self.time

    def close(self) -> None:
        return

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        for cob_id, data in () if self.fault == "silent" or self.powered_off else frames:
            if cob_id == 0x200 + NODE:
                self._controlword, self._commanded_at = struct.unpack_from("<H", data)[0], self.time
            elif cob_id == SYNC:
                self._answer_sync()
        return ()

    def drain(self) -> list[Frame]:
        frames = []
        while self._in_transit and self._in_transit[0][0] <= self.time:
            frames.append(self._in_transit.popleft()[1])
        return frames

    def power_cycle(self) -> None:
        self.drive.state = "NR"

    def tick(self) -> None:
        self.time += STEP
        if self.time - self._commanded_at > WATCHDOG and self.drive.state == "OE":
            self.drive.state = "SOD"

    def _answer_sync(self) -> None:
        self.drive.tick(self._controlword)
        position = round(self.time * 1000.0)
        if self._profile:
            status = struct.pack("<Hbi", self.drive.statusword, self.drive.mode_display, position)
        else:
            status = struct.pack("<Hhi", self.drive.statusword, 0, position)
            self._transmit(0x280 + NODE, struct.pack("<bH", self.drive.mode_display, 0))
        self._transmit(0x180 + NODE, status)

    def _transmit(self, cob_id: int, data: bytes) -> None:
        at = self.time
        if self.fault in ("garbage", "babble"):
            data = self._random.randbytes(
                self._random.choice([n for n in range(9) if n != len(data)])
            )
            if self.fault == "babble":
                for _ in range(10):
                    foreign = Frame(self._random.randrange(0x600, 0x700), b"\x00")
                    self._in_transit.append((at, foreign))
        elif self.fault == "split":
            self._in_transit.append((at, Frame(cob_id, data[: self._random.randrange(len(data))])))
        elif self.fault == "late":
            at += self.delay
        elif self.fault == "half":
            self._in_transit.append((at, Frame(cob_id, data[: len(data) // 2])))
            self.powered_off = True
            return
        self._in_transit.append((at, Frame(cob_id, data)))


class CanSubject:
    """Base of both subjects."""

    name = ""
    timeout_s = 0.1
    recovery = 1.0
    harmless = frozenset({"split"})
    resolution = 0.0011
    undetectable_delay = 0.02  # a delay beyond `sync_count.WINDOW` counts as a loss

    def __init__(self, profile: bool) -> None:
        self.bus = FaultyBus(profile)
        self.enable = 0

    def run(self, seconds: float) -> float:
        for _ in range(round(seconds / STEP)):
            self.bus.tick()
            self.step()
        return seconds

    def step(self) -> None:
        raise NotImplementedError

    def inject(self, fault: str) -> None:
        self.bus.fault, self.bus.delay = fault, 0.02
        if fault == "none" and self.bus.powered_off:
            self.bus.powered_off = False
        elif fault == "reconnect":
            self.bus.power_cycle()
            self.bus.powered_off = True

    def problem(self) -> str:
        raise NotImplementedError

    def ages(self) -> tuple[float, float]:
        raise NotImplementedError

    def is_well(self) -> bool:
        return self.ages()[0] < 0.005 and self.bus.drive.state in ("SOD", "OE")

    def request_enable(self) -> bool:
        self.enable = 0
        self.run(0.05)
        self.enable = 1
        return True

    def close(self) -> None:
        return


class TorqueAxisSubject(CanSubject):
    name = "torque axis"

    def __init__(self) -> None:
        super().__init__(profile=False)
        self.axis = TorqueAxis(
            TorqueAxisSettings(
                NODE, TorqueDriveSettings(PARAMS, CurrentScale(100.0, 0.01, 10000), 0.05)
            )
        )
        self.cycle = BusCycle(self.bus, [self.axis], 1, 0.1)

    def step(self) -> None:
        now = self.cycle.receive()
        self.cycle.send([self.axis.command(1.0, self.enable, now)])

    def ages(self) -> tuple[float, float]:
        reading = self.axis.read(self.bus.time)
        return reading.age, self.bus.time - reading.counts * 0.001

    def acting(self) -> int:
        return self.axis.read(self.bus.time).acting

    def problem(self) -> str:
        return self.axis.explain()


class ActuatorSubject(CanSubject):
    name = "actuator"

    def __init__(self) -> None:
        super().__init__(profile=True)
        self.actuator = PositionActuator(
            ActuatorSettings(
                NODE,
                PositioningSettings(
                    PARAMS, move.Params(5, 2, 1, 50, 5000),
                    PositionScale(1000.0, 0, -(1 << 30), 1 << 30), 1000,
                ),
            )
        )  # fmt: skip
        self.cycle = BusCycle(self.bus, [self.actuator], 1, 0.1)

    def step(self) -> None:
        now = self.cycle.receive()
        frames = self.actuator.command(0.0, 1, now) if self.enable else self.actuator.release(now)
        self.cycle.send(frames)

    def ages(self) -> tuple[float, float]:
        reading = self.actuator.read(self.bus.time)
        return reading.age, self.bus.time - reading.position

    def acting(self) -> int:
        return 1 if self.bus.drive.state == "OE" else 0

    def problem(self) -> str:
        return self.actuator.explain()
