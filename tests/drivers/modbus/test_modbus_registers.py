"""Registers to values and back, against pymodbus's own conversion and by hand."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.client import ModbusTcpClient

from drivers.errors import CodecError
from drivers.modbus.registers import (
    REGISTER_COUNT,
    RegisterBlock,
    RegisterMapError,
    RegisterValue,
    decode,
    encode,
    implausible_values,
    validated,
)

PEER = {
    "u16": ModbusTcpClient.DATATYPE.UINT16,
    "i16": ModbusTcpClient.DATATYPE.INT16,
    "u32": ModbusTcpClient.DATATYPE.UINT32,
    "i32": ModbusTcpClient.DATATYPE.INT32,
    "f32": ModbusTcpClient.DATATYPE.FLOAT32,
}
WORDS = st.lists(st.integers(0, 0xFFFF), min_size=2, max_size=2)


def one(kind: str, low: float = -1e39, high: float = 1e39, scale: float = 1.0) -> RegisterBlock:
    return validated(
        RegisterBlock(
            1, "holding", 0, REGISTER_COUNT[kind], (RegisterValue("x", 0, kind, scale, low, high),)
        )
    )


@given(st.sampled_from(sorted(PEER)), WORDS, st.booleans())
def test_every_kind_is_read_as_pymodbus_reads_it(
    kind: str, words: list[int], high_first: bool
) -> None:
    words = words[: REGISTER_COUNT[kind]]
    order: Any = "big" if high_first else "little"
    expected = ModbusTcpClient.convert_from_registers(words, PEER[kind], word_order=order)
    (decoded,) = decode(one(kind), words, high_first)
    assert decoded == expected or (math.isnan(decoded) and math.isnan(float(expected)))  # type: ignore[arg-type]


@given(st.sampled_from(sorted(PEER)), WORDS, st.booleans())
def test_what_was_read_is_written_back(kind: str, words: list[int], high_first: bool) -> None:
    words = words[: REGISTER_COUNT[kind]]
    block = one(kind)
    (value,) = decode(block, words, high_first)
    if math.isfinite(value):
        encoded = encode(block, [value], high_first)
        assert decode(block, encoded, high_first) == (value,)
        if kind != "f32":
            assert encoded == words


def test_the_strain_amplifiers_example() -> None:
    """DY094: int32 of two registers, float32 high word first; 12.5 is 0x41480000."""
    block = validated(
        RegisterBlock(
            1, "holding", 0, 4,
            (
                RegisterValue("raw", 0, "i32", 0.5, -1e9, 1e9),
                RegisterValue("force", 2, "f32", 1.0, -1e4, 1e4),
            ),
        )
    )  # fmt: skip
    assert decode(block, [0xFFFF, 0xFFFE, 0x4148, 0x0000], True) == (-1.0, 12.5)
    assert encode(block, [-1.0, 12.5], True) == [0xFFFF, 0xFFFE, 0x4148, 0x0000]
    assert decode(block, [0xFFFE, 0xFFFF, 0x0000, 0x4148], False) == (-1.0, 12.5)


def test_a_swapped_float_is_implausible() -> None:
    """A power between -2000 and 2000 W whose halves are swapped is mostly out of all range."""
    block = one("f32", -2000.0, 2000.0)
    caught = total = 0
    for watts in (-51.3, -3.07, 7.25, 230.5, 1499.0, -0.37, 50.02):
        high, low = struct.unpack(">HH", struct.pack(">f", watts))
        assert implausible_values(block, decode(block, [high, low], True)) == ()
        swapped = decode(block, [low, high], True)
        caught += bool(implausible_values(block, swapped)) or abs(swapped[0]) < 1e-30
        total += 1
    assert caught >= total - 2


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 3000.0, -3000.0])
def test_implausible_values_are_neither_accepted_nor_written(bad: float) -> None:
    block = one("f32", -2000.0, 2000.0)
    assert implausible_values(block, [bad]) == ("x",)
    with pytest.raises(CodecError, match="-2000 to 2000"):
        encode(block, [bad], True)


@given(st.lists(st.integers(-5, 0x1FFFF), max_size=4))
def test_nothing_but_a_codec_error_leaves_the_decoder(registers: list[int]) -> None:
    try:
        decode(one("u32"), registers, True)
    except CodecError:
        assert len(registers) != 2 or not all(0 <= r <= 0xFFFF for r in registers)


def test_a_partial_answer_is_rejected() -> None:
    with pytest.raises(CodecError, match="2 registers, got 1"):
        decode(one("f32"), [0x4148], True)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"table": "analog"}, "no table 'analog'"),
        ({"unit": 248}, "unit numbers are 0 to 247"),
        ({"size": 126}, "126 of them cannot be read at once"),
        ({"first": 65535}, "cannot be read at once"),
        ({"values": (RegisterValue("x", 1, "f32", 1.0, 0.0, 1.0),)}, "x lies outside the block"),
        ({"values": (RegisterValue("x", 0, "bit", 1.0, 0.0, 1.0),)}, "no 'bit' in holding"),
        ({"values": (RegisterValue("x", 0, "u16", 0.0, 0.0, 1.0),)}, "scale 0.0"),
        ({"values": (RegisterValue("x", 0, "u16", 1.0, 2.0, 1.0),)}, "2.0..1.0"),
    ],
)
def test_invalid_register_maps_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(RegisterMapError, match=message):
        validated(one("f32")._replace(**change))
