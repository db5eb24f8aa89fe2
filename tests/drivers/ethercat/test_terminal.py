"""Values of terminals at their places in an image, against images packed by hand."""

from __future__ import annotations

import math
import struct

import pytest

from drivers.errors import CodecError
from drivers.ethercat.process_image import Area
from drivers.ethercat.terminal import Place, TerminalEntry, places, reader, writer


def test_values_lie_one_behind_the_other() -> None:
    entries = (
        TerminalEntry("status", "u16"),
        TerminalEntry("", "u16"),
        TerminalEntry("samples", "i32", 3),
        TerminalEntry("power", "f32"),
    )
    image = bytearray(5) + struct.pack("<HH3if", 0x41, 0xFFFF, -6, 0, 9, 2.5)
    found = places(entries, Area(40, 8 * 20))
    values = {name: reader(place)(memoryview(image)) for name, place in found.items()}
    assert values == {"status": 0x41, "samples": 1.0, "power": 2.5}


def test_bits_may_begin_within_a_byte() -> None:
    entries = [TerminalEntry(f"channel_{n}", "bit") for n in (1, 2, 3, 4)]
    found = places(entries, Area(12, 4))
    image = memoryview(bytearray((0xFF, 0x5F)))  # the upper half of the second byte: 0101
    assert [reader(found[f"channel_{n}"])(image) for n in (1, 2, 3, 4)] == [1, 0, 1, 0]
    writer(found["channel_2"])(image, 1.0)
    writer(found["channel_3"])(image, 0.0)
    assert bytes(image) == bytes((0xFF, 0x3F))


@pytest.mark.parametrize(
    ("area", "what"),
    [(Area(0, 24), "expected 16, got 24"), (Area(0, 8), "expected 16, got 8"), (None, "got 0")],
)
def test_another_mapping_than_the_described_one_is_refused(area: Area | None, what: str) -> None:
    with pytest.raises(CodecError, match=what):
        places((TerminalEntry("value", "u16"),), area)


def test_a_number_within_a_byte_is_refused() -> None:
    entries = (TerminalEntry("bit", "bit"), TerminalEntry("value", "u8"))
    with pytest.raises(CodecError, match="a whole byte"):
        places(entries, Area(0, 9))


@pytest.mark.parametrize(
    ("kind", "value", "data"),
    [
        ("i16", 1e9, struct.pack("<h", 32767)),
        ("i16", -1e9, struct.pack("<h", -32768)),
        ("u8", -3.0, b"\0"),
        ("u16", 2.6, struct.pack("<H", 3)),
        ("f32", 0.5, struct.pack("<f", 0.5)),
        ("f32", 1e300, struct.pack("<f", 3.4028234663852886e38)),
        ("f64", -math.inf, struct.pack("<d", -1.7976931348623157e308)),
        ("i32", math.inf, struct.pack("<i", 2**31 - 1)),
        ("u64", 1e30, struct.pack("<Q", 2**64 - 1)),
        ("i16", math.nan, b"\0\0"),
        ("f32", math.nan, bytes(4)),
    ],
)
def test_outputs_are_rounded_and_stay_in_range(kind: str, value: float, data: bytes) -> None:
    image = bytearray(10)
    writer(Place(16, kind))(memoryview(image), value)
    assert bytes(image[2 : 2 + len(data)]) == data


def test_several_of_one_type_are_written_alike_and_read_as_their_mean() -> None:
    image = memoryview(bytearray(8))
    writer(Place(8, "i16", 3))(image, -2.0)
    assert bytes(image) == b"\0" + struct.pack("<3h", -2, -2, -2) + b"\0"
    assert reader(Place(8, "i16", 3))(image) == -2.0
    writer(Place(4, "bit", 3))(image, 1.0)
    assert image[0] == 0b0111_0000
    assert reader(Place(3, "bit", 4))(image) == 0.75
    writer(Place(5, "bit", 1))(image, 0.0)
    assert image[0] == 0b0101_0000
