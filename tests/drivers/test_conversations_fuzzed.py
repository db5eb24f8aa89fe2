"""Well-formed invalid data: a conversation never raises and always reports finite numbers."""

from __future__ import annotations

import math
import struct

from device_peers import BridgePeer, Compax3Peer, DigitalFtPeer, ccitt, modbus
from faulty_port import STEP, FaultyPort
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples
from stream_subjects import BRIDGE, DIGITAL, NET, SERVO

from drivers.compax3.servo import Servo
from drivers.conversation import Exchange
from drivers.encoder.bridge_reader import BridgeReader
from drivers.force_torque.digital_reader import DigitalReader
from drivers.force_torque.load import Phase
from drivers.force_torque.net_reader import NetReader

RECORDS = st.tuples(st.sampled_from((0x05, 0x06, 0x07)), st.binary(min_size=1, max_size=20))
REPLIES = st.one_of(
    st.none(), st.sampled_from([b">\r", b"!0609\r", b"Compax3\r", b"-12.5\r"]), RECORDS
)


@settings(max_examples=12)
@given(st.lists(REPLIES, max_size=60), st.integers(0, 1))
def test_a_servo_survives_any_answers(
    replies: list[bytes | tuple[int, bytes] | None], up: int
) -> None:
    class Mad(Compax3Peer):
        def receive(self, data: bytes, now: float) -> list[bytes]:
            answers = super().receive(data, now)
            if now < 0.2 or not replies:
                return answers
            reply = replies.pop()
            if reply is None:
                return answers
            if isinstance(reply, bytes):
                return [reply]
            body = bytes((reply[0], len(reply[1]) - 1)) + reply[1]
            return [body + ccitt(body, 0, augmented=False).to_bytes(2, "big")]

    drive, servo = Mad(), Servo(SERVO)
    port = FaultyPort(drive)
    exchange = Exchange(port, servo)
    for n in range(700):
        port.step()
        servo.command(1.0, up if n > 150 else 0, port.time)
        exchange.step()
        reading = servo.read(port.time)
        assert all(math.isfinite(value) for value in reading.values)
        assert isinstance(servo.explain(port.time), str)
        if not up:
            assert reading.acting == 0
    if not up:
        assert not any(index == 1100 and word for index, _, word in drive.writes)


@settings(max_examples=examples(30))
@given(
    st.lists(
        st.tuples(
            st.integers(0, 15), st.integers(0, 0xFFFF), st.integers(0, 2**64 - 1),
            st.sampled_from([(1, 24), (2, 24), (4, 32), (6, 32), (9, 32)]),
            st.integers(0, 2**32 - 1),
            st.floats(0.0, 1.0),
        ),
        max_size=30,
    )
)  # fmt: skip
def test_a_bridge_reader_survives_any_frames(
    frames: list[tuple[int, int, int, tuple[int, int], int, float]],
) -> None:
    reader, now = BridgeReader(BRIDGE), 0.0
    reader.on_open(now)
    for status, number, time_us, (protocol, bits), word, gap in frames:
        now += gap
        cut = word >> (32 - bits)
        body = struct.pack(">BBHQBBII", 1, status, number, time_us, protocol, 1, cut, word >> 8)
        frame = b"\xeb\x90" + body + ccitt(body, 0xFFFF, augmented=True).to_bytes(2, "big")
        reader.receive(frame, now)
        for one in reader.read(now):
            assert math.isfinite(one.angle)
            assert one.age >= -1e-5
        assert isinstance(reader.explain(now), str)
    assert BridgePeer().frame(0.0)[:2] == b"\xeb\x90"


@settings(max_examples=examples(30))
@given(st.binary(min_size=338, max_size=338), st.lists(st.binary(max_size=60), max_size=20))
def test_a_digital_reader_survives_any_calibration(block: bytes, stream: list[bytes]) -> None:
    class Mad(DigitalFtPeer):
        def block(self) -> bytes:
            return block

    reader = DigitalReader(DIGITAL)
    port = FaultyPort(Mad())
    exchange = Exchange(port, reader)
    for n in range(400):
        port.step()
        exchange.step()
        if n > 200 and stream:
            reader.receive(stream.pop(), port.time)
        assert all(math.isfinite(value) for value in reader.read(port.time).wrench)
    assert reader.read(port.time).phase is not Phase.STREAMING
    assert reader.explain(port.time)


@settings(max_examples=examples(30))
@given(st.lists(st.tuples(st.binary(max_size=80), st.floats(0.0, 0.05)), max_size=40))
def test_a_net_reader_survives_any_datagrams(datagrams: list[tuple[bytes, float]]) -> None:
    reader, now = NetReader(NET), 0.0
    reader.on_open(now)
    for data, gap in datagrams:
        now += gap + STEP
        reader.receive(data[: len(data) // 36 * 36] if len(data) >= 36 else data, now)
        reader.next_message(now)
        reading = reader.read(now)
        assert all(math.isfinite(value) for value in reading.wrench)
        assert reading.age >= -1e-9
        assert isinstance(reader.explain(now), str)


@settings(max_examples=examples(30))
@given(st.lists(st.binary(max_size=300), max_size=20))
def test_a_digital_reader_survives_any_answers(answers: list[bytes]) -> None:
    class Mad(DigitalFtPeer):
        def receive(self, data: bytes, now: float) -> list[bytes]:
            answers = super().receive(data, now)
            if not answers:
                return answers
            answer = answers.pop()
            return [modbus(answer) if len(answer) % 2 else answer]

    reader = DigitalReader(DIGITAL)
    port = FaultyPort(Mad())
    exchange = Exchange(port, reader)
    while port.time < 0.5:
        port.step()
        exchange.step()
        assert isinstance(reader.explain(port.time), str)
