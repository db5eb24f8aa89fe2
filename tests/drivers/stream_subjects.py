"""The serial and UDP conversations as subjects of the conformance test."""

from __future__ import annotations

import math
from typing import Any

from device_peers import BridgePeer, Compax3Peer, DigitalFtPeer, NetFtPeer, Peer
from faulty_port import STEP, FaultyPort

from drivers.compax3 import objects, servo_signals
from drivers.compax3.codec import NO_ADDRESS, Object
from drivers.compax3.objects import ObjectChannel
from drivers.compax3.requests import Timing
from drivers.compax3.servo import Servo
from drivers.compax3.values import NumberFormat
from drivers.conversation import Conversation, Exchange
from drivers.encoder import bridge_reader, unwrap
from drivers.encoder.bridge_reader import BridgeReader, Quality
from drivers.encoder.ssi import SsiProtocol
from drivers.force_torque import digital_reader, net_ft, net_reader
from drivers.force_torque.digital_reader import DigitalReader
from drivers.force_torque.net_reader import NetReader
from drivers.force_torque.wrench import make_scale

SET_POINT = ObjectChannel(Object(1901, 1), NumberFormat.F32, 1.0)
SERVO = servo_signals.ServoSettings(
    "servo", NO_ADDRESS, "Compax3",
    ObjectChannel(objects.CONTROL_WORD, NumberFormat.U16, 1.0),
    objects.ENABLED,
    ObjectChannel(objects.STATUS_WORD, NumberFormat.U16, 1.0),
    ObjectChannel(objects.LAST_ERROR, NumberFormat.U16, 1.0),
    SET_POINT,
    (
        ObjectChannel(objects.POSITION_ACTUAL, NumberFormat.F32, 1.0),
        ObjectChannel(objects.SPEED_ACTUAL, NumberFormat.F32, 1.0),
    ),
    limit=10.0, set_point_timeout=0.1, max_status_age=0.3, enable_timeout=0.2,
    timing=Timing(0.03, 0.05),
)  # fmt: skip
BRIDGE = bridge_reader.BridgeSettings(
    "bridge",
    bridge_reader.EncoderChannel(SsiProtocol.SSI4, unwrap.Params(1 << 19, 20.0, 8.0), 1.0),
    bridge_reader.EncoderChannel(SsiProtocol.SSI1, unwrap.Params(1 << 19, 20.0, 8.0), -1.0),
    min_delay=0.0, window=2.0, silence_timeout=0.1,
)  # fmt: skip
DIGITAL = digital_reader.DigitalFtSettings(
    "load cell",
    "FT12345",
    "N",
    "N-m",
    32000,
    quiet_time=0.05,
    answer_timeout=0.1,
    silence_timeout=0.1,
)
NET = net_reader.NetFtSettings(
    "load cell",
    make_scale(1e6, 1e3, "N", "N-m"),
    net_ft.NET_FT_BITS,
    0,
    sample_rate=1000.0,
    quiet_time=0.05,
    silence_timeout=0.1,
)


class StreamSubject:
    """A conversation, a peer and a faulty port between them."""

    name = ""
    timeout_s = 0.5
    recovery = 8.0
    harmless = frozenset({"split"})
    resolution = 0.0021
    undetectable_delay = 0.0

    def __init__(self, talk: Conversation, peer: Peer, datagrams: bool = False) -> None:
        self.conversation, self.peer = talk, peer
        self.port = FaultyPort(peer, datagrams)
        self.exchange = Exchange(self.port, talk)
        self._reading: Any = None

    @property
    def now(self) -> float:
        return self.port.time

    def run(self, seconds: float) -> float:
        for _ in range(round(seconds / STEP)):
            self.port.step()
            self.before_step()
            self.exchange.step()
        return seconds

    def before_step(self) -> None:
        return

    def inject(self, fault: str) -> None:
        if fault == "none" and not self.port.is_open:
            self.port.reopen()
        self.port.fault = "none" if fault == "reconnect" else fault
        if fault == "reconnect":
            self.port.hang_up()
            self.peer.power_cycle(self.now)
        elif fault == "half":
            for _ in range(1000):
                self.run(STEP)
                if self.port.fault == "cut":
                    break
            self.port.hang_up()
        elif fault == "late":
            self.port.delay = 0.07

    def ages(self) -> tuple[float, float]:
        age, sampled = self.sample()
        return age, self.now - sampled

    def sample(self) -> tuple[float, float]:
        raise NotImplementedError

    def is_well(self) -> bool:
        return self.ages()[0] < 0.1 and not self.problem()

    def problem(self) -> str:
        return self.conversation.explain(self.now)

    def acting(self) -> int:
        return 0

    def request_enable(self) -> bool:
        return False

    def close(self) -> None:
        return


class ServoSubject(StreamSubject):
    name = "Compax3"

    def __init__(self) -> None:
        self.servo, self.drive = Servo(SERVO), Compax3Peer()
        self.enable = 0
        super().__init__(self.servo, self.drive)

    def before_step(self) -> None:
        self.servo.command(2.5, self.enable, self.now)

    def sample(self) -> tuple[float, float]:
        reading = self.servo.read(self.now)
        return reading.age, reading.values[0] if reading.age < 1e6 else -1e9

    def is_well(self) -> bool:
        trouble = self.problem().replace("servo: ", "")
        # The reason for being disabled is reported until the next request; the line works.
        down = not self.servo.requests.problem and self.servo.read(self.now).error == 0
        return self.ages()[0] < 0.1 and (not trouble or down)

    def acting(self) -> int:
        return self.servo.read(self.now).acting

    def request_enable(self) -> bool:
        self.enable = 0
        self.run(0.05)
        self.enable = 1
        return True


class BridgeSubject(StreamSubject):
    name = "encoder bridge"

    def __init__(self) -> None:
        self.reader, self.bridge = BridgeReader(BRIDGE), BridgePeer()
        super().__init__(self.reader, self.bridge)

    def sample(self) -> tuple[float, float]:
        motor = self.reader.read(self.now).motor
        return motor.age, motor.angle / self.bridge.motor if motor.age < 1e6 else -1e9

    def before_step(self) -> None:
        # A person resets lost turns once the line works again.
        lost = self.reader.read(self.now).motor.quality is Quality.LOST
        if lost and self.port.fault == "none" and self.port.is_open:
            self.reader.reset_turns()

    def ages(self) -> tuple[float, float]:
        age, sampled = self.sample()
        turn = math.tau / self.bridge.motor  # s; after a reset turns count from 0
        true = self.now - sampled
        return age, true - turn * round((true - age) / turn) if age < 1e6 else true


class DigitalSubject(StreamSubject):
    name = "Digital F/T"
    undetectable_delay = 0.07  # its samples carry no number and no time

    def __init__(self) -> None:
        self.reader = DigitalReader(DIGITAL)
        super().__init__(self.reader, DigitalFtPeer())

    def sample(self) -> tuple[float, float]:
        reading = self.reader.read(self.now)
        return reading.age, reading.wrench.fx * 4.0 / 1000.0 if reading.age < 1e6 else -1e9


class NetSubject(StreamSubject):
    name = "Net F/T"

    def __init__(self) -> None:
        self.reader = NetReader(NET)
        super().__init__(self.reader, NetFtPeer(), datagrams=True)

    def sample(self) -> tuple[float, float]:
        reading = self.reader.read(self.now)
        return reading.age, reading.wrench.fx if reading.age < 1e6 else -1e9
