"""Values in a process image: places, sizes, neighbours."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.process_data import CONTROLWORD, POSITION, STATUSWORD, Entry
from drivers.errors import CodecError
from drivers.ethercat.process_image import Area, Values, expected_wkc, read_bit, write_bit


@given(st.integers(0, 0xFFFF), st.integers(-(2**31), 2**31 - 1), st.integers(0, 20))
def test_values_lie_without_gaps_from_their_byte_on(word: int, position: int, byte: int) -> None:
    image = memoryview(bytearray(b"\xaa" * 32))
    values = Values((STATUSWORD, POSITION), Area(8 * byte, 48))
    values.write(image, word, position)
    assert values.read(image) == (word, position)
    assert image[byte : byte + 6] == struct.pack("<Hi", word, position)
    assert set(image[:byte]) | set(image[byte + 6 :]) == {0xAA}


def test_values_must_fill_their_area() -> None:
    for area in (Area(0, 32), Area(4, 48), Area(0, 0)):
        with pytest.raises(CodecError, match="48 from a whole byte"):
            Values((CONTROLWORD, POSITION), area)
    with pytest.raises(CodecError, match="expected u8, i8"):
        Values((Entry(0x2000, 0, "bool", "switch"),), Area(0, 8))


@given(st.binary(min_size=4, max_size=4), st.integers(0, 31), st.integers(0, 1))
def test_a_bit_leaves_its_neighbours(data: bytes, bit: int, value: int) -> None:
    image = memoryview(bytearray(data))
    write_bit(image, bit, value)
    assert read_bit(image, bit) == value
    before, after = (int.from_bytes(each, "little") for each in (data, bytes(image)))
    assert (before ^ after) & ~(1 << bit) == 0


def test_the_working_counter_counts_slaves_and_not_bytes() -> None:
    """Slaves of a few bits share a byte, and each of them counts."""
    one_bit_each = [(Area(place, 1), None) for place in range(4)]
    drive = (Area(8, 32), Area(40, 88))
    assert expected_wkc([*one_bit_each, drive, (None, Area(128, 16)), (None, None)]) == 8 + 3 + 1
