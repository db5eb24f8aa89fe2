"""The project's own bridge frame: as documented, through noise, and in any pieces."""

from __future__ import annotations

import binascii
import contextlib
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from stream_pieces import drain, pieces

from drivers.encoder.bridge import (
    LATE,
    MOTOR_SILENT,
    RESTARTED,
    SHAFT_SILENT,
    SIZE,
    Frame,
    State,
    decode,
    encode,
    feed,
    start,
)
from drivers.encoder.ssi import WORD_BITS, SsiProtocol
from drivers.errors import CodecError

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "reference" / "wires.md").read_text()
EXAMPLE = bytes.fromhex(re.findall(r"^EB 90 .*$", PAGE, re.MULTILINE)[0])
GOLDEN = Frame(258, 0, 1_000_000, SsiProtocol.SSI4, 0xED2D2923, SsiProtocol.SSI1, 0x00C12345)

protocols = st.sampled_from(list(SsiProtocol))


@st.composite
def frames(draw: st.DrawFn, sequence: int | None = None) -> Frame:
    motor, shaft = draw(protocols), draw(protocols)
    return Frame(
        draw(st.integers(0, 65535)) if sequence is None else sequence % 65536,
        draw(st.integers(0, 7 if sequence is not None else 15)),
        draw(st.integers(0, 2**64 - 1)),
        motor,
        draw(st.integers(0, (1 << WORD_BITS[motor]) - 1)),
        shaft,
        draw(st.integers(0, (1 << WORD_BITS[shaft]) - 1)),
    )


trains = st.tuples(st.integers(0, 65535), st.integers(1, 6)).flatmap(
    lambda drawn: st.tuples(*(frames(drawn[0] + n) for n in range(drawn[1])))
)


def sealed(body: bytes) -> bytes:
    """A frame with any content and a check sum that is right."""
    return b"\xeb\x90" + body + binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "big")


def test_the_example_of_the_page() -> None:
    assert encode(GOLDEN) == EXAMPLE
    assert decode(EXAMPLE) == GOLDEN


@given(frames())
def test_the_table_of_the_page_lays_out_the_same_bytes(frame: Frame) -> None:
    rows = re.findall(r"^\| (\d+) \| (\d+) \| (\w+) \|", PAGE, re.MULTILINE)
    values = {
        "sync": 0xEB90,
        "version": 1,
        "status": frame.status,
        "sequence": frame.sequence,
        "time": frame.time_us,
        "motor_protocol": frame.motor_protocol,
        "shaft_protocol": frame.shaft_protocol,
        "motor_word": frame.motor_word,
        "shaft_word": frame.shaft_word,
    }
    laid = bytearray()
    for offset, size, name in rows[:-1]:
        assert int(offset) == len(laid)
        laid += values.pop(name).to_bytes(int(size), "big")
    assert not values
    assert rows[-1] == ("24", "2", "crc")
    assert sealed(bytes(laid[2:])) == encode(frame)


@given(frames())
def test_round_trip(frame: Frame) -> None:
    assert decode(encode(frame)) == frame
    assert len(encode(frame)) == SIZE


@given(st.binary(max_size=40) | st.binary(min_size=22, max_size=22).map(sealed))
def test_any_bytes_decode_or_are_refused(data: bytes) -> None:
    with contextlib.suppress(CodecError):
        assert encode(decode(data)) == data


@pytest.mark.parametrize(
    ("at", "byte", "where"),
    [
        (2, 2, "version"),
        (3, 0x10, "status"),
        (14, 3, "motor protocol"),
        (15, 0, "shaft protocol"),
        (20, 1, "shaft word"),  # 24 bits in SSI1
    ],
)
def test_invalid_content_is_refused_by_name(at: int, byte: int, where: str) -> None:
    body = bytearray(EXAMPLE[2:-2])
    body[at - 2] = byte
    with pytest.raises(CodecError, match=where):
        decode(sealed(bytes(body)))


@given(frames(), st.sets(st.integers(0, 8 * SIZE - 1), min_size=1, max_size=3))
def test_up_to_three_flipped_bits_are_seen(frame: Frame, bits: set[int]) -> None:
    sent = bytearray(encode(frame))
    for bit in bits:
        sent[bit // 8] ^= 1 << bit % 8
    with pytest.raises(CodecError):
        decode(bytes(sent))


@pytest.mark.parametrize(
    "bad",
    [
        GOLDEN._replace(sequence=65536),
        GOLDEN._replace(status=16),
        GOLDEN._replace(time_us=-1),
        GOLDEN._replace(shaft_word=1 << 24),
    ],
)
def test_a_field_that_does_not_fit_is_not_encoded(bad: Frame) -> None:
    with pytest.raises(CodecError):
        encode(bad)


@given(trains, st.lists(st.integers(0, 1000), max_size=8))
def test_frames_come_out_however_they_are_split(sent: tuple[Frame, ...], cuts: list[int]) -> None:
    data = b"".join(map(encode, sent))
    state, got = drain(feed, start(), pieces(data, cuts))
    assert got == list(sent)
    assert state == State(b"", sent[-1].sequence, 0, 0, 0, 0, 0)


noise = st.lists(st.sampled_from([b"\xeb", b"\x90", b"\xeb\x90", b"\x00", b"\x55\xaa"])).map(
    b"".join
)


@given(noise | st.binary(max_size=60), trains, noise, st.lists(st.integers(0, 1000), max_size=8))
def test_noise_loses_no_later_frame(
    before: bytes, sent: tuple[Frame, ...], between: bytes, cuts: list[int]
) -> None:
    data = before + between.join(map(encode, sent)) + bytes(SIZE)
    state, got = drain(feed, start(), pieces(data, cuts))
    assert got == list(sent)
    lost = len(before) + len(between) * (len(sent) - 1) + SIZE
    assert state.dropped + len(state.pending) == lost


@given(st.binary(max_size=200) | noise, st.lists(st.integers(0, 1000), max_size=10))
def test_splits_have_no_effect_on_any_bytes(data: bytes, cuts: list[int]) -> None:
    assert drain(feed, start(), pieces(data, cuts)) == drain(feed, start(), [data])


def numbered(*numbers: int) -> bytes:
    return b"".join(encode(GOLDEN._replace(sequence=number)) for number in numbers)


def test_missing_frames_are_counted_over_the_wrap() -> None:
    state, got = feed(start(), numbered(65532, 65534, 1, 2))
    assert [frame.sequence for frame in got] == [65532, 65534, 1, 2]
    assert (state.missing, state.backward) == (3, 0)


def test_up_to_half_the_numbers_may_be_missing() -> None:
    assert feed(start(), numbered(5, 5 + 32767))[0].missing == 32766
    state = feed(start(), numbered(5, 5 + 32768))[0]
    assert (state.missing, state.backward) == (0, 1)


def test_the_status_bits_are_those_of_the_page() -> None:
    bits = {MOTOR_SILENT: "motor", SHAFT_SILENT: "shaft", LATE: "skipped", RESTARTED: "started"}
    rows = dict(re.findall(r"^\| ([0-3]) \| (.*) \|$", PAGE, re.MULTILINE))
    assert len(bits) == len(rows) == 4
    for bit, word in bits.items():
        assert word in rows[str(bit.bit_length() - 1)]
        assert bit.bit_count() == 1


def test_a_repeated_frame_is_not_given_out() -> None:
    state, got = feed(start(), numbered(7, 7, 8))
    assert [frame.sequence for frame in got] == [7, 8]
    assert (state.repeated, state.missing) == (1, 0)


def test_a_bridge_that_restarted() -> None:
    fresh = encode(GOLDEN._replace(sequence=0, status=RESTARTED))
    state, got = feed(start(), numbered(500) + fresh + numbered(1))
    assert len(got) == 3
    assert (state.missing, state.backward) == (0, 0)
    state, got = feed(start(), numbered(500, 3, 4))
    assert len(got) == 3
    assert (state.missing, state.backward) == (0, 1)


def test_a_corrupt_frame_is_missing_and_bad() -> None:
    data = bytearray(numbered(1, 2, 3))
    data[SIZE + 10] ^= 1
    state, got = feed(start(), bytes(data))
    assert [frame.sequence for frame in got] == [1, 3]
    assert (state.missing, state.bad_frames, state.dropped) == (1, 1, SIZE)


def test_pending_bytes_are_bounded() -> None:
    state = start()
    for _ in range(100):
        state, _ = feed(state, b"\xeb\x90\x01" * 50)
        assert len(state.pending) < SIZE
