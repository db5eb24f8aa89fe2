"""ASCII lines of the Compax3: requests, and the replies ``>``, ``!xxxx``, a value or a text.

Lines carry no checksum: a flipped bit can turn one number into another. They serve identification
and diagnostics; commands to the machine use binary records.
Source: Compax3 manual 192-120100 N16 (I10T10), 5.2.2 ASCII record.
"""

import math
import re
from enum import IntEnum
from typing import NamedTuple

from drivers.compax3.codec import MAX_ADDRESS, NO_ADDRESS, Object
from drivers.errors import CodecError

CR = b"\r"
IDENTIFY = "_?"  # answered by a text that begins with "Compax3"
_SUBJECT = "Compax3 line"
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)")
_HEX = re.compile(r"\$[0-9A-Fa-f]{1,12}")
_ERROR = re.compile(r"![0-9A-Fa-f]{4}")
_LARGEST = float(1 << 47)


class ReplyKind(IntEnum):
    """Kind of a reply."""

    ACCEPTED = 0  # ">"
    REFUSED = 1  # "!xxxx"
    VALUE = 2
    TEXT = 3  # any other printable text, such as the name of the drive


class Reply(NamedTuple):
    """One line from the drive."""

    kind: ReplyKind
    code: int  # REFUSED: the error number; else 0
    value: float  # VALUE: the number, in the drive's own unit; else 0
    text: str  # the line without the star and the carriage return
    starred: int  # 1: it began with "*", as on two-wire RS485


def encode_line(command: str, address: int = NO_ADDRESS) -> bytes:
    """Return a command with its carriage return, on RS485 preceded by the address."""
    if not command or not all(0x20 <= ord(letter) <= 0x7E for letter in command):
        raise CodecError(_SUBJECT, "command", "characters 20 to 7E", repr(command))
    if address == NO_ADDRESS:
        return command.encode("ascii") + CR
    if not 0 <= address <= MAX_ADDRESS:
        raise CodecError(_SUBJECT, "address", f"0 to {MAX_ADDRESS}", address)
    return f"{address}{command}".encode("ascii") + CR


def encode_read_line(target: Object, address: int = NO_ADDRESS, separator: str = ".") -> bytes:
    """Return the line that reads an object.

    ``separator``: manuals from 2010 on write ``o680.5``, those of 2004 ``o680,5``; the drives in
    known use accept the point. Not confirmed for every firmware, hence a parameter.
    """
    return encode_line(f"o{target.number}{separator}{target.subindex}", address)


def encode_write_line(
    target: Object, value: float, address: int = NO_ADDRESS, separator: str = "."
) -> bytes:
    """Return the line that writes an object; nine decimals at most, never an exponent.

    CodecError for NaN, infinity and a value that no format of the drive can hold.
    """
    if not (math.isfinite(value) and abs(value) < _LARGEST):
        raise CodecError(_SUBJECT, "value", "a finite number below 2**47", value)
    digits = f"{value:.9f}".rstrip("0").rstrip(".")
    digits = "0" if digits == "-0" else digits
    return encode_line(f"o{target.number}{separator}{target.subindex}={digits}", address)


def decode_line(line: bytes) -> Reply:
    """Return the reply in a line without its carriage return; CodecError for an invalid one."""
    if not line or not all(0x20 <= byte <= 0x7E for byte in line):
        raise CodecError(_SUBJECT, "characters", "20 to 7E", line.hex(" ") or "none")
    text = line.decode("ascii")
    starred = 1 if text.startswith("*") else 0
    text = text[starred:].strip()
    if not text:
        raise CodecError(_SUBJECT, "reply", "something after the star", repr(line))
    if text.startswith(">"):
        if text != ">":
            raise CodecError(_SUBJECT, "reply", "> alone", repr(text))
        return Reply(ReplyKind.ACCEPTED, 0, 0.0, text, starred)
    if text.startswith("!"):
        if not _ERROR.fullmatch(text):
            raise CodecError(_SUBJECT, "error", "! and four hex digits", repr(text))
        return Reply(ReplyKind.REFUSED, int(text[1:], 16), 0.0, text, starred)
    if _HEX.fullmatch(text):
        return Reply(ReplyKind.VALUE, 0, float(int(text[1:], 16)), text, starred)
    if _NUMBER.fullmatch(text):
        value = float(text)
        if not math.isfinite(value):
            raise CodecError(_SUBJECT, "value", "a finite number", text)
        return Reply(ReplyKind.VALUE, 0, value, text, starred)
    return Reply(ReplyKind.TEXT, 0, 0.0, text, starred)
