"""python-can's socketcand bus, which reads what is not wanted without making messages of it.

Its server sends every frame of the bus to every client. To make messages of seven thousand a
second takes more than a busy host gives to a process that waits for heartbeats: they were seconds
late, and the loop stopped for drives that were well.

Its handshake reads message by message: on a busy bus frames come before an answer, and a message
may come in pieces. Frames before the answer are dropped, for they are older than the bus that is
being opened; those behind it are kept.
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
_LONGEST = 256  # bytes kept of a message that has not ended; a frame has 60
_OF_THE_BUS = re.compile(rb"< (frame|error) [0-9A-Fa-f]+ [0-9.]+ ")  # else an error is an answer
ANSWER = 5.0  # s for each answer of the handshake


class SocketcandBus(SocketCanDaemonBus):
    """The same bus; once it is filtered, it keeps to COB-IDs that were asked for one by one."""

    def __init__(self, **settings: Any) -> None:
        """As python-can's: ``channel``, ``host``, ``port``, ``tcp_tune``, ``can_filters``."""
        self._ids: frozenset[bytes] | None = None  # None: everything is wanted
        self._rest = b""
        self._ready: deque[can.Message] = deque()
        self._quick = bool(settings.get("tcp_tune"))
        self._asked = iter(("connecting", f"< open {settings['channel']} >", "< rawmode >"))
        try:
            super().__init__(**settings)  # type: ignore[no-untyped-call]
        except can.CanError:
            self._stream.close()
            raise
        self._take(b"")  # what came behind the last answer

    @property
    def _stream(self) -> socket.socket:
        stream: socket.socket = self._SocketCanDaemonBus__socket  # type: ignore[attr-defined]
        return stream

    def _expect_msg(self, msg: str) -> None:
        """Wait for an answer of the handshake; CanError says what came in its place."""
        asked, until = next(self._asked), time.monotonic() + ANSWER
        while True:
            while b">" in self._rest:
                piece, _, self._rest = self._rest.partition(b">")
                found = (piece + b">").strip()
                if found == msg.encode():
                    return
                if not _OF_THE_BUS.match(found):
                    raise can.CanError(self._not_the_answer(found, asked, msg))
            if len(self._rest) > _LONGEST:
                raise can.CanError(self._not_the_answer(self._rest, asked, msg))
            data = self._receive(max(0.0, until - time.monotonic()))
            if not data or time.monotonic() > until:
                raise can.CanError(f"no answer to {asked} in {ANSWER:g} s")
            self._rest += data

    @staticmethod
    def _not_the_answer(found: bytes, asked: str, wanted: str) -> str:
        said = found.decode("ascii", "replace")
        if said.startswith("< error "):
            return f"the server refuses {asked}: {said.removeprefix('< error ')[:-1].strip()}"
        return f"the server answers {asked} by {said[:60]!r}, not {wanted!r}"

    def _apply_filters(self, filters: Sequence[Any] | None) -> None:
        single = filters and all(one["can_mask"] == _ALL for one in filters)
        self._ids = frozenset(b"%03X" % one["can_id"] for one in filters or ()) if single else None

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._ready:
            self._take(self._receive(timeout))
        return (self._ready.popleft(), False) if self._ready else (None, False)

    def _receive(self, timeout: float | None) -> bytes:
        """What has come on the stream, waited for so long (s); empty if nothing did."""
        try:
            if not select.select([self._stream], [], [], timeout)[0]:
                return b""
            data = self._stream.recv(65536)
            if self._quick:
                self._stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
        except OSError as error:
            raise can.CanError(f"Failed to receive: {error}") from error
        if not data:
            raise can.CanError("Failed to receive: the server has ended")
        return data

    def _take(self, data: bytes) -> None:
        *pieces, self._rest = (self._rest + data).split(b">")
        self._rest = self._rest[-_LONGEST:]
        self._ready.extend(made for piece in pieces if (made := self._message(piece)))

    def _message(self, piece: bytes) -> can.Message | None:
        start = piece.find(b"<")
        if piece.startswith(_FRAME, start) and self._ids is not None:
            word = piece[start + _ID.start : start + _ID.stop].upper()
            if word not in self._ids:
                return None
        return decode(piece[start:].decode("utf-8", "replace") + ">") if start >= 0 else None
