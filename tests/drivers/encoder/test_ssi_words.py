"""SSI words: golden, total, and with every fault seen that a word can show."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.encoder.ssi import (
    NOT_CARRIED,
    WORD_BITS,
    SsiProtocol,
    SsiReading,
    decode,
    encode,
    is_trusted,
    stamp_gap_us,
)
from drivers.errors import CodecError

words = st.sampled_from(list(SsiProtocol)).flatmap(
    lambda protocol: st.tuples(st.just(protocol), st.integers(0, (1 << WORD_BITS[protocol]) - 1))
)
N = NOT_CARRIED


@pytest.mark.parametrize(
    ("protocol", "word", "reading"),
    [
        (SsiProtocol.SSI1, 0xC12345, SsiReading(0x12345, 1, 1, N, N)),
        (SsiProtocol.SSI1, 0x3FFFFF, SsiReading(0x3FFFFF, 0, 0, N, N)),
        (SsiProtocol.SSI1, 0x400000, SsiReading(0, 0, 1, N, N)),
        (SsiProtocol.SSI1, 0, SsiReading(0, 0, 0, N, N)),  # a dead line held low
        (SsiProtocol.SSI2, 0x0AAAAA, SsiReading(0x2AAAA, 1, N, N, 1)),  # nine ones: parity 1
        (SsiProtocol.SSI2, 0x0AAAA8, SsiReading(0x2AAAA, 1, N, N, 0)),
        (SsiProtocol.SSI2, 0x00000D, SsiReading(3, 0, N, N, 1)),  # two ones, alarm
        (SsiProtocol.SSI4, 0xED2D2923, SsiReading(0x5A5A5, 1, 1, 0x123, N)),
        (SsiProtocol.SSI4, 0x400007FF, SsiReading(0, 0, 1, 2047, N)),
        (SsiProtocol.SSI9, 0xBFFFF800, SsiReading(0x7FFFF, 1, 0, 0, N)),
        (SsiProtocol.SSI6, 0x60800001, SsiReading(1, 1, 0, N, 1)),
        (SsiProtocol.SSI6, 0x47C00000, SsiReading(0, 1, 1, N, 1)),
        (SsiProtocol.SSI6, 0x47C00001, SsiReading(1, 1, 1, N, 0)),
    ],
)
def test_golden_words(protocol: SsiProtocol, word: int, reading: SsiReading) -> None:
    assert decode(protocol, word) == reading
    if reading.intact != 0:
        assert encode(protocol, reading) == word


def test_a_protocol_has_the_number_in_its_name() -> None:
    assert {protocol.name: f"SSI{int(protocol)}" for protocol in SsiProtocol} == {
        protocol.name: protocol.name for protocol in SsiProtocol
    }


@given(words)
def test_every_word_decodes_and_goes_back(pair: tuple[SsiProtocol, int]) -> None:
    protocol, word = pair
    reading = decode(protocol, word)
    assert decode(protocol, encode(protocol, reading)) == reading
    if reading.intact != 0:
        assert encode(protocol, reading) == word


@given(words)
def test_a_word_is_trusted_when_valid_and_intact(pair: tuple[SsiProtocol, int]) -> None:
    reading = decode(*pair)
    assert is_trusted(reading) == (reading.valid == 1 and reading.intact in (1, NOT_CARRIED))


@given(st.integers(0, (1 << 22) - 1), st.integers(0, 22))
def test_parity_detects_a_flipped_bit(position: int, bit: int) -> None:
    word = encode(SsiProtocol.SSI2, SsiReading(position, 1, N, N, 1))
    assert not is_trusted(decode(SsiProtocol.SSI2, word ^ 1 << bit + 1))


@given(st.integers(0, (1 << 22) - 1), st.integers(0, 31))
def test_the_crc_detects_a_flipped_bit(position: int, bit: int) -> None:
    word = encode(SsiProtocol.SSI6, SsiReading(position, 1, 1, N, 1))
    assert not is_trusted(decode(SsiProtocol.SSI6, word ^ 1 << bit))


@given(st.sampled_from(list(SsiProtocol)), st.integers())
def test_a_word_too_wide_is_refused_and_no_other(protocol: SsiProtocol, word: int) -> None:
    if 0 <= word < 1 << WORD_BITS[protocol]:
        decode(protocol, word)
    else:
        with pytest.raises(CodecError, match=protocol.name):
            decode(protocol, word)


@pytest.mark.parametrize(
    ("protocol", "reading"),
    [
        (SsiProtocol.SSI1, SsiReading(1 << 22, 1, 1, N, N)),
        (SsiProtocol.SSI1, SsiReading(-1, 1, 1, N, N)),
        (SsiProtocol.SSI1, SsiReading(0, 2, 1, N, N)),
        (SsiProtocol.SSI4, SsiReading(1 << 19, 1, 1, 0, N)),
        (SsiProtocol.SSI4, SsiReading(0, 1, 1, 2048, N)),
        (SsiProtocol.SSI4, SsiReading(0, 1, N, 0, N)),
        (SsiProtocol.SSI6, SsiReading(0, 1, N, N, 1)),
    ],
)
def test_a_field_out_of_range_is_not_encoded(protocol: SsiProtocol, reading: SsiReading) -> None:
    with pytest.raises(CodecError):
        encode(protocol, reading)


def test_stamps_count_in_their_steps_and_wrap() -> None:
    assert stamp_gap_us(SsiProtocol.SSI4, 100, 200) == 1000
    assert stamp_gap_us(SsiProtocol.SSI4, 2047, 0) == 10
    assert stamp_gap_us(SsiProtocol.SSI9, 2000, 48) == 96
    assert stamp_gap_us(SsiProtocol.SSI4, 5, 5) == 0  # the encoder did not measure anew
    with pytest.raises(CodecError, match="time stamp"):
        stamp_gap_us(SsiProtocol.SSI1, 0, 1)


@given(st.integers(0, 10**9), st.integers(0, 2047))
def test_a_gap_below_one_wrap_is_exact(begin: int, steps: int) -> None:
    assert stamp_gap_us(SsiProtocol.SSI4, begin % 2048, (begin + steps) % 2048) == 10 * steps
