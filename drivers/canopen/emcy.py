"""Emergency frames (EMCY): error reports of a node.

Frame after CiA 301: u16 code, u8 error register (0x1001), 5 manufacturer-specific bytes, COB-ID
0x80 + node.
"""

import struct
from typing import NamedTuple

from drivers.canopen.codec_error import CodecError, wrong_length
from drivers.cia402.error_codes import REGISTER, meaning

BASE = 0x080
_FRAME = struct.Struct("<HB5s")


class Emergency(NamedTuple):
    """One emergency frame."""

    node: int  # 1 to 127
    code: int  # 0: the errors are gone
    register: int  # bits of 0x1001
    vendor: bytes  # 5 bytes


def decode(cob_id: int, data: bytes) -> Emergency:
    """Return the decoded frame; CodecError unless 8 bytes with a COB-ID 0x081 to 0x0FF."""
    if not BASE < cob_id <= BASE + 127:
        raise CodecError(cob_id, "COB-ID 0x081 to 0x0ff", f"{cob_id:#05x}")
    if len(data) != _FRAME.size:
        raise wrong_length(cob_id, _FRAME.size, len(data))
    return Emergency(cob_id - BASE, *_FRAME.unpack(data))


def describe(emergency: Emergency) -> str:
    """Return a text for people: node, code, meaning, error register, manufacturer's bytes."""
    node, code, register, vendor = emergency
    bits = "+".join(name for bit, name in enumerate(REGISTER) if register >> bit & 1) or "clear"
    return (
        f"node {node}: {code:#06x} {meaning(code)} (register {register:#04x} {bits}, "
        f"maker {vendor.hex()})"
    )
