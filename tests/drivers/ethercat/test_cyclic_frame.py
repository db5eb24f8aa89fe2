"""Frames of a segment: golden bytes, any bytes, and the frame of a tick as slaves return it."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import CodecError
from drivers.ethercat.frames import Command, CyclicFrame, Datagram, decode, encode

# A broadcast read of the type register of a segment, as any master begins (IEC 61158-4-12).
BRD_TYPE = bytes.fromhex(
    "ffffffffffff 020101010101 88a4"  # to all, from, type
    "0e10"  # 14 bytes, type 1
    "07 05 0000 0000 0200 0000"  # BRD, index 5, address 0, register 0, 2 bytes, no interrupt
    "0000 0000"  # data, working counter
)


def test_a_golden_frame() -> None:
    frame = encode((Datagram(Command.BRD, 5, 0, bytes(2)),))
    assert frame[: len(BRD_TYPE)] == BRD_TYPE
    assert len(frame) == 60
    assert set(frame[len(BRD_TYPE) :]) == {0}
    assert decode(frame) == (Datagram(Command.BRD, 5, 0, bytes(2)),)


@given(
    st.lists(
        st.builds(
            Datagram,
            st.sampled_from(Command),
            st.integers(0, 255),
            st.integers(0, 2**32 - 1),
            st.binary(max_size=60),
            st.integers(0, 0xFFFF),
        ),
        min_size=1,
        max_size=15,
    )
)
def test_datagrams_survive_a_frame(datagrams: list[Datagram]) -> None:
    assert decode(encode(tuple(datagrams))) == tuple(datagrams)


@given(st.binary(max_size=100), st.integers(0, 99), st.integers(0, 255))
def test_any_bytes_are_datagrams_or_refused(data: bytes, at: int, value: int) -> None:
    valid = bytearray(encode((Datagram(1, 2, 3, bytes(20)), Datagram(4, 5, 6, bytes(9)))))
    valid[at % len(valid)] = value
    for frame in (data, bytes(valid), bytes(valid)[:at]):
        try:
            found = decode(frame)
        except CodecError:
            continue
        assert sum(len(each.data) for each in found) <= len(frame)


@pytest.mark.parametrize("clock", [None, 0x1001])
def test_the_cyclic_frame_holds_what_a_tick_needs(clock: int | None) -> None:
    frame = CyclicFrame(12, clock)
    frame.outputs[:] = bytes(range(12))
    frame.set_number(77, 2**40 + 5)
    data, status, number, *time = decode(bytes(frame.bytes))
    assert data == Datagram(Command.LRW, 77, 0, bytes(range(12)))
    assert (status.command, status.address, len(status.data)) == (Command.BRD, 0x0130 << 16, 2)
    assert (number.command, number.data) == (Command.NOP, struct.pack("<Q", 2**40 + 5))
    assert [(one.command, one.address) for one in time] == (
        [(Command.FRMW, 0x1001 | 0x0910 << 16)] if clock else []
    )


@given(
    st.binary(min_size=12, max_size=12), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF),
    st.integers(0, 0xFFFF), st.integers(0, 2**64 - 1), st.integers(0, 0xFFFF),
)  # fmt: skip
def test_an_answer_is_read_as_slaves_change_it(
    inputs: bytes, wkc: int, status: int, slaves: int, time_ns: int, interrupt: int
) -> None:
    frame = CyclicFrame(12, 0x1001)
    frame.set_number(20, 9)
    data, al_status, number, clock = decode(bytes(frame.bytes))
    answer = bytearray(
        encode(
            (
                data._replace(data=inputs, wkc=wkc),
                # Every slave adds 1 to the low word of a broadcast's address.
                al_status._replace(
                    address=al_status.address + slaves, data=struct.pack("<H", status), wkc=slaves
                ),
                number,
                clock._replace(data=struct.pack("<Q", time_ns), wkc=1),
            )
        )
    )
    struct.pack_into("<H", answer, 24, interrupt)
    answer[6] |= 2  # a slave marks the source address
    assert frame.is_answer(answer, len(answer))
    assert bytes(frame.process_data(answer)) == inputs
    assert frame.read(answer) == (9, wkc, slaves, status, time_ns)
    other = bytearray(encode((Datagram(Command.LRW, 20, 0, bytes(13)),)))
    assert not frame.is_answer(other, len(other))
    assert not frame.is_answer(answer, len(answer) - 1)


@pytest.mark.parametrize("size", [0, -1, 1401])
def test_process_data_must_fit_a_frame(size: int) -> None:
    with pytest.raises(CodecError, match="1 to 1400 bytes"):
        CyclicFrame(size, None)
