"""Heartbeats: the NMT state a node reports of itself, and noticing that it went silent.

Frame after CiA 301: one byte, the state, COB-ID 0x700 + node.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.canopen.codec_error import CodecError, wrong_length

BASE = 0x700


class Nmt(IntEnum):
    """What a node may do; process data only in OPERATIONAL."""

    SILENT = -1  # nothing was heard yet; never on the wire
    BOOT = 0  # just started, then PRE_OPERATIONAL by itself
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 0x7F


_SILENT, _BOOT = int(Nmt.SILENT), int(Nmt.BOOT)
_ON_THE_WIRE = {int(state) for state in Nmt if state != Nmt.SILENT}


class Beat(NamedTuple):
    """One heartbeat."""

    node: int  # 1 to 127
    nmt: int  # `Nmt`


def decode(cob_id: int, data: bytes) -> Beat:
    """The frame in words; CodecError for another COB-ID, length or state than there is."""
    if not BASE < cob_id <= BASE + 127:
        raise CodecError(cob_id, "COB-ID 0x701 to 0x77f", f"{cob_id:#05x}")
    if len(data) != 1:
        raise wrong_length(cob_id, 1, len(data))
    if data[0] not in _ON_THE_WIRE:
        raise CodecError(cob_id, "NMT state 0, 4, 5 or 0x7f", f"{data[0]:#04x}")
    return Beat(cob_id - BASE, data[0])


def encode(nmt: int) -> bytes:
    """The byte of our own heartbeat; CodecError for what is no state on the wire."""
    if nmt not in _ON_THE_WIRE:
        raise CodecError(BASE, "NMT state 0, 4, 5 or 0x7f", f"{nmt}")
    return bytes((nmt,))


class Watch(NamedTuple):
    """Memory of the watchdog of one node."""

    stamp: float  # s, of the last heartbeat; before the first one, since when it is waited for
    nmt: int  # `Nmt` as heard last
    boots: int  # how often the node said that it started: more than expected is a reset


def start(now: float) -> Watch:
    """Waiting for the first heartbeat from ``now`` (s) on."""
    return Watch(now, _SILENT, 0)


def heard(watch: Watch, nmt: int, stamp: float) -> Watch:
    """The memory after a heartbeat received at ``stamp`` (s)."""
    return Watch(stamp, nmt, watch.boots + (1 if nmt == _BOOT else 0))


def lost(watch: Watch, now: float, deadline: float) -> int:
    """1 if nothing was heard for longer than ``deadline`` (s), or a time is no number."""
    return 0 if 0.0 <= now - watch.stamp <= deadline else 1
