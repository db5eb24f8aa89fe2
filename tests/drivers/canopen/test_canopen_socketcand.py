"""The socketcand bus against a minimal server: frames arrive however the stream is split."""

from __future__ import annotations

import re
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen import socketcand_bus
from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.frame_port import BUS_ERRORS, Frame, SocketcandPort
from drivers.canopen.link import LinkError, open_bus, set_receive_filter
from drivers.canopen.socketcand_bus import SocketcandBus

FRAMES = (b"< frame 705 1.5 05 >", b"< frame 185 1.6 AABB >", b"< frame 585 1.7 4300100092010200 >")


class Server:
    """Greets, and then sends the given bytes."""

    def __init__(self, *answers: Sequence[bytes]) -> None:
        """``answers``: pieces that are sent for connecting, open and rawmode, if not the usual."""
        self._answers = answers or ((b"< hi >",), (b"< ok >",), (b"< ok >",))
        self._door = socket.create_server(("127.0.0.1", 0))
        self.port = self._door.getsockname()[1]
        self._peer: socket.socket | None = None
        self._thread = threading.Thread(target=self._greet)
        self._thread.start()

    def _greet(self) -> None:
        self._peer, _ = self._door.accept()
        with suppress(OSError):  # a refused client has closed its socket
            for number, pieces in enumerate(self._answers):
                if number and not self._peer.recv(64):
                    return
                for piece in pieces:
                    self._peer.sendall(piece)
                    time.sleep(0.02 * (len(pieces) > 1))

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
    one = open_bus(BusSettings("socketcand", "can0", 1_000_000, options))
    yield one
    one.shutdown()


def received(bus: can.BusABC, count: int) -> list[tuple[int, bytes]]:
    messages = [bus.recv(2.0) for _ in range(count)]
    return [(one.arbitration_id, bytes(one.data)) for one in messages if one is not None]


def test_all_frames_arrive_until_filtered(server: Server, bus: can.BusABC) -> None:
    server.send(b"".join(FRAMES))
    assert received(bus, 3) == [
        (0x705, b"\x05"), (0x185, b"\xaa\xbb"), (0x585, bytes.fromhex("4300100092010200")),
    ]  # fmt: skip
    set_receive_filter(bus, (0x705, 0x585))
    server.send(b"".join(FRAMES) * 2)
    assert [one for one, _ in received(bus, 4)] == [0x705, 0x585] * 2
    assert bus.recv(0.0) is None


@pytest.mark.parametrize("cut", range(1, len(FRAMES[0]) + len(FRAMES[1])))
def test_a_frame_may_come_in_two_pieces(server: Server, bus: can.BusABC, cut: int) -> None:
    set_receive_filter(bus, (0x705, 0x585))
    data = b"".join(FRAMES)
    server.send(data[:cut])
    first = (
        received(bus, 1) if cut >= len(FRAMES[0]) else [] if bus.recv(0.01) is None else [(0, b"")]
    )
    server.send(data[cut:])
    assert [one for one, _ in first + received(bus, 2 - len(first))] == [0x705, 0x585]


def test_error_frames_pass_the_filter(server: Server, bus: can.BusABC) -> None:
    set_receive_filter(bus, (0x705,))
    server.send(b"< error 20000040 1.5 >" + FRAMES[0])
    message = bus.recv(2.0)
    assert message is not None
    assert message.is_error_frame
    assert message.arbitration_id == 0x40
    assert received(bus, 1) == [(0x705, b"\x05")]


def test_a_server_that_ends_is_an_error(server: Server, bus: can.BusABC) -> None:
    server.close()
    with pytest.raises(can.CanError, match="the server has ended"):
        bus.recv(2.0)


def test_text_without_end_is_not_kept(server: Server, bus: can.BusABC) -> None:
    server.send(b"x" * 200_000)
    for _ in range(400):
        assert bus.recv(0.001) is None
    server.send(b">" + FRAMES[0])
    assert received(bus, 1) == [(0x705, b"\x05")]
    assert len(bus._buffer) <= 256  # type: ignore[attr-defined]


@pytest.fixture
def stream_port(server: Server, bus: can.BusABC) -> SocketcandPort:
    assert isinstance(bus, SocketcandBus)
    return SocketcandPort(bus, (0x705, 0x185))


def looked_at(port: SocketcandPort, count: int) -> list[Frame]:
    """Return the frames of a port as soon as there are ``count``, after 2 s at the latest."""
    frames: list[Frame] = []
    end = time.monotonic() + 2.0
    while len(frames) < count and time.monotonic() < end:
        port.receive(frames, 64)
    return frames


@pytest.mark.parametrize("cut", range(1, len(FRAMES[0]) + len(FRAMES[1])))
def test_a_tick_reads_frames_in_two_pieces(
    server: Server, stream_port: SocketcandPort, cut: int
) -> None:
    data = FRAMES[0] + FRAMES[1]
    server.send(data[:cut])
    first = looked_at(stream_port, 1 if cut >= len(FRAMES[0]) else 0)
    server.send(data[cut:])
    frames = first + looked_at(stream_port, 2 - len(first))
    assert frames == [Frame(0x705, b"\x05"), Frame(0x185, b"\xaa\xbb")]


def test_a_tick_passes_over_what_is_no_frame_for_it(
    server: Server, stream_port: SocketcandPort
) -> None:
    empty, lower, foreign = b"< frame 185 1.7  >", b"< frame 185 1.8 aabb >", FRAMES[2]
    extended = b"< frame 00000185 1.9 AA >"
    server.send(b"noise>" + foreign + extended + b"< ok >< frame 185 <" + empty + lower)
    assert looked_at(stream_port, 2) == [Frame(0x185, b""), Frame(0x185, b"\xaa\xbb")]
    assert stream_port.receive([], 64) == (0, False)


def test_a_tick_knows_identifiers_in_small_letters(server: Server, bus: can.BusABC) -> None:
    assert isinstance(bus, SocketcandBus)
    port = SocketcandPort(bus, (0x18A,))
    server.send(b"< frame 18a 1.0 aa >< frame 18A 1.1 bb >")
    assert looked_at(port, 2) == [Frame(0x18A, b"\xaa"), Frame(0x18A, b"\xbb")]


def test_a_tick_counts_error_frames_and_reports_a_backlog(
    server: Server, stream_port: SocketcandPort
) -> None:
    server.send(b"< error 20000040 1.5 >" + FRAMES[0] * 200)
    time.sleep(0.05)
    frames: list[Frame] = []
    assert stream_port.receive(frames, 64) == (1, True)
    assert 64 <= len(frames) < 200
    looked_at(stream_port, 200 - len(frames))
    assert stream_port.receive([], 64) == (0, False)


def test_a_tick_keeps_what_came_with_the_last_answer() -> None:
    server = Server(HI, OK, (b"< ok >" + EARLY + EARLY[:7],))
    bus = opened(server)
    assert isinstance(bus, SocketcandBus)
    port = SocketcandPort(bus, (0x705,))
    assert looked_at(port, 1) == [Frame(0x705, b"\x05")]
    server.send(EARLY[7:])
    assert looked_at(port, 1) == [Frame(0x705, b"\x05")]
    server.close()
    with pytest.raises(OSError, match=r"the server has ended|reset"):
        looked_at(port, 1)
    bus.shutdown()


class Stream:
    """A stream that takes the given numbers of bytes; None: none, it is full."""

    def __init__(self, *accepted: int | None) -> None:
        self.sent = b""
        self._accepted = list(accepted)

    def send(self, data: bytes, flags: int) -> int:
        assert flags == socket.MSG_DONTWAIT
        accepted = self._accepted.pop(0)
        if accepted is None:
            raise BlockingIOError
        self.sent += data[:accepted]
        return min(accepted, len(data))


COMMANDS = [(0x205, b"\x0f\x00\xd2\x04"), (0x206, b"\x0f\x00\x00\x00"), (0x080, b"")]
COMMAND_TEXT = b"< send 205 4 0f 00 d2 04 >< send 206 4 0f 00 00 00 >< send 080 0  >"


@pytest.mark.parametrize("first", [None, *range(len(COMMAND_TEXT) + 1)])
def test_a_full_stream_refuses_whole_frames(stream_port: SocketcandPort, first: int | None) -> None:
    """However much the stream takes, the server reads only whole frames, each once."""
    stream = Stream(first, 3, 1000, 1000)
    stream_port._stream = stream  # type: ignore[assignment]
    accepted = []
    for commands in (COMMANDS, COMMANDS[:1], COMMANDS[1:2], COMMANDS[2:]):
        refused = stream_port.send(commands)
        accepted += [each for index, each in enumerate(commands) if index not in refused]
    words = [piece.split()[2:] for piece in stream.sent.split(b">")[:-1]]
    assert stream.sent.endswith(b">")
    sent = [(int(w[0], 16), bytes.fromhex(b"".join(w[2:]).decode())) for w in words]
    assert sent == accepted
    assert all(len(data) == int(w[1]) for (_, data), w in zip(sent, words, strict=True))


def test_the_text_of_commands(stream_port: SocketcandPort) -> None:
    stream = Stream(1000)
    stream_port._stream = stream  # type: ignore[assignment]
    assert not stream_port.send(COMMANDS)
    assert stream.sent == COMMAND_TEXT


PIECES = st.sampled_from(
    (b"< ", b"<", b"frame ", b"error ", b"705 ", b"1.5 ", b"05 ", b"zz ", b"\xff", b"20000040 ")
)


@given(st.lists(PIECES, max_size=9), st.sampled_from((None, frozenset((b"705",)))))
def test_no_text_raises_anything_but_what_the_link_counts(
    pieces: list[bytes], ids: frozenset[bytes] | None
) -> None:
    bus = object.__new__(SocketcandBus)
    bus._ids = ids
    with suppress(*BUS_ERRORS):
        message = bus._decode_message(b"".join(pieces))
        assert (
            message is None
            or message.is_error_frame
            or ids is None
            or message.arbitration_id == 0x705
        )


HI, OK = (b"< hi >",), (b"< ok >",)
EARLY = b"< frame 705 0.1 05 >"


def opened(server: Server) -> can.BusABC:
    options = (("host", "127.0.0.1"), ("port", server.port), ("tcp_tune", True))
    return open_bus(BusSettings("socketcand", "can0", 1_000_000, options))


@pytest.mark.parametrize(
    ("answers", "kept"),
    [
        ((HI, OK, (EARLY, b"< ok >")), 0),  # what comes before the answer is dropped
        ((HI, OK, (EARLY + EARLY + b"< ok >",)), 0),
        ((HI, (EARLY + b"< ok >",), (b"< error 20000004 0.2 >< ok >",)), 0),
        (((b"< h", b"i >"), (b"<", b" ok", b" >"), (b"< ok ", b">")), 0),
        ((HI, OK, (EARLY[:9], EARLY[9:] + b"< ok", b" >")), 0),
        ((HI, OK, (b"< ok >" + EARLY + EARLY[:7], EARLY[7:])), 2),  # and what comes after it, kept
        ((HI, OK, (b"\n< ok >\n",)), 0),
    ],
)
def test_frames_before_an_answer_are_not_taken_for_it(
    answers: tuple[tuple[bytes, ...], ...], kept: int
) -> None:
    server = Server(*answers)
    bus = opened(server)
    try:
        server.send(b"< frame 185 1.6 AABB >")
        assert received(bus, kept + 1) == [(0x705, b"\x05")] * kept + [(0x185, b"\xaa\xbb")]
        assert bus.recv(0.0) is None
    finally:
        bus.shutdown()
        server.close()


@pytest.mark.parametrize(
    ("answers", "error"),
    [
        ((HI, (b"< error could not open bus >",)), "refuses < open can0 >: could not open bus"),
        ((HI, OK, (EARLY, b"< error unknown command >")), "refuses < rawmode >: unknown command"),
        ((HI, OK, (b"< nonsense >",)), "answers < rawmode > with '< nonsense >', not '< ok >'"),
        (((b"SSH-2.0-OpenSSH_9.2" * 20,),), "answers connecting with 'SSH-2.0-OpenSSH_9.2"),
    ],
)
def test_an_answer_that_is_an_error_is_named(
    answers: tuple[tuple[bytes, ...], ...], error: str
) -> None:
    server = Server(*answers)
    with pytest.raises(LinkError, match=re.escape(error)):
        opened(server)
    server.close()


def test_a_server_that_ends_or_says_nothing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socketcand_bus, "ANSWER_TIMEOUT", 0.3)
    silent = Server(HI, ())
    with pytest.raises(LinkError, match=re.escape("no answer to < open can0 > in 0.3 s")):
        opened(silent)
    silent.close()
    babbling = Server(HI, (EARLY,) * 40)
    with pytest.raises(LinkError, match=re.escape("no answer to < open can0 > in 0.3 s")):
        opened(babbling)
    with suppress(OSError):
        babbling.close()
