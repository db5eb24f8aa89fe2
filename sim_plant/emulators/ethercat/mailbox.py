"""The mailbox of a slave: boxes through sync managers 0 and 1, counters, repeats, errors.

A box is a header {u16 length, u16 address, u8 channel, u8 type and counter} and its data.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable

from sim_plant.emulators.ethercat.sync_manager import SyncManager

_HEADER = struct.Struct("<HHBB")
HEADER = _HEADER.size
ERROR, COE = 0, 3  # types
UNSUPPORTED_PROTOCOL, INVALID_HEADER, INVALID_SIZE = 2, 5, 8  # details of an error
MAX_WAITING = 32  # boxes for the master that wait; later ones are lost


class Mailbox:
    """Both boxes of one slave, and the queue of those for the master."""

    def __init__(
        self, incoming: SyncManager, outgoing: SyncManager, serve: Callable[[bytes], list[bytes]]
    ) -> None:
        """`serve` answers the data of a CoE box with those of boxes."""
        self.is_silent = False  # a fault: boxes are taken and never answered
        self._incoming, self._outgoing = incoming, outgoing
        self._serve = serve
        self._queue: deque[bytes] = deque()
        self._last_counter = 0  # of the master's last box; 0: none
        self._counter = 0
        self._last_sent = b""
        incoming.on_written = self._on_box
        outgoing.on_read = self._send_next
        outgoing.on_repeat = self._repeat

    def reset(self) -> None:
        """Forget counters and boxes, as in INIT."""
        self._queue.clear()
        self._last_counter = self._counter = 0
        self._last_sent = b""
        self._incoming.release()
        self._outgoing.release()

    def send(self, kind: int, data: bytes) -> None:
        """Queue a box for the master."""
        if len(self._queue) >= MAX_WAITING:
            return
        self._counter = self._counter % 7 + 1
        head = _HEADER.pack(len(data), 0, 0, kind | self._counter << 4)
        self._queue.append(head + data)
        if not self._outgoing.is_full:
            self._send_next()

    def _on_box(self, box: bytes) -> None:
        self._incoming.release()
        if len(box) < HEADER:
            return
        length, _, _, kind = _HEADER.unpack_from(box)
        counter = kind >> 4 & 7
        if counter and counter == self._last_counter:
            return  # the same box again: the answer is on its way
        self._last_counter = counter
        if self.is_silent:
            return
        if length > len(box) - HEADER:
            self._refuse(INVALID_SIZE)
        elif kind & 0x0F != COE:
            self._refuse(UNSUPPORTED_PROTOCOL)
        elif length < 2:
            self._refuse(INVALID_HEADER)
        else:
            for data in self._serve(box[HEADER : HEADER + length]):
                self.send(COE, data)

    def _refuse(self, detail: int) -> None:
        self.send(ERROR, struct.pack("<HH", 1, detail))

    def _send_next(self) -> None:
        if self._queue and self._outgoing.enabled:
            self._last_sent = self._queue.popleft()
            self._outgoing.put(self._last_sent)

    def _repeat(self) -> None:
        """Give the last box again; the one that waits in the area follows it."""
        if not self._last_sent:
            return
        if self._outgoing.is_full and self._outgoing.latest[: len(self._last_sent)] != (
            self._last_sent
        ):
            self._queue.appendleft(self._outgoing.latest)
        self._outgoing.put(self._last_sent)
