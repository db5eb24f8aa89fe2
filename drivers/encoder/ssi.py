"""SSI words of a Zettlex (Celera) IncOder angle encoder in its protocols 1, 2, 4, 6 and 9.

Every word of the right width decodes; `is_trusted` tests whether the position is usable. A
resolution below the width of the field is right-aligned, so the position counts 0 to
counts_per_turn - 1 in every protocol. SSI7 and SSI8 are left out: their layouts are not confirmed.
Source: IncOder Product Guide MIDI ULTRA Rev 4.11.8, 5.4.2 (from public implementations of it).
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.checksums import ssi6_crc8
from drivers.errors import CodecError

NOT_CARRIED = -1
STAMP_STEPS = 2048  # of the time stamps of SSI4 and SSI9
_PD22, _PD19 = (1 << 22) - 1, (1 << 19) - 1


class SsiProtocol(IntEnum):
    """SSI protocols; the value is the number in the protocol's name."""

    SSI1 = 1  # 24 bits: PV, ZPD, PD[21:0]
    SSI2 = 2  # 24 bits: PD[21:0], parity, alarm
    SSI4 = 4  # 32 bits: PV, ZPD, PD[18:0], TS[10:0] in steps of 10 us
    SSI6 = 6  # 32 bits: CRC[7:0], PV, ZPD, PD[21:0]
    SSI9 = 9  # 32 bits: as SSI4, TS in steps of 1 us


WORD_BITS = {
    SsiProtocol.SSI1: 24,
    SsiProtocol.SSI2: 24,
    SsiProtocol.SSI4: 32,
    SsiProtocol.SSI6: 32,
    SsiProtocol.SSI9: 32,
}
STAMP_STEP_US = {SsiProtocol.SSI4: 10, SsiProtocol.SSI9: 1}


class SsiReading(NamedTuple):
    """Fields of one word. A field that the protocol does not carry is NOT_CARRIED (-1)."""

    position: int  # counts, single turn
    valid: int  # 1: the encoder flags the position as valid (PV, or no alarm)
    factory_zero: int  # 1: the zero point is the factory's (ZPD)
    stamp: int  # time stamp of the position, in steps of the encoder's clock, 0 to 2047
    intact: int  # 1: parity or CRC is right, 0: it is wrong


def decode(protocol: SsiProtocol, word: int) -> SsiReading:
    """Return the fields of a word, first bit on the wire highest; CodecError if it is too wide."""
    if not 0 <= word < 1 << WORD_BITS[protocol]:
        raise CodecError(protocol.name, "word", f"{WORD_BITS[protocol]} bits", f"{word:#x}")
    if protocol is SsiProtocol.SSI2:
        position = word >> 2
        intact = 1 if _parity(position) == word >> 1 & 1 else 0
        return SsiReading(position, 1 - (word & 1), NOT_CARRIED, NOT_CARRIED, intact)
    if protocol in STAMP_STEP_US:
        position = word >> 11 & _PD19
        return SsiReading(position, word >> 31, word >> 30 & 1, word & STAMP_STEPS - 1, NOT_CARRIED)
    intact = NOT_CARRIED
    if protocol is SsiProtocol.SSI6:
        intact = 1 if ssi6_crc8(word & 0xFFFFFF) == word >> 24 else 0
    return SsiReading(word & _PD22, word >> 23 & 1, word >> 22 & 1, NOT_CARRIED, intact)


def encode(protocol: SsiProtocol, reading: SsiReading) -> int:
    """Return the word of a reading with its parity or CRC, inverted if ``intact`` is 0.

    CodecError for a field out of range.
    """
    max_position = _PD19 if protocol in STAMP_STEP_US else _PD22
    _check_range(protocol, "position", reading.position, max_position)
    _check_range(protocol, "valid", reading.valid, 1)
    if protocol is SsiProtocol.SSI2:
        parity = _parity(reading.position) ^ (reading.intact == 0)
        return reading.position << 2 | parity << 1 | (1 - reading.valid)
    _check_range(protocol, "factory_zero", reading.factory_zero, 1)
    flags = reading.valid << 1 | reading.factory_zero
    if protocol in STAMP_STEP_US:
        _check_range(protocol, "stamp", reading.stamp, STAMP_STEPS - 1)
        return flags << 30 | reading.position << 11 | reading.stamp
    word = flags << 22 | reading.position
    if protocol is SsiProtocol.SSI6:
        return (ssi6_crc8(word) ^ (0xFF if reading.intact == 0 else 0)) << 24 | word
    return word


def is_trusted(reading: SsiReading) -> bool:
    """Return True when the encoder flags the position as valid and parity or CRC is not wrong."""
    return reading.valid == 1 and reading.intact != 0


def stamp_gap_us(protocol: SsiProtocol, earlier: int, later: int) -> int:
    """Return the time (us) between two stamps, exact to a step if less than one wrap has passed.

    One wrap is 20.48 ms (SSI4) or 2.048 ms (SSI9). CodecError for a protocol without stamps.
    """
    step = STAMP_STEP_US.get(protocol)
    if step is None:
        raise CodecError(protocol.name, "time stamp", "SSI4 or SSI9", "a protocol without one")
    return (later - earlier) % STAMP_STEPS * step


def _parity(position: int) -> int:
    """Return 1 for an odd number of ones among the position bits; flags do not count."""
    return position.bit_count() & 1


def _check_range(protocol: SsiProtocol, where: str, value: int, highest: int) -> None:
    if not 0 <= value <= highest:
        raise CodecError(protocol.name, where, f"0 to {highest}", value)
