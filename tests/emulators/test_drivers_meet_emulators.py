"""The drivers against the emulated devices: two independent implementations of each manual.

Driver and emulator share no code, so these tests confirm that both interpret the manual equally.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import pytest
from emulator_stage import Stage

from drivers.compax3 import objects, servo_signals
from drivers.compax3.codec import NO_ADDRESS, Object
from drivers.compax3.objects import ObjectChannel
from drivers.compax3.requests import Timing
from drivers.compax3.servo import Servo
from drivers.compax3.servo_signals import Phase
from drivers.compax3.values import NumberFormat
from drivers.conversation import Exchange
from drivers.encoder import bridge_reader, unwrap
from drivers.encoder.bridge_reader import BridgeReader, Quality
from drivers.encoder.ssi import SsiProtocol
from drivers.force_torque import digital_reader, net_ft, net_reader
from drivers.force_torque.digital_reader import DigitalReader
from drivers.force_torque.load import Phase as LoadPhase
from drivers.force_torque.net_reader import NetReader
from drivers.force_torque.wrench import make_scale
from drivers.serial_link import SerialLink
from drivers.serial_link import SerialSettings as Port
from drivers.tcp_request import send_request
from drivers.udp_link import UdpLink
from drivers.udp_link import UdpSettings as Peer
from sim_plant.emulators.compax3 import Compax3
from sim_plant.emulators.compax3_drive import DriveInput
from sim_plant.emulators.compax3_objects import Compax3Settings
from sim_plant.emulators.digital_ft import DigitalFt, DigitalFtSettings
from sim_plant.emulators.encoder_bridge import BridgeSettings, EncoderBridge, ShaftAngles
from sim_plant.emulators.encoder_words import Encoder, EncoderSettings
from sim_plant.emulators.ft_calibration import Wrench
from sim_plant.emulators.net_ft import NetFt, NetFtSettings

BUSY = 0.5  # s that a busy machine may hold everything up
TURN = math.tau  # rad: the drive counts motor revolutions
LOAD = Wrench(12.0, -4.5, 300.0, 0.25, -7.5, 11.0)


class DriverSession:
    """A driver's conversation over its link, run until a condition holds."""

    def __init__(self, link: SerialLink | UdpLink, talk: Any) -> None:
        self.link, self.talk = link, talk
        self.exchange = Exchange(link, talk)
        self.each: Callable[[], None] = lambda: None

    def turn(self) -> float:
        self.each()
        return self.exchange.step()

    def until(self, true: Callable[[float], object], within: float = 10.0) -> None:
        end = time.monotonic() + within
        while not true(now := self.turn()):
            assert now < end, self.talk.explain(now) or self.link.problem
            time.sleep(0.001)

    def run(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        self.until(lambda now: now > end)


def channel(
    number: int, sub: int, form: NumberFormat = NumberFormat.INT24, per_unit: float = 1.0
) -> ObjectChannel:
    return ObjectChannel(Object(number, sub), form, per_unit)


def servo_settings(enabled: int, address: int = NO_ADDRESS) -> servo_signals.ServoSettings:
    return servo_signals.ServoSettings(
        "servo", address, "Compax3", channel(1100, 3), enabled, channel(1000, 3), channel(550, 1),
        channel(1901, 1, NumberFormat.REAL48, 1.0 / TURN),
        tuple(channel(index, 5, NumberFormat.REAL48, 1.0 / TURN) for index in (680, 681)),
        limit=20.0, set_point_timeout=BUSY, max_status_age=1.0, enable_timeout=2.0,
        timing=Timing(BUSY, 0.05),
    )  # fmt: skip


class Drive:
    """An emulated servo drive whose plant follows without delay."""

    def __init__(self, stage: Stage, enabled: int = objects.POWERED_BIT, **settings: Any) -> None:
        self.written: dict[str, float] = {}
        self.device = stage.show(
            Compax3(
                stage.line("servo"), self._read, self.written.__setitem__,
                Compax3Settings(**settings),
            )
        )  # fmt: skip
        address = settings.get("address")
        self.servo = Servo(servo_settings(enabled, NO_ADDRESS if address is None else address))
        self.link = SerialLink(Port("servo", self.device.address, 115_200, "N", 1))
        self.table = DriverSession(self.link, self.servo)
        self.want, self.enable = 0.0, 0
        self.table.each = self._renew

    def _read(self) -> DriveInput:
        return DriveInput(position=3.0, velocity=self.written.get("velocity", 0.0))

    def _renew(self) -> None:
        self.servo.command(self.want, self.enable, self.link.now())

    def phase(self, phase: Phase) -> Callable[[float], bool]:
        return lambda now: self.servo.read(now).phase is phase

    def up(self, want: float) -> None:
        self.enable = 0
        self.table.until(lambda now: self.servo.read(now).age < BUSY)
        self.table.run(0.05)
        self.want, self.enable = want, 1
        self.table.until(self.phase(Phase.ON))


@pytest.mark.parametrize(
    ("active_low", "enabled"), [(0, objects.POWERED_BIT), (1, objects.ENABLED)]
)
def test_servo_drive_enables_follows_and_disables(
    stage: Stage, active_low: int, enabled: int
) -> None:
    drive = Drive(stage, enabled, stop_bits_active_low=active_low)
    drive.up(5.0)
    drive.table.until(lambda now: abs(drive.servo.read(now).values[1] - 5.0) < 1e-5)
    assert drive.written["velocity"] == pytest.approx(5.0, abs=1e-5)
    assert drive.servo.read(drive.link.now()).values[0] == pytest.approx(3.0, abs=1e-6)
    drive.enable = 0
    drive.table.until(lambda _: drive.written["enabled"] == 0.0)
    assert drive.servo.explain(drive.link.now()) == ""
    assert drive.servo.requests.timeouts == drive.servo.requests.late == 0
    drive.link.close()


def test_a_servo_drive_with_an_address(stage: Stage) -> None:
    drive = Drive(stage, address=7)
    drive.up(1.0)
    drive.link.close()


def test_a_servo_drives_error_is_named_and_acknowledged_on_request(stage: Stage) -> None:
    drive = Drive(stage)
    drive.up(5.0)
    stage.do(lambda: drive.device.faults.switch("following_error"))
    drive.table.until(lambda now: drive.servo.read(now).error == 29472)
    assert "following error" in drive.servo.explain(drive.link.now())
    stage.do(lambda: drive.device.faults.switch("following_error", False))
    drive.servo.acknowledge()
    drive.up(2.0)
    drive.table.until(lambda _: abs(drive.written["velocity"] - 2.0) < 1e-5)
    drive.link.close()


@pytest.mark.parametrize("fault", ["silent", "wrong_crc", "late_answers"])
def test_servo_drive_without_valid_answers_is_stopped(stage: Stage, fault: str) -> None:
    drive = Drive(stage)
    drive.up(5.0)
    stage.do(lambda: drive.device.faults.switch(fault))
    drive.table.until(lambda _: drive.written["enabled"] == 0.0)
    assert drive.servo.explain(drive.link.now())
    stage.do(lambda: drive.device.faults.switch(fault, False))
    drive.table.until(lambda now: drive.servo.read(now).age < BUSY)
    assert drive.written["enabled"] == 0.0  # and stays so
    drive.link.close()


def test_servo_drive_is_off_after_reconnection(stage: Stage) -> None:
    drive = Drive(stage)
    drive.up(5.0)
    stage.do(lambda: drive.device.line.link.switch("disconnect"))
    drive.table.until(lambda _: not drive.link.is_open)
    stage.do(lambda: drive.device.line.link.switch("disconnect", False))
    drive.table.until(lambda _: drive.link.is_open)
    drive.table.until(lambda _: drive.written["enabled"] == 0.0)
    drive.table.until(drive.phase(Phase.OFF))
    assert "the port was opened again" in drive.servo.explain(drive.link.now())
    drive.link.close()


class Bridge:
    """An emulated bridge whose shafts turn by the clock."""

    def __init__(self, stage: Stage) -> None:
        self.began = time.monotonic()
        self.device = stage.show(
            EncoderBridge(
                stage.line("bridge", baud=460_800), self.angles,
                Encoder(EncoderSettings(protocol=4)), Encoder(EncoderSettings(protocol=6)),
                BridgeSettings(rate=200.0),
            )
        )  # fmt: skip
        turns = unwrap.Params(1 << 19, 3.0, 32.0)  # half a turn takes a second
        self.reader = BridgeReader(
            bridge_reader.BridgeSettings(
                "bridge",
                bridge_reader.EncoderChannel(SsiProtocol.SSI4, turns, 1.0),
                bridge_reader.EncoderChannel(SsiProtocol.SSI6, turns, 1.0),
                min_delay=0.0, window=2.0, silence_timeout=BUSY,
            )
        )  # fmt: skip
        self.link = SerialLink(Port("bridge", self.device.address, 460_800, "N", 1))
        self.table = DriverSession(self.link, self.reader)

    def angles(self) -> ShaftAngles:
        now = time.monotonic() - self.began
        return ShaftAngles(now, 2.0 * now, 0.5 * now)

    def good(self, now: float) -> bool:
        reading = self.reader.read(now)
        return all(one.quality is Quality.GOOD and one.age < 0.2 for one in reading)


def test_both_encoders_over_the_bridge(stage: Stage) -> None:
    bridge = Bridge(stage)
    bridge.table.until(bridge.good)
    first = bridge.link.now()
    bridge.table.until(lambda now: now > first + 1.0 and bridge.good(now))
    now = bridge.link.now()
    motor, shaft = bridge.reader.read(now)
    # Both angles belong to one instant, whose age is at most the reported age.
    moment = motor.angle / 2.0
    assert shaft.angle == pytest.approx(0.5 * moment, abs=5e-5)
    assert now - bridge.began - moment <= motor.age + 1e-3
    assert bridge.reader.error_counts.bad_frames == 0
    bridge.link.close()


@pytest.mark.parametrize(
    ("which", "fault", "quality"),
    [
        ("motor", "no_answer", Quality.SILENT),
        ("shaft", "no_answer", Quality.SILENT),
        ("motor", "frozen_word", Quality.STUCK),
    ],
)
def test_an_encoders_fault_is_named(stage: Stage, which: str, fault: str, quality: Quality) -> None:
    bridge = Bridge(stage)
    bridge.table.until(bridge.good)
    encoder = getattr(bridge.device, which)
    stage.do(lambda: encoder.faults.switch(fault))
    bridge.table.until(lambda now: getattr(bridge.reader.read(now), which).quality is quality)
    bridge.table.until(lambda now: getattr(bridge.reader.read(now), which).age > 0.1)
    stage.do(lambda: encoder.faults.switch(fault, False))
    bridge.table.until(bridge.good)
    bridge.link.close()


def test_restarted_bridge_keeps_the_turn_count(stage: Stage) -> None:
    bridge = Bridge(stage)
    bridge.table.until(bridge.good)
    bridge.table.run(0.3)
    stage.do(lambda: bridge.device.faults.switch("restarted"))
    bridge.table.until(lambda _: bridge.reader.restarts >= 1)
    stage.do(lambda: bridge.device.faults.switch("restarted", False))
    bridge.table.until(bridge.good)
    motor, shaft = bridge.reader.read(bridge.link.now())
    assert shaft.angle == pytest.approx(motor.angle / 4.0, abs=5e-5)
    bridge.link.close()


def digital_session(
    stage: Stage, load: Callable[[], Wrench] = lambda: LOAD
) -> tuple[DigitalFt, DriverSession]:
    device = stage.show(
        DigitalFt(
            stage.line("cell", baud=1_250_000, bits_per_byte=11),
            load,
            DigitalFtSettings(rate=1000.0, burst=0.005),
        )
    )
    reader = DigitalReader(
        digital_reader.DigitalFtSettings(
            "load cell",
            "FT00000",
            "N",
            "N-m",
            32767,
            quiet_time=0.1,
            answer_timeout=BUSY,
            silence_timeout=BUSY,
        )
    )
    link = SerialLink(Port("load cell", device.address, 1_250_000, "E", 1))
    return device, DriverSession(link, reader)


def is_near(wrench: Any, expected: tuple[float, ...], within: float) -> bool:
    return all(abs(a - b) < within for a, b in zip(wrench, expected, strict=True))


def test_digital_load_cell_reads_the_load(stage: Stage) -> None:
    """Tared without load, for its gauges have a bias; a count is worth up to 0.06 N."""
    loads = [Wrench()]
    device, table = digital_session(stage, lambda: loads[0])
    reader = table.talk
    table.until(lambda now: reader.read(now).age < 0.2)
    reader.tare(50)
    table.until(lambda now: is_near(reader.read(now).wrench, Wrench(), 1e-6))
    loads[0] = LOAD
    table.until(lambda now: is_near(reader.read(now).wrench, LOAD, 0.1))
    wrench = reader.read(table.link.now()).wrench
    assert is_near(wrench[3:], LOAD[3:], 0.005)
    assert reader.calibration.part == "SI-700-30"
    assert device.streaming
    assert reader.error_counts.searches == 0
    table.link.close()


@pytest.mark.parametrize("fault", ["stream_stops", "wrong_sum"])
def test_digital_load_cell_stream_is_restarted(stage: Stage, fault: str) -> None:
    device, table = digital_session(stage)
    reader = table.talk
    table.until(lambda now: reader.read(now).age < 0.2)
    stage.do(lambda: device.faults.switch(fault))
    table.until(lambda now: reader.read(now).phase is not LoadPhase.STREAMING)
    assert "no sample" in reader.explain(table.link.now())
    stage.do(lambda: device.faults.switch(fault, False))
    table.until(lambda now: reader.read(now).age < 0.2)
    assert reader.starts >= 2
    table.link.close()


def test_digital_load_cell_reports_saturation(stage: Stage) -> None:
    device, table = digital_session(stage)
    reader = table.talk
    table.until(lambda now: reader.read(now).age < 0.2)
    stage.do(lambda: device.faults.switch("saturated"))
    table.until(lambda now: reader.read(now).saturated == 0b111111)
    assert reader.read(table.link.now()).fault == 1
    table.link.close()


@pytest.fixture
def net(stage: Stage) -> tuple[NetFt, DriverSession]:
    box = stage.show(
        NetFt(lambda: LOAD, NetFtSettings(port=0, tcp_port=0, http_port=0, rate=500.0))
    )
    host, port = box.address.split(":")
    reader = NetReader(
        net_reader.NetFtSettings(
            "load cell", make_scale(1e6, 1e6, "N", "N-m"), net_ft.NET_FT_BITS, 0, 7000.0, 0.05, BUSY
        )
    )
    return box, DriverSession(UdpLink(Peer("load cell", host, int(port))), reader)


def test_net_load_cell_reads_the_load(net: tuple[NetFt, DriverSession]) -> None:
    _, table = net
    reader = table.talk
    table.until(lambda now: reader.read(now).age < 0.2)
    assert is_near(reader.read(table.link.now()).wrench, LOAD, 1e-5)
    table.run(0.2)
    reader.tare_box()
    table.until(lambda now: is_near(reader.read(now).wrench, Wrench(), 1e-5))
    assert (reader.missing, reader.repeated, reader.bad_datagrams) == (0, 0, 0)
    table.link.close()


def test_net_load_cell_scale_is_that_of_the_box(net: tuple[NetFt, DriverSession]) -> None:
    host, port = net[0].tcp.address.split(":")
    reply = send_request("load cell", host, int(port), net_ft.READ_CALIBRATION, 24, 5.0)
    assert net_ft.decode_calibration(reply) == make_scale(1e6, 1e6, "N", "N-m")


@pytest.mark.parametrize("fault", ["silent", "short_records", "foreign_client"])
def test_net_load_cell_stream_is_restarted(
    stage: Stage, net: tuple[NetFt, DriverSession], fault: str
) -> None:
    box, table = net
    reader = table.talk
    table.until(lambda now: reader.read(now).age < 0.2)
    stage.do(lambda: box.faults.switch(fault))
    table.until(lambda now: reader.read(now).phase is not LoadPhase.STREAMING)
    assert reader.read(table.link.now()).age > BUSY - 0.1
    stage.do(lambda: box.faults.switch(fault, False))
    table.until(lambda now: reader.read(now).age < 0.2)
    assert reader.starts >= 2
    table.link.close()


def test_net_load_cell_reports_saturation(stage: Stage, net: tuple[NetFt, DriverSession]) -> None:
    box, table = net
    reader = table.talk
    table.until(lambda now: reader.read(now).age < 0.2)
    stage.do(lambda: box.faults.switch("saturated"))
    table.until(lambda now: reader.read(now).saturated == 1)
    assert "saturated" in reader.explain(table.link.now())
    table.link.close()


def test_datagrams_that_the_network_drops_are_counted(
    stage: Stage, net: tuple[NetFt, DriverSession]
) -> None:
    box, table = net
    reader = table.talk
    table.until(lambda now: reader.read(now).age < 0.2)
    stage.do(lambda: box.link.to_host.switch("drop"))
    table.until(lambda _: box.link.to_host.counts["drop"] >= 10)
    stage.do(lambda: box.link.to_host.switch("drop", False))
    table.until(lambda _: reader.missing == box.link.to_host.counts["drop"])
    table.link.close()
