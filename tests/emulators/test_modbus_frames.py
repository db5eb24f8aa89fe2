"""Requests and answers byte by byte: manufacturers' frames, examples of the standard, noise."""

from __future__ import annotations

import struct
import time

import pytest
import serial
from emulator_stage import Stage
from hypothesis import given
from hypothesis import strategies as st

from sim_plant.emulators.modbus_pdu import Table, answer_request
from sim_plant.emulators.modbus_rtu import RtuLine, RtuReceiver, RtuSettings, crc16, encode_frame
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.strain_amplifier import AmplifierSettings, StrainAmplifier

INT32_REQUEST = bytes.fromhex("01 03 03 00 00 02 C4 4F")  # printed by the DY094's maker
FLOAT_REQUEST = bytes.fromhex("01 03 01 00 00 02 C5 F7")


def unit() -> ModbusUnit:
    device = ModbusUnit()
    for address, value in ((0x6B, 555), (0x6C, 0), (0x6D, 100), (4, 0x12)):
        device.put(Table.HOLDING, address, value)
    for place in range(0x13, 0x13 + 19):
        device.put(Table.COILS, place, 0xCD6B05 >> (23 - (place - 0x13)) & 1)
    device.writable = {(Table.HOLDING, address) for address in (1, 2, 4)}
    device.writable |= {(Table.COILS, address) for address in range(0x13, 0x1D)}
    return device


@pytest.mark.parametrize("frame", [INT32_REQUEST, FLOAT_REQUEST])
def test_manufacturer_frames_are_valid_requests(frame: bytes) -> None:
    assert crc16(frame[:-2]).to_bytes(2, "little") == frame[-2:]
    assert encode_frame(frame[0], frame[1:-2]) == frame
    assert RtuReceiver(RtuSettings()).feed(frame, 0.0) == [(1, frame[1:-2])]


def test_amplifier_answers_the_manufacturer_frames() -> None:
    amplifier = StrainAmplifier(lambda: (12.5, -3.0), AmplifierSettings(rating=2000.0))
    for request, value in ((FLOAT_REQUEST, ">f"), (INT32_REQUEST, ">i")):
        reply = amplifier.serve(request[1:-2], 1.0)
        assert reply is not None
        expected = struct.pack(value, 12.5 if value == ">f" else 12500)
        assert reply.pdu == b"\x03\x04" + expected


@pytest.mark.parametrize(
    ("request_", "reply"),
    [  # Modbus application protocol V1.1b3, sections 6.3, 6.6, 6.12, 6.16
        ("03 006B 0003", "03 06 022B 0000 0064"),
        ("06 0001 0003", "06 0001 0003"),
        ("10 0001 0002 04 000A 0102", "10 0001 0002"),
        ("16 0004 00F2 0025", "16 0004 00F2 0025"),
        ("05 0013 FF00", "05 0013 FF00"),
        ("0F 0013 000A 02 CD 01", "0F 0013 000A"),
        ("03 0070 0001", "83 02"),  # undefined
        ("03 006C 0003", "83 02"),  # partly undefined
        ("06 006B 0001", "86 02"),  # read-only
        ("10 0002 0002 04 000A 0102", "90 02"),  # one of two is read-only: none is written
        ("03 006B 0000", "83 03"),
        ("03 006B 007E", "83 03"),
        ("10 0001 0002 03 000A 01", "90 03"),
        ("05 0013 0001", "85 03"),
        ("03 00", "83 03"),
        ("2B 0E 01 00", "AB 01"),
        ("07", "87 01"),
    ],
)
def test_the_standards_examples(request_: str, reply: str) -> None:
    assert answer_request(unit(), bytes.fromhex(request_)).hex() == bytes.fromhex(reply).hex()


def test_a_mask_write_changes_its_bits() -> None:
    device = unit()
    answer_request(device, bytes.fromhex("16 0004 00F2 0025"))
    assert device.read(Table.HOLDING, 4, 1) == [0x17]  # the standard's own result
    answer_request(device, bytes.fromhex("10 0002 0002 04 000A 0102"))
    assert (
        answer_request(device, bytes.fromhex("03 0002 0001")) == b"\x83\x02"
    )  # refused without a partial write


def test_bits_are_packed_from_the_lowest() -> None:
    device = unit()
    answer_request(device, bytes.fromhex("0F 0013 000A 02 CD 01"))
    assert answer_request(device, bytes.fromhex("01 0013 000A")) == bytes.fromhex("01 02 CD 01")


def test_frames_in_pieces_and_in_sequence() -> None:
    receiver = RtuReceiver(RtuSettings())
    frames = [
        frame for k in range(8) for frame in receiver.feed(INT32_REQUEST[k : k + 1], 0.001 * k)
    ]
    assert frames == [(1, INT32_REQUEST[1:-2])]
    assert len(receiver.feed(INT32_REQUEST + FLOAT_REQUEST, 0.01)) == 2


def test_noise_is_skipped_until_silence() -> None:
    receiver = RtuReceiver(RtuSettings())
    assert receiver.feed(INT32_REQUEST[:-1] + b"\0" + FLOAT_REQUEST, 0.0) == []
    assert receiver.bad_frames == 1
    assert receiver.feed(FLOAT_REQUEST, 0.01) == []
    assert len(receiver.feed(FLOAT_REQUEST, 0.05)) == 1


def test_partial_frame_is_discarded_after_silence() -> None:
    receiver = RtuReceiver(RtuSettings())
    assert receiver.feed(INT32_REQUEST[:5], 0.0) == []
    assert len(receiver.feed(INT32_REQUEST, 0.1)) == 1
    assert receiver.truncated_frames == 1


def test_unknown_function_is_still_a_frame() -> None:
    frame = encode_frame(3, b"\x41\x01\x02\x03")
    assert RtuReceiver(RtuSettings()).feed(frame, 0.0) == [(3, b"\x41\x01\x02\x03")]


@given(st.binary(max_size=300))
def test_no_request_breaks_a_unit(data: bytes) -> None:
    reply = unit().serve(data, 0.0)
    assert (reply is None) == (not data)
    if reply is not None:
        assert reply.pdu[0] & 0x7F == data[0] & 0x7F
        assert len(reply.pdu) <= 253


@given(st.lists(st.tuples(st.binary(max_size=30), st.floats(0.0, 0.1)), max_size=20))
def test_after_any_noise_and_silence_a_request_is_found(noise: list[tuple[bytes, float]]) -> None:
    receiver = RtuReceiver(RtuSettings())
    now = 0.0
    for data, pause in noise:
        now += pause
        receiver.feed(data, now)
    assert receiver.feed(FLOAT_REQUEST, now + 1.0) == [(1, FLOAT_REQUEST[1:-2])]


@pytest.mark.parametrize(
    ("fault", "expected_words"),
    [
        ("swapped_words", [0x0000, 0x4148]),
        ("half_words", [0x0000, 0x0000]),
        ("silent", None),
        ("refuses", 4),
        ("busy", 6),
    ],
)
def test_faults_of_any_unit(fault: str, expected_words: list[int] | int | None) -> None:
    device = ModbusUnit()
    device.put_float(Table.INPUT, 10, 12.5)
    device.faults.switch(fault)
    reply = device.serve(bytes.fromhex("04 000A 0002"), 0.0)
    if expected_words is None:
        assert reply is None
    elif isinstance(expected_words, int):
        assert reply is not None
        assert reply.pdu == bytes((0x84, expected_words))
    else:
        assert reply is not None
        assert list(struct.unpack(">HH", reply.pdu[2:])) == expected_words


def test_a_torn_float_mixes_two_readings() -> None:
    device = ModbusUnit()
    device.put_float(Table.INPUT, 0, 1.0 + 2.0**-20)
    device.put_float(Table.INPUT, 0, -2.0)
    device.faults.switch("torn_values")
    data = struct.pack(">HH", *device.read(Table.INPUT, 0, 2))
    assert struct.unpack(">f", data)[0] == pytest.approx(-2.0 - 2.0**-19, rel=1e-12)


def test_late_answers_are_late() -> None:
    device = ModbusUnit(reply_delay=0.01, late_by=0.3)
    device.faults.switch("late_answers")
    reply = device.serve(b"\x03\0\0\0\x01", 0.0)
    assert reply is not None
    assert reply.delay == pytest.approx(0.31)


def test_garbage_and_half_frames_on_the_line(stage: Stage) -> None:
    """The manufacturer's request is answered after any noise followed by silence."""
    amplifier = StrainAmplifier(lambda: (12.5,), AmplifierSettings(rating=2000.0))
    line = stage.show(RtuLine(stage.line(chunk=3), {1: amplifier}))
    with serial.Serial(line.address, 115_200, timeout=3.0) as port:
        for before in (b"", FLOAT_REQUEST[:5], bytes(range(60)), INT32_REQUEST[:-1] + b"\0"):
            port.write(before)
            time.sleep(0.1)
            port.reset_input_buffer()
            port.write(FLOAT_REQUEST)
            assert port.read(9) == bytes.fromhex("01 03 04 41 48 00 00 6E 19")
