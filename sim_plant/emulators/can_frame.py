"""A CAN frame, the bits it takes on the wire, and its form in the socketcand text protocol. Pure.

The text is that of the socketcand daemon's raw mode: `< send 185 2 37 02 >` from a client,
`< frame 185 1700000000.123456 3702 >` to it. An identifier of three digits is a standard one.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from sim_plant.units import Second

STANDARD = 0x7FF
EXTENDED = 0x1FFFFFFF
SEND = re.compile(r"send ([0-9A-Fa-f]{1,8}) ([0-8])((?: [0-9A-Fa-f]{1,2}){0,8}) ?")


class Frame(NamedTuple):
    """A data frame of classical CAN."""

    identifier: int  # COB-ID: the lower, the sooner it wins the bus
    data: bytes  # 0 to 8
    extended: bool = False  # 29 bits instead of 11


class TextError(ValueError):
    """Text that is no frame to send."""


def bits(length: int, extended: bool = False) -> int:
    """Give the bits of a frame of some data bytes with worst-case stuffing and interframe space.

    11-bit: 44 + 8n, one stuff bit per four of the 34 + 8n stuffed ones after the first, 3 between.
    """
    if extended:
        return 64 + 8 * length + (53 + 8 * length) // 4 + 3
    return 44 + 8 * length + (33 + 8 * length) // 4 + 3


def read_send(words: str) -> Frame:
    """Give the frame of `send ID LENGTH BYTE ...`. Raises TextError for anything else."""
    match = SEND.fullmatch(words)
    if match is None:
        raise TextError("not a frame")
    digits, length, data = match.groups()
    identifier = int(digits, 16)
    extended = len(digits) > 3
    octets = bytes(int(octet, 16) for octet in data.split())
    if len(octets) != int(length):
        raise TextError(f"{length} bytes told, {len(octets)} given")
    if identifier > (EXTENDED if extended else STANDARD):
        raise TextError("identifier out of range")
    return Frame(identifier, octets, extended)


def written(frame: Frame, time: Second) -> bytes:
    """Give the text that brings a frame to a client; `time` in seconds, any origin."""
    identifier, data, extended = frame
    digits = f"{identifier:08X}" if extended else f"{identifier:03X}"
    return f"< frame {digits} {time:.6f} {data.hex()} >".encode()
