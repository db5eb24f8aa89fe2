"""The UDP link on loopback: it never waits, accepts only its peer, and counts losses."""

from __future__ import annotations

import itertools
import socket
import time
from collections.abc import Callable, Iterator

import pytest

from drivers.errors import LinkError
from drivers.udp_link import MAX_PAUSE, MIN_PAUSE, UdpLink, UdpSettings


@pytest.fixture
def box() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as socket_of_box:
        socket_of_box.bind(("127.0.0.1", 0))
        socket_of_box.settimeout(2.0)
        yield socket_of_box


def link_to(box: socket.socket, buffer: int = 1 << 20) -> UdpLink:
    link = UdpLink(UdpSettings("load cell", "127.0.0.1", box.getsockname()[1], buffer))
    link.open()
    return link


def until(true: Callable[[], object], within: float = 5.0) -> bool:
    end = time.monotonic() + within
    while not true():
        if time.monotonic() > end:
            return False
        time.sleep(0.002)
    return True


def test_datagrams_come_whole_in_order_and_are_counted(box: socket.socket) -> None:
    link = link_to(box)
    assert link.receive() == []
    assert link.send(b"start")
    received, host = box.recvfrom(100)
    assert received == b"start"
    expected = [bytes((n,)) * (n + 1) for n in range(10)]
    for one in expected:
        box.sendto(one, host)
    got: list[bytes] = []
    assert until(lambda: got.extend(link.receive()) or len(got) == 10)
    assert got == expected
    assert (link.received, link.sent, link.dropped) == (55, 5, 0)
    assert link.buffer > 0
    link.close()
    assert not link.is_open


def test_datagrams_of_another_host_are_ignored(box: socket.socket) -> None:
    link = link_to(box)
    link.send(b"start")
    _, host = box.recvfrom(100)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(b"not for you", host)
    box.sendto(b"yes", host)
    got: list[bytes] = []
    assert until(lambda: got.extend(link.receive()) or got)
    assert got == [b"yes"]
    link.close()


def test_dropped_datagrams_are_counted(box: socket.socket) -> None:
    link = link_to(box, buffer=4096)
    link.send(b"start")
    _, host = box.recvfrom(100)
    for _ in range(200):
        box.sendto(bytes(500), host)
    got = link.receive()
    assert 0 < len(got) < 200
    box.sendto(b"the next one says how many", host)
    assert until(link.receive)
    assert link.dropped == 200 - len(got)
    link.close()


def test_a_box_that_is_off_is_counted_and_may_come_later(box: socket.socket) -> None:
    port = box.getsockname()[1]
    link = link_to(box)
    box.close()
    link.send(b"start")
    assert until(lambda: link.receive() == [] and link.refused)
    assert link.is_open
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as reopened:
        reopened.bind(("127.0.0.1", port))
        reopened.settimeout(2.0)
        assert until(lambda: link.send(b"start"))
        assert reopened.recv(100) == b"start"
    link.close()


@pytest.mark.parametrize("host", ["load-cell.local", "192.168.1", "", "127.0.0.1:5"])
def test_only_addresses_in_numbers(host: str) -> None:
    link = UdpLink(UdpSettings("load cell", host, 49152))
    with pytest.raises(LinkError, match=f"^load cell at {host}:49152: "):
        link.open()
    assert link.problem
    assert not link.send(b"x")
    assert link.unsent == 1


def test_the_pause_between_attempts_doubles() -> None:
    now = [5.0]
    link = UdpLink(UdpSettings("load cell", "nowhere", 49152), clock=lambda: now[0])
    attempts = []
    for _ in range(3000):
        now[0] += 0.01
        link.problem = ""
        link.receive()
        if link.problem:
            attempts.append(now[0])
    gaps = [b - a for a, b in itertools.pairwise(attempts)]
    expected = [min(MIN_PAUSE * 2**n, MAX_PAUSE) for n in range(len(gaps))]
    assert len(gaps) > 7
    assert gaps == pytest.approx(expected, abs=0.011)


def test_one_receive_is_bounded(box: socket.socket) -> None:
    link = link_to(box)
    link.send(b"start")
    _, host = box.recvfrom(100)
    for _ in range(300):
        box.sendto(b"x", host)
    assert until(lambda: len(link.receive()) == 256)
    assert until(lambda: len(link.receive()) == 44)
    link.close()
