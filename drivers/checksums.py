"""Checksums of the wire protocols. They look alike and differ in detail: see each function."""

import binascii

_MODBUS = 0xA001  # 0x8005 with its bits reversed


def crc16(data: bytes, start: int = 0xFFFF) -> int:
    """Return the CRC-16 with polynomial 0x1021, most significant bit first, no final XOR.

    With ``start`` 0xFFFF this is CRC-16/IBM-3740 (CCITT-FALSE; check value of "123456789":
    0x29B1). The CRC of data followed by its own CRC, high byte first, is 0.
    """
    return binascii.crc_hqx(data, start)


def compax3_crc16(data: bytes) -> int:
    """Return the checksum of a Compax3 record: the remainder of the data modulo 0x1021.

    The manual's loop shifts each byte in at the low end and never appends 16 zero bits. So this
    is not XMODEM, and the checksum of data followed by its checksum is not 0: compare the two
    checksums, do not test for a residue.
    Source: Compax3 manuals 192-1201xx, binary record, checksum calculation.
    """
    # crc_hqx returns x^16 A mod P; the last two bytes need no further shift.
    return binascii.crc_hqx(data[:-2], 0) ^ int.from_bytes(data[-2:], "big")


def modbus_crc16(data: bytes) -> int:
    """Return the CRC-16 of Modbus RTU (reflected 0x8005, start 0xFFFF); sent low byte first.

    The loop works bit by bit: only a few commands at start and stop need it, never a stream.
    """
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ _MODBUS if crc & 1 else crc >> 1
    return crc


def ssi6_crc8(low24: int) -> int:
    """Return the CRC-8 of the low 24 bits of an SSI6 word (polynomial 0x97, start 0, no final XOR).

    Source: IncOder Product Guide MIDI ULTRA Rev 4.11.8, 5.4.2, from two public implementations
    that agree. The manufacturer's test vectors were not available: compare with a real encoder
    before relying on it.
    """
    crc = 0
    for shift in (16, 8, 0):
        crc ^= low24 >> shift & 0xFF
        for _ in range(8):
            crc = (crc << 1 ^ 0x97) & 0xFF if crc & 0x80 else crc << 1
    return crc
