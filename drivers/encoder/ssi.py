"""Words of a Zettlex (Celera) IncOder angle encoder in its SSI protocols 1, 2, 4, 6 and 9.

Every word of the right width decodes; whether to trust it is `trusted`. A resolution lower than
the field is right-aligned, so the position counts 0 to counts_per_turn - 1 whatever the protocol.
SSI7 and SSI8 are left out: their layouts are not confirmed.
Source: IncOder Product Guide MIDI ULTRA Rev 4.11.8, 5.4.2 (in public readings of it).
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.checksums import ssi6_crc8
from drivers.errors import CodecError

NOT_CARRIED = -1
STAMP_STEPS = 2048  # of the time stamps of SSI4 and SSI9
_PD22, _PD19 = (1 << 22) - 1, (1 << 19) - 1


class Protocol(IntEnum):
    """The number in the protocol's name."""

    SSI1 = 1  # 24 bits: PV, ZPD, PD[21:0]
    SSI2 = 2  # 24 bits: PD[21:0], parity, alarm
    SSI4 = 4  # 32 bits: PV, ZPD, PD[18:0], TS[10:0] in steps of 10 us
    SSI6 = 6  # 32 bits: CRC[7:0], PV, ZPD, PD[21:0]
    SSI9 = 9  # 32 bits: as SSI4, TS in steps of 1 us


BITS = {
    Protocol.SSI1: 24,
    Protocol.SSI2: 24,
    Protocol.SSI4: 32,
    Protocol.SSI6: 32,
    Protocol.SSI9: 32,
}
STAMP_STEP_US = {Protocol.SSI4: 10, Protocol.SSI9: 1}


class Reading(NamedTuple):
    """One word taken apart. A field the protocol does not carry is NOT_CARRIED (-1)."""

    position: int  # counts, single turn
    valid: int  # 1: the encoder vouches for it (PV, or no alarm)
    factory_zero: int  # 1: the zero point is the maker's (ZPD)
    stamp: int  # step of the encoder's clock at which the position was taken, 0 to 2047
    intact: int  # 1: parity or CRC holds, 0: it does not


def decode(protocol: Protocol, word: int) -> Reading:
    """The fields of a word, first bit on the wire highest; CodecError only if it is too wide."""
    if not 0 <= word < 1 << BITS[protocol]:
        raise CodecError(protocol.name, "word", f"{BITS[protocol]} bits", f"{word:#x}")
    if protocol is Protocol.SSI2:
        position = word >> 2
        intact = 1 if _parity(position) == word >> 1 & 1 else 0
        return Reading(position, 1 - (word & 1), NOT_CARRIED, NOT_CARRIED, intact)
    if protocol in STAMP_STEP_US:
        position = word >> 11 & _PD19
        return Reading(position, word >> 31, word >> 30 & 1, word & STAMP_STEPS - 1, NOT_CARRIED)
    intact = NOT_CARRIED
    if protocol is Protocol.SSI6:
        intact = 1 if ssi6_crc8(word & 0xFFFFFF) == word >> 24 else 0
    return Reading(word & _PD22, word >> 23 & 1, word >> 22 & 1, NOT_CARRIED, intact)


def encode(protocol: Protocol, reading: Reading) -> int:
    """The word of a reading, with the parity or CRC that ``intact`` asks for.

    CodecError for a field out of range. A fault (``intact`` 0) inverts the parity or the CRC.
    """
    widest = _PD19 if protocol in STAMP_STEP_US else _PD22
    _within(protocol, "position", reading.position, widest)
    _within(protocol, "valid", reading.valid, 1)
    if protocol is Protocol.SSI2:
        parity = _parity(reading.position) ^ (reading.intact == 0)
        return reading.position << 2 | parity << 1 | (1 - reading.valid)
    _within(protocol, "factory_zero", reading.factory_zero, 1)
    flags = reading.valid << 1 | reading.factory_zero
    if protocol in STAMP_STEP_US:
        _within(protocol, "stamp", reading.stamp, STAMP_STEPS - 1)
        return flags << 30 | reading.position << 11 | reading.stamp
    word = flags << 22 | reading.position
    if protocol is Protocol.SSI6:
        return (ssi6_crc8(word) ^ (0xFF if reading.intact == 0 else 0)) << 24 | word
    return word


def trusted(reading: Reading) -> bool:
    """True when the encoder calls the position valid and no check sum speaks against it."""
    return reading.valid == 1 and reading.intact != 0


def stamp_gap_us(protocol: Protocol, earlier: int, later: int) -> int:
    """Time (us) from one stamp to a later one, exact to a step if less than one wrap has passed.

    One wrap is 20.48 ms (SSI4) or 2.048 ms (SSI9). CodecError for a protocol without stamps.
    """
    step = STAMP_STEP_US.get(protocol)
    if step is None:
        raise CodecError(protocol.name, "time stamp", "SSI4 or SSI9", "a protocol without one")
    return (later - earlier) % STAMP_STEPS * step


def _parity(position: int) -> int:
    """1 for an odd number of ones among the position bits; flags are not counted in."""
    return position.bit_count() & 1


def _within(protocol: Protocol, where: str, value: int, highest: int) -> None:
    if not 0 <= value <= highest:
        raise CodecError(protocol.name, where, f"0 to {highest}", value)
