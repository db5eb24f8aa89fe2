"""SSI words and the bridge's frames: golden bytes, faults, and the stream on a line."""

from __future__ import annotations

import binascii
import math
import struct
import time
from pathlib import Path

import pytest
import serial
from emulator_stage import Stage
from hypothesis import given
from hypothesis import strategies as st

from sim_plant.emulators.encoder_bridge import BridgeSettings, EncoderBridge, ShaftAngles
from sim_plant.emulators.encoder_words import Encoder, EncoderSettings, crc8, encode_word
from sim_plant.emulators.serial_line import SerialLine, SerialLineSettings

TURN = 2.0 * math.pi
EXAMPLE = bytes.fromhex(  # docs/reference/wires.md
    "EB 90 01 00 01 02 00 00 00 00 00 0F 42 40 04 01 ED 2D 29 23 00 C1 23 45 10 C5"
)


@pytest.mark.parametrize(("plain", "crc"), [(0x800001, 0x60), (0xC00000, 0x47)])
def test_the_check_sum_of_ssi6(plain: int, crc: int) -> None:
    assert crc8(plain) == crc


@pytest.mark.parametrize(
    ("device", "bits"),
    [
        (encode_word(1, 0x12345, valid=True), "1 1 0000010010001101000101"),
        (encode_word(2, 0b0111, valid=True), "0000000000000000000111 1 0"),
        (encode_word(2, 0b0110, valid=False), "0000000000000000000110 0 1"),
        (encode_word(4, 370085, valid=True, stamp=291), "1 1 1011010010110100101 00100100011"),
        (
            encode_word(9, 1, valid=False, zero=False, stamp=2049),
            "0 0 0000000000000000001 00000000001",
        ),
        (encode_word(6, 0, valid=True), "01000111 1 1 0000000000000000000000"),
    ],
)
def test_ssi_words_bit_by_bit(device: int, bits: str) -> None:
    assert device == int(bits.replace(" ", ""), 2)


@pytest.mark.parametrize(("protocol", "position"), [(7, 0), (4, 1 << 19), (1, -1)])
def test_invalid_ssi_words_are_refused(protocol: int, position: int) -> None:
    with pytest.raises(ValueError, match="SSI"):
        encode_word(protocol, position, valid=True)


@given(st.floats(-1.0e4, 1.0e4))
def test_counts_follow_the_angle(angle: float) -> None:
    encoder = Encoder()
    step = TURN / 2**19
    rest = math.remainder(angle - encoder.count(angle) * step, TURN)
    assert -1.0e-9 <= rest < step + 1.0e-9


def test_encoder_with_reversed_mounting() -> None:
    encoder = Encoder(EncoderSettings(protocol=1, sign=-1, zero=100))
    assert encoder.count(0.0) == 100
    assert encoder.count(TURN / 4) == 100 - 2**17 + 2**19


@pytest.mark.parametrize(
    ("fault", "first", "second"),
    [
        ("invalid", (0, 1, 0, 0), (0, 1, 1024, 100)),
        ("wrapped", (1, 1, 2**18, 0), (1, 1, 2**18 + 1024, 100)),
        ("stuck", (1, 1, 0, 0), (1, 1, 0, 100)),
        ("frozen_word", (1, 1, 0, 0), (1, 1, 0, 0)),
        ("reversed", (1, 1, 0, 0), (1, 1, 2**19 - 1024, 100)),
        ("stepped", (1, 1, 43691, 0), (1, 1, 43691 + 1024, 100)),  # 30 deg
        ("creeping", (1, 1, 0, 0), (1, 1, 15 + 1024, 100)),  # 10 deg/s for 1 ms
        ("zero_moved", (1, 0, 0, 0), (1, 0, 1024, 100)),
    ],
)
def test_faults_of_an_encoder(fault: str, first: tuple[int, ...], second: tuple[int, ...]) -> None:
    encoder = Encoder()
    encoder.faults.switch(fault)
    for place, expected in enumerate((first, second)):
        device = encoder.latch(place * 1024.5 * TURN / 2**19, 0.001 * place)
        assert device is not None
        assert (device >> 31, device >> 30 & 1, device >> 11 & 0x7FFFF, device & 0x7FF) == expected


@pytest.mark.parametrize("protocol", [2, 6])
def test_wrong_check_sum_or_parity(protocol: int) -> None:
    encoder = Encoder(EncoderSettings(protocol=protocol))
    good = encoder.latch(1.0, 0.0)
    encoder.faults.switch("wrong_crc")
    bad = encoder.latch(1.0, 0.0)
    assert good is not None
    assert bad is not None
    assert (good ^ bad).bit_count() == 1
    encoder.faults.switch("no_answer")
    assert encoder.latch(1.0, 0.0) is None


def bridge(read: object, line: SerialLine | None = None, **settings: object) -> EncoderBridge:
    return EncoderBridge(
        line or SerialLine(SerialLineSettings(Path("/nowhere/bridge"), 460_800)),
        read,  # type: ignore[arg-type]
        Encoder(EncoderSettings(protocol=4)),
        Encoder(EncoderSettings(protocol=1)),
        BridgeSettings(**settings),  # type: ignore[arg-type]
    )


def test_the_documents_example() -> None:
    """Frame 258 at 1 s: motor SSI4 count 370085, stamp 291; shaft SSI1 count 74565."""
    step = TURN / 2**19
    now = [ShaftAngles(0.0, 0.0, 0.0)]
    device = bridge(lambda: now[0], first_number=257, start_us=0)
    device.latch()
    now[0] = ShaftAngles(1.0, 370085.5 * step, 74565.5 * step)
    frame = device.latch()
    assert frame is not None
    stamp = 100_000 & 0x7FF  # 1 s in 10 us: an encoder's stamp runs free, the document's is 291
    motor = 0xED2D2800 | stamp
    body = EXAMPLE[2:16] + struct.pack(">I", motor) + EXAMPLE[20:24]
    # binascii's CRC has the same polynomial and is independent
    assert frame == EXAMPLE[:2] + body + binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "big")
    assert binascii.crc_hqx(EXAMPLE[2:24], 0xFFFF).to_bytes(2, "big") == EXAMPLE[24:]


def status(frame: bytes | None) -> tuple[int, int]:
    """Flags and number."""
    assert frame is not None
    return frame[3], int.from_bytes(frame[4:6], "big")


def test_flags_of_start_skipped_periods_and_silent_encoders() -> None:
    clock = [0.0]

    def read() -> ShaftAngles:
        clock[0] += 0.001
        return ShaftAngles(clock[0], 0.0, 0.0)

    device = bridge(read, first_number=65534)
    assert status(device.latch()) == (8, 65534)
    device.skip(2)
    assert status(device.latch()) == (4, 1)
    device.shaft.faults.switch("no_answer")
    assert status(device.latch()) == (2, 2)
    device.motor.faults.switch("no_answer")
    assert status(device.latch()) == (3, 3)
    clock[0] -= 0.001  # the source's time does not advance
    assert device.latch() is None
    assert status(device.latch()) == (7, 5)


@pytest.mark.parametrize(
    ("fault", "place", "expected_byte"),
    [("wrong_version", 2, 2), ("stuck_sequence", 5, 0), ("restarted", 3, 8)],
)
def test_faults_of_the_bridge(fault: str, place: int, expected_byte: int) -> None:
    clock = iter(range(1, 100))
    device = bridge(lambda: ShaftAngles(0.001 * next(clock), 0.0, 0.0))
    device.faults.switch(fault)
    device.latch()
    frame = device.latch()
    assert frame is not None
    assert frame[place] == expected_byte
    assert binascii.crc_hqx(frame[2:24], 0xFFFF) == int.from_bytes(frame[24:], "big")
    device.faults.switch("wrong_crc")
    frame = device.latch()
    assert frame is not None
    assert binascii.crc_hqx(frame[2:24], 0xFFFF) != int.from_bytes(frame[24:], "big")


def test_the_stream_on_a_line(stage: Stage) -> None:
    """At 500 Hz: complete frames, matching numbers and time stamps, the clock of the source."""
    start = time.monotonic()

    def read() -> ShaftAngles:
        now = time.monotonic() - start
        return ShaftAngles(now, now, now / 15.0)

    device = stage.show(bridge(read, stage.line("bridge", baud=460_800, chunk=7), rate=500.0))
    with serial.Serial(device.address, 460_800, timeout=5.0) as port:
        port.reset_input_buffer()
        data = port.read(26 * 101)
    begin = data.index(EXAMPLE[:3])
    frames = [data[k : k + 26] for k in range(begin, len(data) - 25, 26)]
    assert len(frames) >= 100
    numbers = [int.from_bytes(frame[4:6], "big") for frame in frames]
    times = [int.from_bytes(frame[6:14], "big") for frame in frames]
    for frame in frames:
        assert binascii.crc_hqx(frame[2:24], 0xFFFF) == int.from_bytes(frame[24:], "big")
    for (n, t), (m, u), frame in zip(
        zip(numbers, times, strict=True),
        zip(numbers[1:], times[1:], strict=True),
        frames[1:],
        strict=False,
    ):
        assert u > t
        assert m > n
        assert bool(frame[3] & 4) == (m > n + 1)
    counts = [int.from_bytes(frame[16:20], "big") >> 11 & 0x7FFFF for frame in frames]
    turned = (counts[-1] - counts[0]) % 2**19 * TURN / 2**19
    assert turned == pytest.approx(1.0e-6 * (times[-1] - times[0]), abs=2 * TURN / 2**19)
    stamps = [int.from_bytes(frame[16:20], "big") & 0x7FF for frame in frames]
    assert [t // 10 & 0x7FF for t in times] == pytest.approx(stamps, abs=1)


def test_silent_bridge_continues_counting() -> None:
    clock = iter(range(1, 100))
    device = bridge(lambda: ShaftAngles(0.001 * next(clock), 0.0, 0.0))
    assert status(device.latch()) == (8, 0)
    device.faults.switch("silent")
    assert device.latch() is None
    device.faults.clear()
    assert status(device.latch()) == (0, 2)
