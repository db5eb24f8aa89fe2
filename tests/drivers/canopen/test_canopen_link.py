"""The link where the kernel needs no CAN: in one process, slcan on a pty, multicast."""

from __future__ import annotations

import os
import pty
import select
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import can
import pytest

from drivers.canopen import link as link_module
from drivers.canopen.bus_settings import BusSettings, unsupported_rate
from drivers.canopen.link import Frame, Link, LinkError

STATUS, OTHER, STRANGE, COMMAND = 0x185, 0x186, 0x187, 0x205
BUS = BusSettings("virtual", "link", 1_000_000, ())


@pytest.fixture
def link() -> Iterator[Link]:
    one = Link(BUS, {STATUS, OTHER})
    yield one
    one.close()


@pytest.fixture
def far() -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel="link") as bus:
        yield bus


def frame(identifier: int, data: bytes = b"", **flags: Any) -> can.Message:
    return can.Message(**{"is_extended_id": False, **flags}, arbitration_id=identifier, data=data)


def drained(link: Link, count: int, timeout_s: float = 5.0) -> list[Frame]:
    """Return the frames received until there are ``count``."""
    frames: list[Frame] = []
    end = time.monotonic() + timeout_s
    while len(frames) < count and time.monotonic() < end:
        frames += link.drain()
    return frames


def test_frames_go_both_ways(link: Link, far: can.BusABC) -> None:
    assert not link.send([(COMMAND, b"\x01\x02")])
    received = far.recv(1.0)
    assert received is not None
    assert (received.arbitration_id, received.is_extended_id) == (COMMAND, False)
    assert bytes(received.data) == b"\x01\x02"
    far.send(frame(STATUS, b"\x03"))
    far.send(frame(OTHER))
    assert link.drain() == [Frame(STATUS, b"\x03"), Frame(OTHER, b"")]
    assert link.drain() == []
    assert (link.unsent, link.errors) == (0, 0)


def test_frames_of_other_ids_hide_no_later_frame(link: Link, far: can.BusABC) -> None:
    far.send(frame(STRANGE))
    far.send(frame(STATUS, b"\x01"))
    far.send(frame(STRANGE))
    far.send(frame(OTHER, b"\x02"))
    assert link.drain() == [Frame(STATUS, b"\x01"), Frame(OTHER, b"\x02")]


def test_only_11_bit_data_frames_are_returned(link: Link, far: can.BusABC) -> None:
    far.send(frame(STATUS, b"\x01", is_extended_id=True))
    far.send(frame(STATUS, is_remote_frame=True, dlc=8))
    far.send(frame(STATUS, b"\x02"))
    assert link.drain() == [Frame(STATUS, b"\x02")]


def test_error_frames_are_counted(link: Link, far: can.BusABC) -> None:
    far.send(frame(0x40, bytes(8), is_error_frame=True))
    far.send(frame(STATUS, b"\x01"))
    assert link.drain() == [Frame(STATUS, b"\x01")]
    assert link.errors == 1


@pytest.mark.parametrize("identifier", [OTHER, STRANGE])
def test_a_babbling_node_is_bounded_per_drain(identifier: int, link: Link, far: can.BusABC) -> None:
    for number in range(100):
        far.send(frame(identifier, bytes([number])))
    far.send(frame(STATUS))
    first, second = link.drain(), link.drain()
    if identifier == OTHER:
        assert [one.data[0] for one in first] == list(range(64)), "oldest first, none lost"
    assert second[-1] == Frame(STATUS, b"")
    assert link.drain(max_frames=0) == []


def test_a_marked_frame_of_another_local_process_is_received(link: Link) -> None:
    """A kernel's SocketCAN marks all that was sent on this host as if it were our own."""
    bus: Any = can.Bus(interface="virtual", channel="link", receive_own_messages=True)
    try:
        marked = frame(STATUS, b"\x01", is_rx=False)
        link._bus.queue.put(marked)  # type: ignore[attr-defined]
        assert link.drain() == [Frame(STATUS, b"\x01")]
    finally:
        bus.shutdown()


def test_a_lost_bus_is_counted_and_raises_nothing(link: Link) -> None:
    link.close()
    assert list(link.send([(COMMAND, b"")])) == [0]
    assert link.drain() == []
    assert (link.unsent, link.errors) == (1, 1)
    link.close()


@pytest.mark.parametrize(
    "error", [can.CanOperationError("x"), OSError(), ValueError(), IndexError()]
)
def test_whatever_an_interface_raises_is_counted(
    error: Exception, link: Link, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise error

    with monkeypatch.context() as patch:
        for name in ("send", "recv", "shutdown"):
            patch.setattr(link._bus, name, fails)
        assert list(link.send([(COMMAND, b"")])) == [0]
        assert link.drain() == []
        link.close()
    assert (link.unsent, link.errors) == (1, 2)


def unserved() -> int:
    """Return a TCP port on which no server listens."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


@pytest.mark.parametrize(
    ("bus", "text"),
    [
        (BusSettings("nonsense", "can0", 1, ()), "CAN bus nonsense can0: "),
        (BusSettings("socketcan", "can99", 1, ()), "CAN bus socketcan can99: "),
        (BusSettings("slcan", "/nowhere", 1_000_000, ()), "CAN bus slcan /nowhere: "),
        (BusSettings("slcan", "", 1_000_000, ()), "CAN bus slcan : Must specify a serial port."),
        (BusSettings("socketcand", "can0", 1, ()), "CAN bus socketcand can0: .*host"),
        (BusSettings("pcan", "PCAN_USBBUS1", 1_000_000, ()), "CAN bus pcan PCAN_USBBUS1: "),
    ],
)
@pytest.mark.filterwarnings(
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)
def test_a_bus_that_cannot_be_opened_is_named(bus: BusSettings, text: str) -> None:
    with pytest.raises(LinkError, match="^" + text):
        Link(bus, {STATUS})


def test_slcan_is_refused_above_what_it_can_do() -> None:
    bus = BusSettings("slcan", "/dev/ttyACM0", 1_000_000, ())
    assert unsupported_rate(bus, 100.0) == ""
    assert unsupported_rate(bus, 100.1) == (
        "slcan on /dev/ttyACM0 cannot be cycled at 100.1 Hz: an empty look at it takes 1.1 ms; "
        "at most 100 Hz"
    )
    assert unsupported_rate(bus._replace(interface="socketcan"), 1000.0) == ""


class Adapter:
    """The far end of a serial line that speaks slcan."""

    def __init__(self) -> None:
        self.far, near = pty.openpty()
        self.path = os.ttyname(near)
        self._near = near

    def send_text(self, text: str) -> None:
        os.write(self.far, text.encode())

    def received_text(self, enough: Callable[[str], object]) -> str:
        """Return the text received until ``enough`` holds."""
        received = ""
        while not enough(received) and select.select([self.far], [], [], 5.0)[0]:
            received += os.read(self.far, 1000).decode()
        return received

    def close(self) -> None:
        os.close(self._near)
        os.close(self.far)


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    one = Adapter()
    yield one
    one.close()


@pytest.fixture
def serial_link(adapter: Adapter) -> Iterator[Link]:
    options = (("sleep_after_open", 0.0),)
    one = Link(BusSettings("slcan", adapter.path, 1_000_000, options), {STATUS, OTHER})
    assert (
        adapter.received_text(lambda text: text.endswith("O\r")).replace("\r", " ").split()[-1]
        == "O"
    )
    yield one
    one.close()


def test_slcan_carries_frames_over_a_serial_line(adapter: Adapter, serial_link: Link) -> None:
    assert not serial_link.send([(COMMAND, b"\x37\x02")])
    assert adapter.received_text(lambda text: "\r" in text) == "t20523702\r"
    adapter.send_text("t18520102\rt1870\rT000001851FF\rr1858\rt1860\r")
    assert drained(serial_link, 2) == [Frame(STATUS, b"\x01\x02"), Frame(OTHER, b"")]


@pytest.mark.parametrize("text", ["T1\r", "tZZZ0\r", "t1\r", "t18521\r", "\x07", "\r\r", "hello\r"])
def test_slcan_text_that_is_no_frame_is_passed_over(
    text: str, adapter: Adapter, serial_link: Link
) -> None:
    adapter.send_text(text + "t18510A\r")
    assert drained(serial_link, 1)[-1] == Frame(STATUS, b"\x0a")


def test_a_serial_line_that_hangs_up_is_counted(adapter: Adapter, serial_link: Link) -> None:
    os.close(adapter.far)
    adapter.far = os.dup(adapter._near)
    end = time.monotonic() + 5.0
    while serial_link.errors == 0 and time.monotonic() < end:
        assert serial_link.drain() == []
    assert serial_link.errors > 0
    serial_link.send([(COMMAND, b"")])
    assert serial_link.unsent == 1


def test_multicast_gives_back_what_was_sent_and_the_link_keeps_it_out() -> None:
    pytest.importorskip("msgpack", reason="udp_multicast of python-can needs msgpack")
    bus = BusSettings("udp_multicast", "239.74.163.2", 1_000_000, (("port", unserved()),))
    link, far = Link(bus, {STATUS}), Link(bus, {COMMAND})
    try:
        if link.send([(COMMAND, b"\x01")]):
            pytest.skip("this host has no route for multicast")
        assert drained(far, 1) == [Frame(COMMAND, b"\x01")]
        assert not far.send([(STATUS, b"\x02")])
        assert drained(link, 1) == [Frame(STATUS, b"\x02")], "and not its own command"
        assert link.drain() == far.drain() == []
        assert link.errors == far.errors == 0
    finally:
        link.close()
        far.close()


def test_the_library_says_no_more_than_errors() -> None:
    assert link_module.logging.getLogger("can").level == link_module.logging.ERROR
