"""The mailbox: the newest complete value, never a partial one."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import pytest
from core_process import output, start
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from rig.processes import mailbox
from rig.processes.mailbox import Mailbox, SupervisorMessage


class Meter(NamedTuple):
    power: Annotated[float, "W"]
    count: Annotated[int, "count"]


@pytest.fixture
def fd() -> Iterator[int]:
    mailbox_fd = mailbox.create()
    yield mailbox_fd
    os.close(mailbox_fd)


def test_an_empty_mailbox_reads_none(fd: int) -> None:
    assert Mailbox(fd, SupervisorMessage).read() is None


@settings(max_examples=examples(50))
@given(
    st.lists(st.tuples(st.floats(allow_nan=False), st.integers(-(2**63), 2**63 - 1)), max_size=9)
)
def test_every_reader_gets_the_newest_value(values: list[tuple[float, int]]) -> None:
    mailbox_fd = mailbox.create()
    try:
        sender, early = Mailbox(mailbox_fd, Meter), Mailbox(mailbox_fd, Meter)
        for value in values:
            sender.post(Meter(*value))
            assert early.read() == value
            assert isinstance(early.read(), Meter)
            assert early.read() is early.read()  # a level: it persists
        late = Mailbox(mailbox_fd, Meter).read()
        assert late == (values[-1] if values else None)
    finally:
        os.close(mailbox_fd)


def write_slot(fd: int, before: int, after: int, payload: bytes = b"") -> None:
    """Write sequence numbers and value as an interrupted writer might have left them."""
    os.pwrite(fd, struct.pack("<q", before), 0)
    os.pwrite(fd, struct.pack("<q", after), 8)
    if payload:
        os.pwrite(fd, payload, 16)


def test_an_interrupted_write_leaves_the_old_value(fd: int) -> None:
    sender, reader = Mailbox(fd, Meter), Mailbox(fd, Meter)
    sender.post(Meter(1.0, 1))
    assert reader.read() == (1.0, 1)
    half = struct.pack("<d", 2.0)
    write_slot(fd, 2, 1, half)  # sequence taken, half of the value written
    assert reader.read() == (1.0, 1)
    assert Mailbox(fd, Meter).read() is None  # a new reader finds no complete value
    write_slot(fd, 2, 2, half + struct.pack("<q", 2))
    assert reader.read() == (2.0, 2)


def test_a_value_that_changes_while_being_read_is_discarded(fd: int) -> None:
    sender, reader = Mailbox(fd, Meter), Mailbox(fd, Meter)
    sender.post(Meter(1.0, 1))
    assert reader.read() == (1.0, 1)
    sender.post(Meter(2.0, 2))
    plain = reader._layout

    class Meddling:
        """Starts another post in the middle of the read."""

        def unpack_from(self, *arguments: Any) -> Any:
            write_slot(fd, 3, 2)
            return plain.unpack_from(*arguments)

    reader._layout = Meddling()
    assert reader.read() == (1.0, 1)
    reader._layout = plain
    write_slot(fd, 3, 3, struct.pack("<dq", 3.0, 3))
    assert reader.read() == (3.0, 3)


def test_a_writer_that_died_while_writing_is_replaced(fd: int) -> None:
    first, reader = Mailbox(fd, Meter), Mailbox(fd, Meter)
    first.post(Meter(1.0, 1))
    write_slot(fd, 2, 1)
    Mailbox(fd, Meter).post(Meter(5.0, 5))
    assert reader.read() == (5.0, 5)


def test_a_value_of_another_type_is_refused(fd: int) -> None:
    fields = [(f"f{i}", Annotated[float, "m"]) for i in range(os.sysconf("SC_PAGE_SIZE") // 8)]
    with pytest.raises(ValueError, match="Wide does not fit"):
        Mailbox(fd, NamedTuple("Wide", fields))


def test_a_post_from_another_process_arrives(fd: int) -> None:
    reader = Mailbox(fd, SupervisorMessage)
    code = (
        "import sys; from rig.processes.mailbox import Mailbox, SupervisorMessage as M;"
        "m = Mailbox(int(sys.argv[1]), M); [m.post(M(0.5, n)) for n in range(1, 4)];"
        "print(m.read())"
    )
    expected = "SupervisorMessage(heartbeat=0.5, code=3, armed=0, live=0, jump=0, segment=0)"
    assert output(code, fd).strip() == expected
    assert reader.read() == (0.5, 3, 0, 0, 0, 0)


def test_values_of_a_busy_writer_are_whole(fd: int) -> None:
    code = (
        "import sys\n"
        "from test_core_mailbox import Meter; from rig.processes.mailbox import Mailbox\n"
        "m = Mailbox(int(sys.argv[1]), Meter)\n"
        "for n in range(1, 200_000): m.post(Meter(n * 0.5, n))\n"
    )
    process, reader, values = start(code, fd), Mailbox(fd, Meter), []
    try:
        while not values or values[-1] < 199_999:
            value = reader.read()
            if value is not None and (not values or value.count != values[-1]):
                assert value.power == value.count * 0.5
                values.append(value.count)
            assert process.poll() in (None, 0)
    finally:
        process.kill()
        process.communicate()
    assert values == sorted(values)
