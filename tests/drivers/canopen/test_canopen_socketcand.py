"""The socketcand bus against a server of few words: what is wanted comes, however it is cut."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator

import can
import pytest

from drivers.canopen.bus_settings import Bus
from drivers.canopen.link import hear_only, open_bus

FRAMES = (b"< frame 705 1.5 05 >", b"< frame 185 1.6 AABB >", b"< frame 585 1.7 4300100092010200 >")


class Server:
    """It greets, and then sends what it is told to."""

    def __init__(self) -> None:
        self._door = socket.create_server(("127.0.0.1", 0))
        self.port = self._door.getsockname()[1]
        self._peer: socket.socket | None = None
        self._thread = threading.Thread(target=self._greet)
        self._thread.start()

    def _greet(self) -> None:
        self._peer, _ = self._door.accept()
        self._peer.sendall(b"< hi >")
        for _ in ("open", "rawmode"):
            self._peer.recv(64)
            self._peer.sendall(b"< ok >")

    def send(self, data: bytes) -> None:
        self._thread.join(5.0)
        assert self._peer is not None
        self._peer.sendall(data)

    def close(self) -> None:
        self._thread.join(5.0)
        if self._peer is not None:
            self._peer.close()
        self._door.close()


@pytest.fixture
def server() -> Iterator[Server]:
    one = Server()
    yield one
    one.close()


@pytest.fixture
def bus(server: Server) -> Iterator[can.BusABC]:
    options = (("host", "127.0.0.1"), ("port", server.port), ("tcp_tune", True))
    one = open_bus(Bus("socketcand", "can0", 1_000_000, options))
    yield one
    one.shutdown()


def heard(bus: can.BusABC, count: int) -> list[tuple[int, bytes]]:
    found = [bus.recv(2.0) for _ in range(count)]
    return [(one.arbitration_id, bytes(one.data)) for one in found if one is not None]


def test_everything_comes_until_it_is_narrowed(server: Server, bus: can.BusABC) -> None:
    server.send(b"".join(FRAMES))
    assert heard(bus, 3) == [
        (0x705, b"\x05"), (0x185, b"\xaa\xbb"), (0x585, bytes.fromhex("4300100092010200")),
    ]  # fmt: skip
    hear_only(bus, (0x705, 0x585))
    server.send(b"".join(FRAMES) * 2)
    assert [one for one, _ in heard(bus, 4)] == [0x705, 0x585] * 2
    assert bus.recv(0.0) is None


@pytest.mark.parametrize("cut", range(1, len(FRAMES[0]) + len(FRAMES[1])))
def test_a_frame_may_come_in_two_pieces(server: Server, bus: can.BusABC, cut: int) -> None:
    hear_only(bus, (0x705, 0x585))
    data = b"".join(FRAMES)
    server.send(data[:cut])
    first = heard(bus, 1) if cut >= len(FRAMES[0]) else [] if bus.recv(0.01) is None else [(0, b"")]
    server.send(data[cut:])
    assert [one for one, _ in first + heard(bus, 2 - len(first))] == [0x705, 0x585]


def test_an_error_frame_is_heard_when_it_is_narrowed(server: Server, bus: can.BusABC) -> None:
    hear_only(bus, (0x705,))
    server.send(b"< error 20000040 1.5 >" + FRAMES[0])
    message = bus.recv(2.0)
    assert message is not None
    assert message.is_error_frame
    assert message.arbitration_id == 0x40
    assert heard(bus, 1) == [(0x705, b"\x05")]


def test_a_server_that_ends_is_an_error(server: Server, bus: can.BusABC) -> None:
    server.close()
    with pytest.raises(can.CanError, match="the server has ended"):
        bus.recv(2.0)
