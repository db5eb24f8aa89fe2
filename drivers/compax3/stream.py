"""What comes from a Compax3, byte by byte: binary records and ASCII lines, told apart.

A record starts with 05, 06 or 07, which never stand in a line; a line ends with a carriage return.
A line counts only from a place where one can begin: the start, the end of the line before, the end
of a record, a pause. After anything thrown away the rest of a line is thrown away too, because the
tail of a number is a number.
"""

from typing import NamedTuple

from drivers.compax3.codec import REPLIES, Record, decode_record, kind_of, may_hold
from drivers.compax3.text import Reply, decode_line
from drivers.errors import CodecError

MAX_LINE = 128  # characters; the longest text seen (identification) is far below
_CR, _LF = 0x0D, 0x0A
Message = Record | Reply


class State(NamedTuple):
    """What is undecided yet, and how much has been thrown away so far."""

    pending: bytes
    clean: int  # 1: a line may begin here
    dropped: int  # bytes that belong to no message
    bad_records: int  # those with a wrong check sum, or refused for their content
    bad_lines: int  # those that end in a carriage return and are no reply, or are too long


def start() -> State:
    """State of a line just opened."""
    return State(b"", 1, 0, 0, 0)


def feed(state: State, data: bytes) -> tuple[State, list[Message]]:
    """Take in the bytes that came; gives the messages they complete, in order.

    How the bytes are split over calls changes nothing. A false start code can hold back what
    follows it until its length is filled: after 5 ms of silence call `pause`.
    """
    buffer = state.pending + data
    messages: list[Message] = []
    clean, dropped, bad_records, bad_lines = state[1:]
    at = 0
    while at < len(buffer):
        byte = buffer[at]
        kind = kind_of(byte)
        if kind is not None and kind in REPLIES:
            if len(buffer) < at + 2:
                break
            size = buffer[at + 1] + 1
            end = at + 2 + size + 2
            if may_hold(kind, size):
                if len(buffer) < end:
                    break
                try:
                    messages.append(decode_record(buffer[at:end]))
                except CodecError:
                    bad_records += 1
                else:
                    at, clean = end, 1
                    continue
            at, clean, dropped = at + 1, 0, dropped + 1
        elif byte in (_CR, _LF):
            at, clean = at + 1, 1
        elif 0x20 <= byte <= 0x7E:
            end = at
            while end < len(buffer) and 0x20 <= buffer[end] <= 0x7E:
                end += 1
            if clean and end - at > MAX_LINE:
                clean, bad_lines = 0, bad_lines + 1
            if clean and end == len(buffer):
                break
            if clean and buffer[end] == _CR:
                try:
                    messages.append(decode_line(buffer[at:end]))
                except CodecError:
                    bad_lines, dropped = bad_lines + 1, dropped + end - at
            else:
                clean, dropped = 0, dropped + end - at
            at = end
        else:
            at, clean, dropped = at + 1, 0, dropped + 1
    return State(buffer[at:], clean, dropped, bad_records, bad_lines), messages


def pause(state: State) -> tuple[State, list[Message]]:
    """The line has been silent for longer than a message has gaps (5 ms): give up on its head.

    What stood behind a false start code comes out now; after it, a line may begin.
    """
    messages: list[Message] = []
    while state.pending:
        held = state.pending
        state = state._replace(pending=b"", clean=0, dropped=state.dropped + 1)
        state, more = feed(state, held[1:])
        messages += more
    return state._replace(clean=1), messages
