"""The Compax3 byte stream: ASCII and binary distinguished, noise counted, splits without effect."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from stream_pieces import drain, pieces

from drivers.compax3 import stream
from drivers.compax3.codec import NO_ADDRESS, Kind, Record, encode_record
from drivers.compax3.text import Reply, ReplyKind, decode_line

RESPONSE = bytes.fromhex("05 05 FF FF FF FF FE 2D 07 B4")
ACK = bytes.fromhex("06 01 00 00 BA 87")

reply_records = st.one_of(
    st.binary(min_size=1, max_size=253).map(lambda d: Record(Kind.RESPONSE, NO_ADDRESS, 0, d)),
    st.just(Record(Kind.ACK, NO_ADDRESS, 0, b"\x00\x00")),
    st.binary(min_size=2, max_size=2).map(lambda d: Record(Kind.NAK, NO_ADDRESS, 0, d)),
)
lines = st.sampled_from(["*>", ">", "!7320", "*12.5", "-3", "Compax3 I10T10", "$C8"])


mixed = st.lists(
    st.one_of(
        st.binary(max_size=8),
        reply_records.map(encode_record),
        lines.map(lambda line: line.encode() + b"\r"),
        st.sampled_from([b"\r", b"9" * 140, b"!12\r", b"\x05", b"\x06\x01"]),
    ),
    max_size=8,
).map(b"".join)


def wire(message: Record | str) -> bytes:
    return message.encode() + b"\r" if isinstance(message, str) else encode_record(message)


def word(message: Record | str) -> Record | Reply:
    return decode_line(message.encode()) if isinstance(message, str) else message


def run(*parts: bytes) -> tuple[stream.State, list[stream.Message]]:
    return drain(stream.feed, stream.start(), parts)


def test_both_kinds_come_out_in_order() -> None:
    state, messages = run(b"*12.5\r" + ACK + b">\r" + RESPONSE)
    answers = [message.kind for message in messages]
    assert answers == [ReplyKind.VALUE, Kind.ACK, ReplyKind.ACCEPTED, Kind.RESPONSE]
    assert state == stream.start()


def test_a_line_feed_after_the_return_is_ignored() -> None:
    state, messages = run(b"1\r\n2\r\n")
    assert [m.value for m in messages if isinstance(m, Reply)] == [1.0, 2.0]
    assert state == stream.start()


def test_the_tail_of_a_broken_number_is_rejected() -> None:
    state, messages = run(b"12\x80.5\r" + b"7\r")
    assert [m.value for m in messages if isinstance(m, Reply)] == [7.0]
    assert state.dropped == 5


def test_a_line_that_is_no_reply_is_counted() -> None:
    state, messages = run(b"!12\r>\r")
    assert [m.kind for m in messages if isinstance(m, Reply)] == [ReplyKind.ACCEPTED]
    assert (state.bad_lines, state.dropped) == (1, 3)


def test_an_endless_line_is_dropped() -> None:
    state, messages = run(*[b"9" * 50] * 1000, b"\r>\r")
    assert len(state.pending) <= stream.MAX_LINE
    assert [m.kind for m in messages if isinstance(m, Reply)] == [ReplyKind.ACCEPTED]
    assert (state.bad_lines, state.dropped) == (1, 50_000)


def test_a_record_with_a_flipped_bit_is_counted_and_the_next_comes() -> None:
    bad = bytearray(RESPONSE)
    bad[4] ^= 0x10
    state, messages = run(bytes(bad) + RESPONSE)
    assert len(messages) == 1
    assert state.bad_records >= 1
    assert state.dropped == len(RESPONSE)


def test_a_false_start_delays_messages_until_the_pause() -> None:
    state, messages = run(b"\x05\xf0" + ACK)  # 241 data bytes are promised
    assert messages == []
    state, messages = stream.flush_stalled(state)
    assert messages == [Record(Kind.ACK, NO_ADDRESS, 0, b"\x00\x00")]
    assert (state.pending, state.dropped) == (b"", 2)


def test_after_a_pause_half_a_line_is_gone_and_a_new_one_may_begin() -> None:
    state, _ = run(b"12")
    state, messages = stream.flush_stalled(state)
    assert messages == []
    _, messages = stream.feed(state, b"3\r")
    assert [m.value for m in messages if isinstance(m, Reply)] == [3.0]


def test_a_pause_between_messages_has_no_effect() -> None:
    state, _ = run(ACK)
    assert stream.flush_stalled(state) == (state, [])


@given(st.lists(reply_records | lines, max_size=6), st.lists(st.integers(0, 2000), max_size=8))
def test_clean_messages_come_out_however_they_are_split(
    sent: list[Record | str], cuts: list[int]
) -> None:
    data = b"".join(map(wire, sent))
    state, messages = drain(stream.feed, stream.start(), pieces(data, cuts))
    assert messages == [word(message) for message in sent]
    assert state == stream.start()


@given(st.data(), st.lists(st.integers(0, 2000), max_size=10))
def test_splits_have_no_effect_on_any_bytes(drawn: st.DataObject, cuts: list[int]) -> None:
    data = drawn.draw(mixed)
    expected = drain(stream.feed, stream.start(), [data])
    assert drain(stream.feed, stream.start(), pieces(data, cuts)) == expected
    paused, _ = stream.flush_stalled(expected[0])
    assert paused.pending == b""


noise = st.lists(
    st.integers(0, 255).filter(lambda byte: byte not in (5, 6, 7)), min_size=1, max_size=30
).map(bytes)


@given(st.lists(st.tuples(noise, reply_records), min_size=1, max_size=5))
def test_records_come_through_noise_that_holds_no_start_code(
    sent: list[tuple[bytes, Record]],
) -> None:
    """Text in the noise may look like a line, which no parser can detect; records are complete."""
    data = b"".join(before + encode_record(record) for before, record in sent)
    _, messages = drain(stream.feed, stream.start(), [data])
    records = [message for message in messages if isinstance(message, Record)]
    assert records == [record for _, record in sent]


@given(st.binary(max_size=300), reply_records)
def test_after_any_noise_and_a_pause_the_next_record_comes(data: bytes, record: Record) -> None:
    state, _ = drain(stream.feed, stream.start(), [data])
    state, _ = stream.flush_stalled(state)
    state, messages = stream.feed(state, encode_record(record))
    assert messages == [record]


@given(mixed)
def test_every_byte_is_accounted_for(data: bytes) -> None:
    """A byte is in a message, dropped, pending, or the end of a line."""
    state, messages = drain(stream.feed, stream.start(), [data])
    in_records = sum(len(encode_record(m)) for m in messages if isinstance(m, Record))
    in_lines = sum(len(m.text) + m.starred for m in messages if isinstance(m, Reply))
    ends = data.count(b"\r") + data.count(b"\n")
    blanks = data.count(b" ")
    unaccounted = len(data) - in_records - in_lines - state.dropped - len(state.pending)
    assert 0 <= unaccounted <= ends + blanks


def test_only_replies_are_parsed() -> None:
    """The link removes an echoed request (two-wire adapter), not the parser."""
    state, messages = run(bytes.fromhex("A5 03 02 02 A8 05 E1 46") + ACK)
    state, more = stream.flush_stalled(state)
    assert [m for m in messages + more if isinstance(m, Record)] == [
        Record(Kind.ACK, NO_ADDRESS, 0, b"\x00\x00")
    ]
