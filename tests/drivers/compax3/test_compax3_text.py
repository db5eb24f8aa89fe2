"""Compax3 ASCII lines: requests by golden bytes, replies of every kind, any line at all."""

from __future__ import annotations

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.compax3.codec import Object
from drivers.compax3.text import (
    IDENTIFY,
    Reply,
    ReplyKind,
    decode_line,
    encode_line,
    encode_read_line,
    encode_write_line,
)
from drivers.errors import CodecError


def test_requests() -> None:
    assert encode_line(IDENTIFY) == b"_?\r"
    assert encode_read_line(Object(680, 5)) == b"o680.5\r"
    assert encode_read_line(Object(680, 5), address=3) == b"3o680.5\r"
    assert encode_read_line(Object(192, 2), separator=",") == b"o192,2\r"  # manuals of 2004
    assert encode_write_line(Object(1901, 1), 12.5) == b"o1901.1=12.5\r"
    assert encode_write_line(Object(1100, 3), 16387.0, address=12) == b"12o1100.3=16387\r"


@pytest.mark.parametrize(
    ("value", "digits"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (-1e-12, "0"),
        (100.0, "100"),
        (-180.0, "-180"),
        (2.0**-24, "0.00000006"),
        (1e6, "1000000"),
        (1e-5, "0.00001"),
    ],
)
def test_a_number_is_written_without_exponent(value: float, digits: str) -> None:
    line = encode_write_line(Object(1, 1), value)
    assert line.startswith(b"o1.1=" + digits.encode())
    assert b"e" not in line


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 2.0**47, -1e30])
def test_unrepresentable_values_are_not_written(value: float) -> None:
    with pytest.raises(CodecError, match="value"):
        encode_write_line(Object(1, 1), value)


@pytest.mark.parametrize(("command", "address"), [("", -1), ("a\rb", -1), ("ä", -1), ("o1.1", 100)])
def test_invalid_commands_are_refused(command: str, address: int) -> None:
    with pytest.raises(CodecError, match="Compax3 line"):
        encode_line(command, address)


@pytest.mark.parametrize(
    ("line", "reply"),
    [
        (b">", Reply(ReplyKind.ACCEPTED, 0, 0.0, ">", 0)),
        (b"*>", Reply(ReplyKind.ACCEPTED, 0, 0.0, ">", 1)),
        (b"!7320", Reply(ReplyKind.REFUSED, 0x7320, 0.0, "!7320", 0)),
        (b"*!00ff", Reply(ReplyKind.REFUSED, 0xFF, 0.0, "!00ff", 1)),
        (b"12.5", Reply(ReplyKind.VALUE, 0, 12.5, "12.5", 0)),
        (b"*-0.0000278", Reply(ReplyKind.VALUE, 0, -0.0000278, "-0.0000278", 1)),
        (b" 17168 ", Reply(ReplyKind.VALUE, 0, 17168.0, "17168", 0)),
        (b"$C8", Reply(ReplyKind.VALUE, 0, 200.0, "$C8", 0)),
        (b"Compax3S063V2F10I10T10", Reply(ReplyKind.TEXT, 0, 0.0, "Compax3S063V2F10I10T10", 0)),
    ],
)
def test_replies(line: bytes, reply: Reply) -> None:
    assert decode_line(line) == reply


@pytest.mark.parametrize("line", [b"", b"*", b"* ", b"!12", b"!12345", b"!12G4", b">>", b"1\x802"])
def test_invalid_replies_are_refused(line: bytes) -> None:
    with pytest.raises(CodecError, match="Compax3 line"):
        decode_line(line)


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e5", "0x10", "1_000", "1,5", "--1"])
def test_what_only_python_takes_for_a_number_is_text(text: str) -> None:
    assert decode_line(text.encode()).kind is ReplyKind.TEXT


def test_a_number_too_large_for_a_float_is_refused() -> None:
    with pytest.raises(CodecError, match="finite"):
        decode_line(b"9" * 400)


@given(st.binary(max_size=150) | st.text("*>!$+-.0123456789abcdefE ").map(str.encode))
def test_any_line_decodes_or_is_refused(line: bytes) -> None:
    with contextlib.suppress(CodecError):
        reply = decode_line(line)
        assert math.isfinite(reply.value)
        decoded = decode_line(b"*" * reply.starred + reply.text.encode())
        assert decoded == reply


@given(st.floats(-(2.0**40), 2.0**40))
def test_a_value_written_reads_the_same(value: float) -> None:
    digits = encode_write_line(Object(1, 1), value)[5:-1]
    assert abs(decode_line(digits).value - value) <= 5.1e-10
