"""The Compax3: records of the manual, lines, power stage, host timeout, and pyserial."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import pytest
import serial
from emulator_stage import Stage, until
from hypothesis import given
from hypothesis import strategies as st

from sim_plant.emulators import compax3_records as records
from sim_plant.emulators.compax3 import Compax3
from sim_plant.emulators.compax3_drive import DriveInput
from sim_plant.emulators.compax3_objects import Compax3Settings
from sim_plant.emulators.compax3_records import Record, RecordReceiver
from sim_plant.emulators.serial_line import SerialLine, SerialLineSettings

READ_POSITION = bytes.fromhex("A5 03 02 02 A8 05 E1 46")  # Parker manual: o680.5, address 3
POSITION = bytes.fromhex("05 05 FF FF FF FF FE 2D 07 B4")
WRITE_ARRAY = bytes.fromhex("C5 02 08 07 6D 01 00 09 2E 00 00 00 95 D5")  # o1901.1 = 2350
ACKNOWLEDGED = bytes.fromhex("06 01 00 00 BA 87")
TURN = 2.0 * math.pi


class Bench:
    """A drive with its inputs and its written outputs."""

    def __init__(self, folder: Path = Path("/nowhere"), **settings: object) -> None:
        self.seen = DriveInput()
        self.written: dict[str, float] = {}
        line = SerialLine(SerialLineSettings(folder / "compax", 115_200))
        drive_settings = Compax3Settings(**settings)  # type: ignore[arg-type]
        self.device = Compax3(line, lambda: self.seen, self.written.__setitem__, drive_settings)

    def send(self, data: bytes, now: float = 0.0) -> bytes:
        replies = [self.device.answer(m, now) for m in RecordReceiver().feed(data, now)]
        return b"".join(reply or b"" for reply in replies)

    def send_line(self, line: str, now: float = 0.0) -> str:
        return self.send(line.encode() + b"\r", now).decode()

    def enable(self) -> None:
        assert self.send_line("o1100.3=1") == ">\r"


@pytest.mark.parametrize("frame", [READ_POSITION, POSITION, WRITE_ARRAY, ACKNOWLEDGED])
def test_check_sums_of_the_manual(frame: bytes) -> None:
    assert records.crc(frame[:-2]).to_bytes(2, "big") == frame[-2:]


def test_records_of_the_manual() -> None:
    bench = Bench(full_speed=4000.0)
    bench.seen = DriveInput(position=-467.0 / 2**24 * TURN)  # FFFFFF.FFFE2D
    assert bench.send(READ_POSITION) == POSITION
    assert bench.send(WRITE_ARRAY) == ACKNOWLEDGED
    assert bench.send_line("o1901.1") == "2350\r"


def test_only_the_addressed_drive_answers() -> None:
    bench = Bench(address=3)
    assert bench.send(READ_POSITION)[:1] == b"\x05"
    assert bench.send(WRITE_ARRAY) == b""  # for drive 2
    assert bench.send_line("3o680.5") == "*0\r"
    assert bench.send_line("4o680.5") == ""
    assert bench.send_line("o680.5") == ""


def test_several_objects_in_one_record_and_plc_formats() -> None:
    bench = Bench()
    bench.seen = DriveInput(current=2.5)
    request = bytes.fromhex("02B0 02 0226 01")  # o688.2, o550.1
    reply = bench.send(records.encode_record(0xA4, request))
    assert reply == records.encode_record(0x05, bytes.fromhex("000002 800000 000001"))
    reply = bench.send(records.encode_record(0xAC, request))
    assert reply == records.encode_record(0x05, struct.pack(">fH", 2.5, 1))


@pytest.mark.parametrize(
    ("line", "reply"),
    [
        ("o550.1", "1\r"),
        (" O 550 , 1 ", "1\r"),
        ("o$226.$1", "1\r"),
        ("o1000.3$", "$500\r"),  # no error, powerless
        ("o1.4", "123456\r"),
        ("o1905.3=12.5", ">\r"),
        ("o1905.3=$10", ">\r"),
        ("o685.2", "325\r"),
        ("o680.5=1", "!0601\r"),
        ("o9999.1", "!0602\r"),
        ("o1905.3=nan", "!0609\r"),
        ("o1905.3=twelve", "!0609\r"),
        ("o1901.1=38", "!0609\r"),
        ("what", "!0604\r"),
        ("", "!0604\r"),
    ],
)
def test_lines(line: str, reply: str) -> None:
    assert Bench().send_line(line) == reply


def test_identity() -> None:
    assert Bench().send_line("_?").startswith("Compax3")


@pytest.mark.parametrize(
    ("data", "code"),
    [
        ("270F 01", 0x0602),
        ("02A8", 0x0604),
        ("02A8 05 02", 0x0604),
    ],
)
def test_reads_of_missing_objects_are_refused(data: str, code: int) -> None:
    reply = Bench().send(records.encode_record(0xA4, bytes.fromhex(data)))
    assert reply == records.encode_record(0x07, code.to_bytes(2, "big"))


@pytest.mark.parametrize("data", ["076D 01 0009", "076D 01", "02A8 05 000000000000"])
def test_bad_writes_are_refused(data: str) -> None:
    assert Bench().send(records.encode_record(0xC4, bytes.fromhex(data)))[:1] == b"\x07"


def test_a_wrong_sum_is_refused() -> None:
    reply = Bench().send(READ_POSITION[:-1] + b"\0")
    assert reply == records.encode_refusal(0x0504)


def test_set_points_act_only_while_the_power_stage_is_on() -> None:
    bench = Bench()
    assert bench.send_line("o1901.1=2") == ">\r"
    assert bench.written["velocity"] == 0.0
    bench.enable()
    assert bench.written == {"velocity": pytest.approx(2 * TURN), "torque": 0.0, "enabled": 1.0}
    assert bench.send_line("o1902.1=-3.5") == ">\r"
    assert bench.written == {"velocity": 0.0, "torque": -3.5, "enabled": 1.0}
    assert bench.send_line("o1100.3=3") == ">\r"  # stop
    assert bench.written == {"velocity": 0.0, "torque": 0.0, "enabled": 1.0}
    assert bench.send_line("o1100.3=0") == ">\r"
    assert bench.written["enabled"] == 0.0
    assert bench.send_line("o1902.1") == "0\r"  # a set-point does not survive


def test_the_analog_input_commands_the_speed() -> None:
    """37.5 rev/s at 10 V (OSWEC thesis); gain and offset are objects of the drive."""
    bench = Bench(source="analog")
    bench.seen = DriveInput(analog=-4.0)
    bench.enable()
    assert bench.written["velocity"] == pytest.approx(-15.0 * TURN)
    bench.send_line("o170.4=0.1")
    assert bench.written["velocity"] == pytest.approx(-3.9 * 3.75 * TURN)
    bench.seen = DriveInput(analog=14.0)
    bench.send_line("o685.3")
    assert bench.written["velocity"] == pytest.approx(37.5 * TURN)


def test_error_removes_power_until_a_rising_edge() -> None:
    bench = Bench()
    bench.enable()
    bench.device.faults.switch("over_temperature")
    assert bench.send_line("o550.1") == "17168\r"
    assert bench.written["enabled"] == 0.0
    assert int(bench.send_line("o1000.3")) & 0x500 == 0x400  # an error, powerless
    bench.send_line("o1100.3=0")
    bench.enable()
    assert bench.send_line("o550.1") == "17168\r"  # its cause persists
    bench.device.faults.clear()
    bench.send_line("o1100.3=0")
    bench.enable()  # acknowledges the error
    assert (bench.send_line("o550.1"), bench.written["enabled"]) == ("1\r", 0.0)
    bench.send_line("o1100.3=0")
    bench.enable()
    assert bench.written["enabled"] == 1.0


def test_host_timeout_of_the_drive() -> None:
    bench = Bench(host_timeout=0.2)
    bench.enable()
    bench.send_line("o1901.1=1", now=0.1)
    bench.device.drive.advance(0.29)
    assert bench.written["enabled"] == 1.0
    bench.device.drive.advance(0.31)
    assert (bench.written["enabled"], bench.written["velocity"]) == (0.0, 0.0)
    assert bench.send_line("o550.1", now=0.32) == f"{0x8130}\r"


@pytest.mark.parametrize(
    ("fault", "reply"),
    [
        ("silent", b""),
        ("wrong_crc", POSITION[:-1] + bytes((POSITION[-1] ^ 0xFF,))),
        ("refuses", records.encode_refusal(0x0609)),
    ],
)
def test_faults_of_the_port(fault: str, reply: bytes) -> None:
    bench = Bench()
    bench.seen = DriveInput(position=-467.0 / 2**24 * TURN)
    bench.device.faults.switch(fault)
    assert bench.send(READ_POSITION) == reply


def test_faults_of_the_power_part() -> None:
    bench = Bench()
    bench.device.faults.switch("does_not_enable")
    bench.enable()
    assert bench.written["enabled"] == 0.0
    bench.device.faults.clear()
    bench.send_line("o1100.3=0")
    bench.enable()
    bench.send_line("o1901.1=5")
    forward = bench.written["velocity"]
    bench.device.faults.switch("inverted_motor")
    bench.send_line("o1901.1=5")
    assert bench.written["velocity"] == -forward != 0.0
    bench.device.faults.clear()
    bench.send_line("o1901.1=0")
    bench.device.faults.switch("ignores_set_points")
    assert bench.send_line("o1901.1=5") == ">\r"
    assert bench.written["velocity"] == 0.0
    bench.device.faults.clear()
    bench.device.faults.switch("frozen_values")
    bench.seen = DriveInput(position=5.0)
    assert bench.send_line("o680.5") == "0\r"


def test_frozen_measurement_does_not_freeze_the_command() -> None:
    bench = Bench(source="analog")
    bench.seen = DriveInput(analog=4.0)
    bench.enable()
    bench.device.faults.switch("frozen_values")
    bench.seen = DriveInput(analog=0.0)
    assert bench.send_line("o685.3") == "4\r"
    assert bench.written["velocity"] == 0.0


@given(st.binary(max_size=80))
def test_receiver_recovers_from_noise_after_silence(noise: bytes) -> None:
    receiver = RecordReceiver()
    for k, byte in enumerate(noise):
        receiver.feed(bytes((byte,)), 0.0001 * k)
    receiver.feed(b"\r", 1.0)  # a host first sends an end of line, to end a partial line
    assert receiver.feed(READ_POSITION, 2.0) == [
        Record(0xA5, 3, bytes.fromhex("02A805"), crc_ok=True)
    ]


def test_partial_record_is_discarded_after_5_ms() -> None:
    receiver = RecordReceiver()
    assert receiver.feed(READ_POSITION[:4], 0.0) == []
    assert len(receiver.feed(READ_POSITION[4:], 0.004)) == 1
    assert receiver.feed(READ_POSITION[:4], 1.0) == []
    assert receiver.feed(READ_POSITION, 1.006)[0] == Record(0xA5, 3, b"\x02\xa8\x05", crc_ok=True)
    assert receiver.abandoned == 1


@given(st.floats(-8.0e6, 8.0e6))
def test_real48_keeps_its_24_bits_of_fraction(value: float) -> None:
    data = records.encode_value("REAL48", value, plc=False)
    assert records.decode_value("REAL48", data, plc=False) == pytest.approx(value, abs=2.0**-25)


def test_a_host_on_the_line(stage: Stage) -> None:
    bench = Bench(stage.folder)
    device = stage.show(bench.device)
    with serial.Serial(device.address, 115_200, timeout=3.0) as port:
        port.write(b"_?\r")
        assert port.read_until(b"\r").startswith(b"Compax3")
        port.write(b"o1100.3=1\r")
        assert port.read_until(b"\r") == b">\r"
        port.write(records.encode_record(0xC4, bytes.fromhex("076D 01 000001 800000")))
        assert port.read(6) == ACKNOWLEDGED
        assert bench.written["velocity"] == pytest.approx(1.5 * TURN)
        device.faults.switch("over_temperature")
        assert until(lambda: bench.written["enabled"] == 0.0)  # without a request of the host


@pytest.mark.parametrize(
    ("fault", "code"),
    [("following_error", 29472), ("limit_low", 29475), ("limit_high", 29476)],
)
def test_error_codes_of_the_manual(fault: str, code: int) -> None:
    bench = Bench()
    bench.enable()
    bench.device.faults.switch(fault)
    assert bench.send_line("o550.1") == f"{code}\r"
    assert bench.written["enabled"] == 0.0


def test_a_drive_that_does_not_stop() -> None:
    bench = Bench()
    bench.enable()
    bench.device.faults.switch("does_not_stop")
    bench.send_line("o1901.1=2")
    bench.send_line("o1100.3=3")
    bench.send_line("o1100.3=0")
    assert bench.written == {"velocity": pytest.approx(2 * TURN), "torque": 0.0, "enabled": 1.0}


def test_a_late_answer(stage: Stage) -> None:
    bench = Bench(stage.folder, late_by=0.15)
    device = stage.show(bench.device)
    device.faults.switch("late_answers")
    with serial.Serial(device.address, 115_200, timeout=0.05) as port:
        port.write(b"o550.1\r")
        assert port.read(2) == b""
        assert until(lambda: port.in_waiting == 2)
