"""Raw frames of an open CAN bus for a tick: few system calls, and no message objects.

SocketCAN and socketcand are read and written at their sockets, which python-can only opens; every
other interface goes through python-can. No port waits. A port may raise what its interface raises,
one of `BUS_ERRORS`; `drivers.canopen.link` counts it.
"""

import re
import socket
import struct
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol

import can
from can.interfaces.socketcan import SocketcanBus

from drivers.canopen.socketcand_bus import MAX_MESSAGE, SocketcandBus

# The last two: invalid text of socketcand or slcan.
BUS_ERRORS = (can.CanError, OSError, ValueError, LookupError)
_ERROR_FLAG = 0x20000000  # of linux/can.h; higher bits mark extended and remote frames
_MAX_IDENTIFIER = 0x7FF  # of 11 bits, and no flag
_KERNEL_FRAME = struct.Struct("=IB3x8s")  # struct can_frame: identifier and flags, length, data
_FRAME_TEXT = re.compile(rb"< frame ([0-9A-Fa-f]{3}) [0-9.]+ ([0-9A-Fa-f ]*)>")
_FRAME_TEXT_BYTES = 48  # of a frame with 8 data bytes


class Frame(NamedTuple):
    """One data frame with an 11-bit identifier."""

    cob_id: int
    data: bytes


class Received(NamedTuple):
    """Counts of one look at a bus."""

    error_frames: int
    has_backlog: bool  # True: the look may have ended before the bus was empty


class FramePort(Protocol):
    """Frames from and to an open bus."""

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        """Send frames in their order; return the indices of those that the bus did not accept."""
        ...

    def receive(self, frames: list[Frame], max_frames: int) -> Received:
        """Append received frames, oldest first; ``max_frames`` bounds all that are looked at."""
        ...


def frame_port(bus: can.BusABC, cob_ids: Iterable[int]) -> FramePort:
    """Return the port of a bus that receives frames with these COB-IDs."""
    if isinstance(bus, SocketcandBus):
        return SocketcandPort(bus, cob_ids)
    if isinstance(bus, SocketcanBus):
        return KernelPort(bus.socket)
    return LibraryPort(bus, cob_ids)


class KernelPort:
    """SocketCAN. The kernel has filtered the identifiers."""

    def __init__(self, kernel_socket: socket.socket) -> None:
        self._receive, self._send = kernel_socket.recv, kernel_socket.send

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        refused: list[int] = []
        for index, (cob_id, data) in enumerate(frames):
            try:
                self._send(_KERNEL_FRAME.pack(cob_id, len(data), data), socket.MSG_DONTWAIT)
            except OSError:
                refused.append(index)
        return refused

    def receive(self, frames: list[Frame], max_frames: int) -> Received:
        error_frames = 0
        for _ in range(max_frames):
            try:
                frame = self._receive(_KERNEL_FRAME.size, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return Received(error_frames, False)
            identifier, length, data = _KERNEL_FRAME.unpack(frame)
            if identifier & _ERROR_FLAG:
                error_frames += 1
            elif identifier <= _MAX_IDENTIFIER:  # no remote frame, which the filter lets through
                frames.append(Frame(identifier, data[:length]))
        return Received(error_frames, True)


class SocketcandPort:
    """Text of socketcand: one call of the kernel receives all frames, one sends all.

    The commands of a tick acknowledge what it has received, so that TCP needs no acknowledgements
    at once here (TCP_QUICKACK), which cost as much as a frame each.
    """

    def __init__(self, bus: SocketcandBus, cob_ids: Iterable[int]) -> None:
        self._stream = bus.stream
        self._text = bus.take_buffer()  # received, and not complete yet
        self._unsent = b""  # rest of a frame that the stream has accepted in part
        self._cob_ids = {b"%03X" % cob_id: cob_id for cob_id in cob_ids}

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        texts = [
            b"< send %03X %X %b >" % (cob_id, len(data), data.hex(" ").encode())
            for cob_id, data in frames
        ]
        text = self._unsent + b"".join(texts)
        try:
            sent = self._stream.send(text, socket.MSG_DONTWAIT)
        except BlockingIOError:
            sent = 0
        if sent == len(text):
            self._unsent = b""
            return ()
        return self._refused(texts, sent)

    def _refused(self, texts: list[bytes], sent: int) -> Sequence[int]:
        """Keep the rest of a frame whose first bytes are sent; return those not begun."""
        end = len(self._unsent)
        if sent < end:
            self._unsent = self._unsent[sent:]
            return range(len(texts))
        self._unsent = b""
        for index, text in enumerate(texts):
            if sent <= end:
                return range(index, len(texts))
            end += len(text)
            if sent < end:
                self._unsent = text[sent - end :]
        return ()

    def receive(self, frames: list[Frame], max_frames: int) -> Received:
        size = max_frames * _FRAME_TEXT_BYTES
        try:
            data = self._stream.recv(size, socket.MSG_DONTWAIT)
        except BlockingIOError:
            data = None
        if data == b"":
            raise ConnectionResetError("the server has ended")
        text = self._text + (data or b"")
        end = text.rfind(b">") + 1
        self._text = text[end:][-MAX_MESSAGE:]
        find = self._cob_ids.get
        for digits, octets in _FRAME_TEXT.findall(text, 0, end):
            cob_id = find(digits.upper())
            if cob_id is not None:
                frames.append(Frame(cob_id, bytes.fromhex(octets.decode())))
        return Received(text.count(b"< error ", 0, end), data is not None and len(data) == size)


class LibraryPort:
    """Any other interface, message by message."""

    def __init__(self, bus: can.BusABC, cob_ids: Iterable[int]) -> None:
        self._bus, self._cob_ids = bus, frozenset(cob_ids)

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        refused: list[int] = []
        for index, (cob_id, data) in enumerate(frames):
            try:
                self._bus.send(
                    can.Message(arbitration_id=cob_id, data=data, is_extended_id=False, check=False)
                )
            except BUS_ERRORS:
                refused.append(index)
        return refused

    def receive(self, frames: list[Frame], max_frames: int) -> Received:
        error_frames = 0
        for _ in range(max_frames):
            message = self._bus.recv(0.0)
            if message is None:
                return Received(error_frames, False)
            if message.is_error_frame:
                error_frames += 1
            elif (
                message.arbitration_id in self._cob_ids
                and not message.is_extended_id
                and not message.is_remote_frame
            ):
                frames.append(Frame(message.arbitration_id, bytes(message.data)))
        return Received(error_frames, True)
