"""python-can's socketcand bus, which reads what is not wanted without making messages of it.

Its server sends every frame of the bus to every client. To make messages of seven thousand a
second takes more than a busy host gives to a process that waits for heartbeats: they were seconds
late, and the loop stopped for drives that were well.
"""

import select
import socket
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


class SocketcandBus(SocketCanDaemonBus):
    """The same bus; once it is filtered, it keeps to COB-IDs that were asked for one by one."""

    def __init__(self, **settings: Any) -> None:
        """As python-can's: ``channel``, ``host``, ``port``, ``tcp_tune``, ``can_filters``."""
        self._ids: frozenset[bytes] | None = None  # None: everything is wanted
        self._rest = b""
        self._ready: deque[can.Message] = deque()
        self._quick = bool(settings.get("tcp_tune"))
        super().__init__(**settings)  # type: ignore[no-untyped-call]

    def _apply_filters(self, filters: Sequence[Any] | None) -> None:
        single = filters and all(one["can_mask"] == _ALL for one in filters)
        self._ids = frozenset(b"%03X" % one["can_id"] for one in filters or ()) if single else None

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._ready:
            stream: Any = self._SocketCanDaemonBus__socket  # type: ignore[attr-defined]
            try:
                if not select.select([stream], [], [], timeout)[0]:
                    return None, False
                data = stream.recv(65536)
                if self._quick:
                    stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
            except OSError as error:
                raise can.CanError(f"Failed to receive: {error}") from error
            if not data:
                raise can.CanError("Failed to receive: the server has ended")
            *pieces, self._rest = (self._rest + data).split(b">")
            self._rest = self._rest[-_LONGEST:]
            self._ready.extend(made for piece in pieces if (made := self._message(piece)))
        return (self._ready.popleft(), False) if self._ready else (None, False)

    def _message(self, piece: bytes) -> can.Message | None:
        start = piece.find(b"<")
        if piece.startswith(_FRAME, start) and self._ids is not None:
            word = piece[start + _ID.start : start + _ID.stop].upper()
            if word not in self._ids:
                return None
        return decode(piece[start:].decode("utf-8", "replace") + ">") if start >= 0 else None
