"""python-can's socketcand bus with a filter that discards frames before decoding them.

The server sends every frame of the bus to every client. Decoding seven thousand frames a second
needs more time than a busy host gives to the process that monitors heartbeats: they were seconds
late, and the loop stopped although the drives worked.

The handshake here reads message by message: on a busy bus frames arrive before an answer, and a
message may arrive in pieces. Frames before the last answer are dropped, because they are older than
the open bus; those after it are kept.
"""

import re
import select
import socket
import time
from collections import deque
from collections.abc import Sequence
from typing import Any

import can
from can.interfaces.socketcand import SocketCanDaemonBus
from can.interfaces.socketcand.socketcand import convert_ascii_message_to_can_message as decode

_FRAME = b"< frame "
_ID = slice(len(_FRAME), len(_FRAME) + 3)  # hexadecimal digits of an 11-bit identifier
_ALL = 0x7FF
MAX_MESSAGE = 256  # bytes kept of a message that has not ended; a frame has 60
_BUS_MESSAGE = re.compile(rb"< (frame|error) [0-9A-Fa-f]+ [0-9.]+ ")  # not an error as an answer
ANSWER_TIMEOUT = 5.0  # s for each answer of the handshake


class SocketcandBus(SocketCanDaemonBus):
    """python-can's bus, filtered by exact COB-IDs if every filter names a single one."""

    def __init__(self, **settings: Any) -> None:
        """As in python-can: ``channel``, ``host``, ``port``, ``tcp_tune``, ``can_filters``."""
        self._ids: frozenset[bytes] | None = None  # None: accept all
        self._buffer = b""
        self._messages: deque[can.Message] = deque()
        self._quick_ack = bool(settings.get("tcp_tune"))
        self._handshake = iter(("connecting", f"< open {settings['channel']} >", "< rawmode >"))
        try:
            super().__init__(**settings)  # type: ignore[no-untyped-call]
        except can.CanError:
            self.stream.close()
            raise

    @property
    def stream(self) -> socket.socket:
        """The connection to the server."""
        stream: socket.socket = self._SocketCanDaemonBus__socket  # type: ignore[attr-defined]
        return stream

    def take_buffer(self) -> bytes:
        """Return the text received after the last answer; another reader of `stream` needs it."""
        text, self._buffer = self._buffer, b""
        return text

    def _expect_msg(self, msg: str) -> None:
        """Wait for an answer of the handshake; CanError names the message received instead."""
        request, until = next(self._handshake), time.monotonic() + ANSWER_TIMEOUT
        while True:
            while b">" in self._buffer:
                piece, _, self._buffer = self._buffer.partition(b">")
                message = (piece + b">").strip()
                if message == msg.encode():
                    return
                if not _BUS_MESSAGE.match(message):
                    raise can.CanError(self._handshake_error(message, request, msg))
            if len(self._buffer) > MAX_MESSAGE:
                raise can.CanError(self._handshake_error(self._buffer, request, msg))
            data = self._receive(max(0.0, until - time.monotonic()))
            if not data or time.monotonic() > until:
                raise can.CanError(f"no answer to {request} in {ANSWER_TIMEOUT:g} s")
            self._buffer += data

    @staticmethod
    def _handshake_error(message: bytes, request: str, expected: str) -> str:
        text = message.decode("ascii", "replace")
        if text.startswith("< error "):
            return f"the server refuses {request}: {text.removeprefix('< error ')[:-1].strip()}"
        return f"the server answers {request} with {text[:60]!r}, not {expected!r}"

    def _apply_filters(self, filters: Sequence[Any] | None) -> None:
        single = filters and all(one["can_mask"] == _ALL for one in filters)
        self._ids = frozenset(b"%03X" % one["can_id"] for one in filters or ()) if single else None

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._messages:
            has_whole_message = b">" in self._buffer  # received after the last answer
            self._parse(b"" if has_whole_message else self._receive(timeout))
        return (self._messages.popleft(), False) if self._messages else (None, False)

    def _receive(self, timeout: float | None) -> bytes:
        """Return received bytes after waiting up to ``timeout`` (s); empty if none came."""
        try:
            if not select.select([self.stream], [], [], timeout)[0]:
                return b""
            data = self.stream.recv(65536)
            if self._quick_ack:
                self.stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
        except OSError as error:
            raise can.CanError(f"Failed to receive: {error}") from error
        if not data:
            raise can.CanError("Failed to receive: the server has ended")
        return data

    def _parse(self, data: bytes) -> None:
        *pieces, self._buffer = (self._buffer + data).split(b">")
        self._buffer = self._buffer[-MAX_MESSAGE:]
        self._messages.extend(
            message for piece in pieces if (message := self._decode_message(piece))
        )

    def _decode_message(self, piece: bytes) -> can.Message | None:
        start = piece.find(b"<")
        if piece.startswith(_FRAME, start) and self._ids is not None:
            word = piece[start + _ID.start : start + _ID.stop].upper()
            if word not in self._ids:
                return None
        return decode(piece[start:].decode("utf-8", "replace") + ">") if start >= 0 else None
