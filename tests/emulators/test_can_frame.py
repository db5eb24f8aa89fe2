"""Frames: bits on the wire and the socketcand text, against golden numbers and any text at all."""

from __future__ import annotations

import contextlib

import can
import pytest
from can.interfaces.socketcand.socketcand import (
    convert_ascii_message_to_can_message,
    convert_can_message_to_ascii_message,
)
from hypothesis import given
from hypothesis import strategies as st

from sim_plant.emulators import can_frame
from sim_plant.emulators.can_frame import Frame, FrameTextError


def test_bits_of_a_frame_with_worst_case_stuffing() -> None:
    assert [can_frame.frame_bits(n) for n in (0, 2, 4, 6, 8)] == [55, 75, 95, 115, 135]
    assert can_frame.frame_bits(0, extended=True) == 80
    assert can_frame.frame_bits(8, extended=True) == 160


def test_golden_text() -> None:
    assert can_frame.parse_send("send 185 2 37 2") == Frame(0x185, b"\x37\x02")
    assert can_frame.parse_send("send 080 0 ") == Frame(0x80, b"")
    assert can_frame.parse_send("send 00000085 1 ff") == Frame(0x85, b"\xff", True)
    assert can_frame.format_frame(Frame(0x185, b"\x37\x02"), 1.5) == b"< frame 185 1.500000 3702 >"
    assert can_frame.format_frame(Frame(0x80, b""), 0.0) == b"< frame 080 0.000000  >"


@pytest.mark.parametrize(
    "text",
    ["send", "send 800 0 ", "send 1 9 0", "send 85 2 1", "send 85 1 100", "send x 0", "send -1 0 "],
)
def test_invalid_send_text_is_refused(text: str) -> None:
    with pytest.raises(FrameTextError):
        can_frame.parse_send(text)


@given(st.text(st.characters(max_codepoint=255), max_size=40))
def test_any_text_is_a_frame_or_refused(text: str) -> None:
    with contextlib.suppress(FrameTextError):
        frame = can_frame.parse_send(f"send {text}")
        assert len(frame.data) <= 8


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.booleans())
def test_python_can_writes_and_reads_the_same_text(number: int, data: bytes, wide: bool) -> None:
    number = number if wide else number & 0x7FF
    message = can.Message(arbitration_id=number, data=data, is_extended_id=wide)
    text = convert_can_message_to_ascii_message(message)
    frame = can_frame.parse_send(text.strip("<> "))
    assert frame == Frame(number, data, wide)
    back = convert_ascii_message_to_can_message(can_frame.format_frame(frame, 2.25).decode())
    assert (back.arbitration_id, back.data, back.is_extended_id) == (number, data, wide)
    assert back.timestamp == 2.25
