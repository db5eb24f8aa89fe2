"""CAN frames, their length on the wire, and their form in the socketcand text protocol. Pure.

The text format is that of the socketcand daemon's raw mode: `< send 185 2 37 02 >` from a client,
`< frame 185 1700000000.123456 3702 >` to it. An identifier of three digits is a standard
identifier.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from sim_plant.units import Second

MAX_STANDARD_ID = 0x7FF
MAX_EXTENDED_ID = 0x1FFFFFFF
SEND_PATTERN = re.compile(r"send ([0-9A-Fa-f]{1,8}) ([0-8])((?: [0-9A-Fa-f]{1,2}){0,8}) ?")


class Frame(NamedTuple):
    """A data frame of classical CAN."""

    identifier: int  # COB-ID: a lower identifier has priority on the bus
    data: bytes  # 0 to 8
    extended: bool = False  # 29 bits instead of 11


class FrameTextError(ValueError):
    """Text that is not a valid `send` command."""


def frame_bits(length: int, extended: bool = False) -> int:
    """Return the bits of a frame with `length` data bytes in the worst case of bit stuffing.

    11-bit: 44 + 8n, one stuff bit per four of the 34 + 8n stuffed ones after the first, 3 between.
    """
    if extended:
        return 64 + 8 * length + (53 + 8 * length) // 4 + 3
    return 44 + 8 * length + (33 + 8 * length) // 4 + 3


def parse_send(text: str) -> Frame:
    """Return the frame of `send ID LENGTH BYTE ...`. Raises TextError for anything else."""
    match = SEND_PATTERN.fullmatch(text)
    if match is None:
        raise FrameTextError("not a frame")
    digits, length, data = match.groups()
    identifier = int(digits, 16)
    extended = len(digits) > 3
    octets = bytes(int(octet, 16) for octet in data.split())
    if len(octets) != int(length):
        raise FrameTextError(f"{length} bytes declared, {len(octets)} given")
    if identifier > (MAX_EXTENDED_ID if extended else MAX_STANDARD_ID):
        raise FrameTextError("identifier out of range")
    return Frame(identifier, octets, extended)


def format_frame(frame: Frame, time: Second) -> bytes:
    """Return the text of a frame for a client; `time` is in seconds, with any origin."""
    identifier, data, extended = frame
    digits = f"{identifier:08X}" if extended else f"{identifier:03X}"
    return f"< frame {digits} {time:.6f} {data.hex()} >".encode()
