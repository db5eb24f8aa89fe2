"""A pty at a fixed path that can be unplugged and plugged again; the test is its far end."""

from __future__ import annotations

import os
import pty
import select
import tty
from pathlib import Path

from device_peers import Peer


class PtyPort:
    """The far end; `pump` passes received bytes to a peer and sends its answers."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._fds: tuple[int, int] | None = None
        self.plug()

    def plug(self) -> None:
        master, slave = pty.openpty()
        for fd in (master, slave):
            tty.setraw(fd)
        os.set_blocking(master, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(slave))
        self._fds = master, slave

    def pull(self) -> None:
        if self._fds is not None:
            self.path.unlink()
            for fd in self._fds:
                os.close(fd)
            self._fds = None

    def write(self, data: bytes) -> None:
        assert self._fds is not None
        os.write(self._fds[0], data)

    def read(self, within: float = 0.0) -> bytes:
        """Return the bytes of the host received within ``within`` seconds."""
        if self._fds is None or not select.select([self._fds[0]], [], [], within)[0]:
            return b""
        return os.read(self._fds[0], 4096)

    def pump(self, peer: Peer, now: float, by_byte: bool = False) -> None:
        received = self.read()
        answer = b"".join([*(peer.receive(received, now) if received else []), *peer.tick(now)])
        if self._fds is None or not answer:
            return
        for piece in [answer[i : i + 1] for i in range(len(answer))] if by_byte else [answer]:
            self.write(piece)
