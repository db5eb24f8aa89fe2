"""The link on a kernel's SocketCAN: received and sent frames, a bus that fails and recovers.

The tests check functions only: times on this kernel have no meaning.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest
from kernel_can import (
    BUS,
    BUS_OFF,
    ERROR,
    EXTENDED,
    NAME,
    REMOTE,
    needs_kernel,
    raw_socket,
    slow_interface,
    switch,
)

from drivers.canopen.link import Frame, Link, LinkError

pytestmark = needs_kernel
STATUS, OTHER, COMMAND = 0x185, 0x186, 0x205


@pytest.fixture
def link() -> Iterator[Link]:
    near_link = Link(BUS, {STATUS, OTHER})
    yield near_link
    near_link.close()


@pytest.fixture
def far() -> Iterator[Link]:
    far_link = Link(BUS, {COMMAND})
    yield far_link
    far_link.close()


def test_frames_go_both_ways_and_keep_their_order(link: Link, far: Link) -> None:
    assert not link.send([(COMMAND, bytes([number])) for number in range(20)])
    assert far.drain() == [Frame(COMMAND, bytes([number])) for number in range(20)]
    assert not far.send([(STATUS, b"")])
    assert not far.send([(OTHER, bytes(range(8)))])
    assert link.drain() == [Frame(STATUS, b""), Frame(OTHER, bytes(range(8)))]
    assert (link.unsent, link.errors, far.unsent, far.errors) == (0, 0, 0, 0)


def test_own_frames_are_excluded_but_other_local_sockets_receive_them(link: Link) -> None:
    twin = Link(BUS, {STATUS})
    assert not link.send([(STATUS, b"\x01")])
    assert link.drain() == []
    assert twin.drain() == [Frame(STATUS, b"\x01")]
    twin.close()


def test_the_kernel_filters_other_ids(link: Link) -> None:
    with raw_socket() as far:
        for identifier in (*range(0x181, 0x185), *range(0x187, 0x200)):
            far.send(identifier, b"\x01")
        far.send(STATUS | EXTENDED, b"\x02")
        far.send(STATUS | REMOTE, length=8)
        far.send(STATUS, b"\x03")
    assert link.drain(max_frames=2) == [Frame(STATUS, b"\x03")], (
        "other frames do not count towards the maximum"
    )


def test_error_frames_are_counted_and_are_no_data(link: Link) -> None:
    with raw_socket() as far:
        far.send(ERROR | BUS_OFF, bytes(8))
        far.send(ERROR | STATUS, bytes(8))
        far.send(STATUS, b"\x01")
    assert link.drain() == [Frame(STATUS, b"\x01")]
    assert link.errors == 2


def test_a_bus_that_goes_down_is_counted_and_serves_again_when_it_is_up(
    link: Link, far: Link
) -> None:
    switch(NAME, up=False)
    try:
        assert far.drain() == []
        assert far.errors == 1
        assert list(link.send([(COMMAND, b"\x01")] * 3)) == [0, 1, 2]
        assert link.drain() == []
        assert (link.unsent, link.errors) == (3, 0), "each socket gets the error once"
    finally:
        switch(NAME, up=True)
    assert not link.send([(COMMAND, b"\x02")])
    assert far.drain() == [Frame(COMMAND, b"\x02")]
    assert not far.send([(STATUS, b"\x03")])
    assert link.drain() == [Frame(STATUS, b"\x03")]


def test_a_babbling_node_takes_its_bound_and_the_newest_frames_are_lost(link: Link) -> None:
    with raw_socket() as far:
        for number in range(3000):
            far.send(OTHER, number.to_bytes(2, "little"))
    first = link.drain()
    assert [int.from_bytes(frame.data, "little") for frame in first] == list(range(64))
    reads = 1
    while link.drain():
        reads += 1
    assert reads < 3000 / 64, "the kernel's own buffer ends"
    with raw_socket() as far:
        far.send(STATUS, b"\x01")
    assert link.drain() == [Frame(STATUS, b"\x01")]


def test_a_full_transmit_buffer_refuses_at_once() -> None:
    with slow_interface() as slow:
        link = Link(BUS._replace(channel=slow.name), {STATUS})
        sent = 0
        while not link.send([(COMMAND, bytes(8))]) and sent < 20_000:
            sent += 1
        assert 10 <= sent < 20_000
        assert link.unsent == 1
        assert link.send([(COMMAND, bytes(8))])
        assert link.drain() == []
        assert link.errors == 0
        link.close()


def test_an_interface_that_is_pulled_out_is_counted() -> None:
    with slow_interface() as slow:
        link = Link(BUS._replace(channel=slow.name), {STATUS})
        slow.hang_up()
        assert list(link.send([(COMMAND, b"")])) == [0]
        assert link.drain() == []
        assert (link.unsent, link.errors) == (1, 1)
        link.close()


@pytest.mark.filterwarnings("ignore:unclosed <socket:ResourceWarning")  # left open by the library
def test_an_interface_that_is_not_there_is_named() -> None:
    message = ""
    try:
        Link(BUS._replace(channel="can99"), {STATUS})
    except LinkError as error:
        message = str(error)
    gc.collect()
    assert message.startswith("CAN bus socketcan can99: ")
    assert "No such device" in message
