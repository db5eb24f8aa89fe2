"""Parser of the byte stream from a Compax3, which mixes binary records and ASCII lines.

A record starts with 05, 06 or 07, which never occur in a line; a line ends with a carriage return.
A line is accepted only where one can begin: at the start, after a line, after a record, after a
pause. After dropped bytes the rest of a line is dropped too, because the tail of a number is a
number.
"""

from typing import NamedTuple

from drivers.compax3.codec import REPLIES, Record, allows_size, decode_record, record_kind
from drivers.compax3.text import Reply, decode_line
from drivers.errors import CodecError

MAX_LINE = 128  # characters; the longest text seen (identification) is far below
_CR, _LF = 0x0D, 0x0A
Message = Record | Reply


class State(NamedTuple):
    """Unparsed bytes, and error counts since the start."""

    pending: bytes
    line_start: int  # 1: a line may begin here
    dropped: int  # bytes that belong to no message
    bad_records: int  # records with a wrong checksum or invalid content
    bad_lines: int  # lines that are no valid reply, or are too long


def start() -> State:
    """Return the state of a line just opened."""
    return State(b"", 1, 0, 0, 0)


def feed(state: State, data: bytes) -> tuple[State, list[Message]]:
    """Return the new state and the messages that the received bytes complete, in order.

    The result does not depend on how the bytes are split over calls. A false start code can delay
    the bytes after it until its length is filled: call `flush_stalled` after 5 ms of silence.
    """
    buffer = state.pending + data
    messages: list[Message] = []
    clean, dropped, bad_records, bad_lines = state[1:]
    at = 0
    while at < len(buffer):
        byte = buffer[at]
        kind = record_kind(byte)
        if kind is not None and kind in REPLIES:
            if len(buffer) < at + 2:
                break
            size = buffer[at + 1] + 1
            end = at + 2 + size + 2
            if allows_size(kind, size):
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


def flush_stalled(state: State) -> tuple[State, list[Message]]:
    """Discard an incomplete message after more than 5 ms of silence, the largest gap within one.

    Returns the new state and the messages found behind a false start code. A line may begin next.
    """
    messages: list[Message] = []
    while state.pending:
        stalled = state.pending
        state = state._replace(pending=b"", line_start=0, dropped=state.dropped + 1)
        state, more = feed(state, stalled[1:])
        messages += more
    return state._replace(line_start=1), messages
