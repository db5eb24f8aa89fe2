"""Two-wire RS-485 adapters may hear themselves: what was sent comes back and is taken out again.

Exactly the bytes that were sent are taken, where they stand first; anything else is an answer.
Bytes that began like an echo and turned out to be none are given back, none is lost.
"""

from typing import NamedTuple


class State(NamedTuple):
    """What was sent and has not come back."""

    awaited: bytes
    matched: int  # how many of them have come and are held back
    missed: int  # times that something else came instead of the echo


def start() -> State:
    """State of a line just opened."""
    return State(b"", 0, 0)


def sent(state: State, data: bytes) -> State:
    """These bytes went out."""
    return state._replace(awaited=state.awaited + data)


def strip(state: State, data: bytes) -> tuple[State, bytes]:
    """Take in what came; gives what is not echo."""
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
