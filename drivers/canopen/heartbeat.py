"""Heartbeats: the NMT state that a node reports, and the detection of a missing heartbeat.

Frame after CiA 301: one byte, the state, COB-ID 0x700 + node.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.canopen.codec_error import CodecError, wrong_length

BASE = 0x700


class NmtState(IntEnum):
    """NMT state of a node; it exchanges process data only in OPERATIONAL."""

    SILENT = -1  # no heartbeat received yet; never on the wire
    BOOT = 0  # just started; changes to PRE_OPERATIONAL by itself
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 0x7F


_SILENT, _BOOT = int(NmtState.SILENT), int(NmtState.BOOT)
_ON_THE_WIRE = {int(state) for state in NmtState if state != NmtState.SILENT}


class Heartbeat(NamedTuple):
    """One heartbeat."""

    node: int  # 1 to 127
    nmt: int  # `Nmt`


def decode(cob_id: int, data: bytes) -> Heartbeat:
    """Return the decoded frame; CodecError for an invalid COB-ID, length or state."""
    if not BASE < cob_id <= BASE + 127:
        raise CodecError(cob_id, "COB-ID 0x701 to 0x77f", f"{cob_id:#05x}")
    if len(data) != 1:
        raise wrong_length(cob_id, 1, len(data))
    if data[0] not in _ON_THE_WIRE:
        raise CodecError(cob_id, "NMT state 0, 4, 5 or 0x7f", f"{data[0]:#04x}")
    return Heartbeat(cob_id - BASE, data[0])


def encode(nmt: int) -> bytes:
    """Return the byte of our own heartbeat; CodecError for a state that is never on the wire."""
    if nmt not in _ON_THE_WIRE:
        raise CodecError(BASE, "NMT state 0, 4, 5 or 0x7f", f"{nmt}")
    return bytes((nmt,))


class HeartbeatWatch(NamedTuple):
    """State of the heartbeat watchdog of one node."""

    stamp: float  # s, of the last heartbeat; before the first one, the start of the watch
    nmt: int  # last `NmtState`
    boots: int  # number of boot messages; more than expected means a reset


def start(now: float) -> HeartbeatWatch:
    """Return the state of a watch that starts at ``now`` (s)."""
    return HeartbeatWatch(now, _SILENT, 0)


def record(watch: HeartbeatWatch, nmt: int, stamp: float) -> HeartbeatWatch:
    """Return the state after a heartbeat received at ``stamp`` (s)."""
    return HeartbeatWatch(stamp, nmt, watch.boots + (1 if nmt == _BOOT else 0))


def is_lost(watch: HeartbeatWatch, now: float, deadline: float) -> int:
    """Return 1 if no heartbeat came for longer than ``deadline`` (s), or a time is not finite."""
    return 0 if 0.0 <= now - watch.stamp <= deadline else 1
