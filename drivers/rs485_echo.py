"""Removal of the local echo: a two-wire RS-485 adapter may receive its own transmission.

Only the exact bytes that were sent are removed, and only at the start of the received data; all
others belong to the answer. Bytes that begin like an echo but differ later are passed on, so no
byte of an answer is lost.
"""

from typing import NamedTuple


class State(NamedTuple):
    """Sent bytes whose echo is still outstanding."""

    expected: bytes
    matched: int  # bytes of them that have been received and are withheld
    missed_echoes: int  # times that other bytes came instead of the echo


def start() -> State:
    """Return the state of a line just opened."""
    return State(b"", 0, 0)


def record_sent(state: State, data: bytes) -> State:
    """Return the state after sending these bytes."""
    return state._replace(expected=state.expected + data)


def strip_echo(state: State, data: bytes) -> tuple[State, bytes]:
    """Return the new state and the received bytes without the echo."""
    awaited, matched, missed = state
    if not awaited:
        return state, data
    at = 0
    while at < len(data) and matched < len(awaited) and data[at] == awaited[matched]:
        at, matched = at + 1, matched + 1
    if matched == len(awaited):
        return State(b"", 0, missed), data[at:]
    if at == len(data):
        return State(awaited, matched, missed), b""
    return State(b"", 0, missed + 1), awaited[:matched] + data[at:]
