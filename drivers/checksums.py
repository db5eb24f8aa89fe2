"""The check sums of the wires. Each differs from its neighbours in a way that bites: see there."""

import binascii

_MODBUS = 0xA001  # 0x8005 with its bits reversed


def crc16(data: bytes, start: int = 0xFFFF) -> int:
    """CRC-16 with polynomial 0x1021, most significant bit first, no final exclusive or.

    With ``start`` 0xFFFF this is the sum called CRC-16/IBM-3740 (CCITT-FALSE; check value of
    "123456789": 0x29B1). Over data followed by its own sum, high byte first, it gives 0.
    """
    return binascii.crc_hqx(data, start)


def compax3_crc16(data: bytes) -> int:
    """The sum of a Compax3 record: the remainder of the data itself modulo 0x1021.

    The manual's loop shifts each byte in at the low end and never appends 16 zero bits, so this is
    not XMODEM, and data followed by its sum does not give 0: compare, do not look for a residue.
    Source: Compax3 manuals 192-1201xx, binary record, checksum calculation.
    """
    # x^16 A mod P is what crc_hqx gives; the last two bytes stand where no shift is left to do.
    return binascii.crc_hqx(data[:-2], 0) ^ int.from_bytes(data[-2:], "big")


def modbus_crc16(data: bytes) -> int:
    """CRC-16 of Modbus RTU (reflected 0x8005, start 0xFFFF); sent low byte first.

    Bit by bit: it is needed for a few commands at start and stop, never for a stream.
    """
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ _MODBUS if crc & 1 else crc >> 1
    return crc


def ssi6_crc8(low24: int) -> int:
    """CRC-8 of the low 24 bits of an SSI6 word (polynomial 0x97, start 0, no final exclusive or).

    Source: IncOder Product Guide MIDI ULTRA Rev 4.11.8, 5.4.2, in two public readings that agree;
    no vector of the maker was at hand, so hold it against a real encoder before trusting it.
    """
    crc = 0
    for shift in (16, 8, 0):
        crc ^= low24 >> shift & 0xFF
        for _ in range(8):
            crc = (crc << 1 ^ 0x97) & 0xFF if crc & 0x80 else crc << 1
    return crc
