"""The mailbox and CoE: counters, repeats, SDO transfers and aborts, SDO information."""

from __future__ import annotations

import struct

import pytest
from frame_master import FPRD, FPWR, INIT, PREOP, SDO_REQUEST, SDO_RESPONSE, FrameMaster
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

ROOM = 128 - 6  # octets of a box behind its header


@pytest.fixture
def master() -> FrameMaster:
    drive_line = FrameMaster("torque_drive", "analog_in")
    drive_line.reach_preop()
    return drive_line


DRIVE, ANALOG = 0, 1
READ_VENDOR = bytes.fromhex("0020 40 1810 01 00000000")


def test_an_expedited_upload_octet_by_octet(master: FrameMaster) -> None:
    request = bytes.fromhex("0a00 0000 00 13") + READ_VENDOR
    assert master.station(FPWR, DRIVE, 0x1000, request.ljust(128, b"\0"))[1] == 1
    assert master.read(DRIVE, 0x0805, 1) == 0  # taken at once
    assert master.read(DRIVE, 0x080D, 1) == 8
    answer, counter = master.station(FPRD, DRIVE, 0x1080, bytes(128))
    assert counter == 1
    assert answer[:16] == bytes.fromhex("0a00 0000 00 13 0030 43 1810 01 c00ead0b")
    assert master.read(DRIVE, 0x080D, 1) == 0


def test_a_repeated_box_is_answered_once(master: FrameMaster) -> None:
    """The same counter is the same box; 0 is none; counters begin anew in INIT."""
    for counter, answers in ((1, True), (1, False), (2, True), (1, True), (7, True), (7, False)):
        assert master.put_box(DRIVE, READ_VENDOR, counter=counter) == 1
        assert (master.get_box(DRIVE) is not None) is answers, counter
    master.request(DRIVE, INIT)
    master.request(DRIVE, PREOP)
    assert master.put_box(DRIVE, READ_VENDOR, counter=7) == 1
    assert master.get_box(DRIVE) is not None


def test_answers_have_counters_of_their_own(master: FrameMaster) -> None:
    seen = []
    for _ in range(9):
        master.put_box(DRIVE, READ_VENDOR)
        data, _ = master.station(FPRD, DRIVE, 0x1080, bytes(128))
        seen.append(data[5] >> 4)
    assert seen == [1, 2, 3, 4, 5, 6, 7, 1, 2]


def test_a_lost_answer_is_repeated(master: FrameMaster) -> None:
    """Toggle of 0x080E bit 1: the last box again, acknowledged in 0x080F bit 1."""
    master.put_box(DRIVE, READ_VENDOR)
    first = master.get_box(DRIVE)
    assert master.get_box(DRIVE) is None
    for toggle in (0x02, 0x00):
        master.write(DRIVE, 0x080E, 0x01 | toggle, 1)
        assert master.read(DRIVE, 0x080F, 1) & 0x02 == toggle
        assert master.get_box(DRIVE) == first
        assert master.get_box(DRIVE) is None
    master.put_box(DRIVE, bytes.fromhex("0020 40 1810 02 00000000"))  # the next one waits
    master.write(DRIVE, 0x080E, 0x03, 1)
    second = master.get_box(DRIVE)
    assert second is not None
    assert second[1][2:6] == bytes.fromhex("43 1810 02")


def test_boxes_wait_until_the_master_takes_them(master: FrameMaster) -> None:
    for sub in (1, 2, 3):
        master.put_box(DRIVE, bytes.fromhex(f"0020 40 1810 0{sub} 00000000"))
    subs = []
    while (box := master.get_box(DRIVE)) is not None:
        subs.append(box[1][5])
    assert subs == [1, 2, 3]


@pytest.mark.parametrize(
    ("kind", "data", "detail"), [(2, bytes(4), 2), (4, bytes(8), 2), (3, b"\0", 5)]
)
def test_boxes_that_are_no_coe(master: FrameMaster, kind: int, data: bytes, detail: int) -> None:
    master.put_box(DRIVE, data, kind)
    assert master.get_box(DRIVE) == (0, struct.pack("<HH", 1, detail))
    master.put_box(DRIVE, READ_VENDOR)
    assert master.get_box(DRIVE) is not None


def test_a_box_longer_than_its_area_is_refused(master: FrameMaster) -> None:
    box = struct.pack("<HHBB", 123, 0, 0, 0x73)
    assert master.station(FPWR, DRIVE, 0x1000, box.ljust(128, b"\0"))[1] == 1
    assert master.get_box(DRIVE) == (0, struct.pack("<HH", 1, 8))


def test_a_slave_without_a_mailbox_has_none() -> None:
    master = FrameMaster("digital_in:4")
    master.reach_preop()
    assert master.slaves[0].mailbox is None
    image = master.slaves[0].eeprom.image
    assert image[0x30:0x3A] == bytes(10)


# ---- SDO --------------------------------------------------------------------------------------


def test_expedited_values_of_every_length(master: FrameMaster) -> None:
    for index, sub, data in (
        (0x6060, 0, b"\x0a"), (0x6071, 0, b"\x34\x12"), (0x8000, 1, struct.pack("<I", 5000)),
    ):  # fmt: skip
        number = ANALOG if index == 0x8000 else DRIVE
        assert master.download(number, index, sub, data) == 0
        assert master.upload(number, index, sub) == int.from_bytes(data, "little")


@pytest.mark.parametrize(
    ("index", "sub", "data", "code"),
    [
        (0x1234, 0, b"\0", 0x06020000),
        (0x1018, 9, b"\0", 0x06090011),
        (0x1018, 1, bytes(4), 0x06010002),
        (0x1008, 0, b"abcd", 0x06010002),
        (0x6071, 0, b"\0", 0x06070013),
        (0x6071, 0, bytes(4), 0x06070012),
        (0x6060, 0, b"\x63", 0x06090030),
        (0x1600, 1, bytes(4), 0x08000022),  # its count is not 0
        (0x1C12, 0, b"\x05", 0x06090031),
    ],
)
def test_aborts(master: FrameMaster, index: int, sub: int, data: bytes, code: int) -> None:
    assert master.download(DRIVE, index, sub, data) == code
    # an abort is an SDO request (service 2)
    service, body = master.coe(DRIVE, SDO_REQUEST, struct.pack("<BHB4x", 0x40, 0x5FFF, 0))
    assert (service, body) == (2, struct.pack("<BHBI", 0x80, 0x5FFF, 0, 0x06020000))


def test_a_text_is_a_normal_transfer(master: FrameMaster) -> None:
    body = master.sdo(DRIVE, struct.pack("<BHB4x", 0x40, 0x1008, 0))
    assert body == struct.pack("<BHBI", 0x41, 0x1008, 0, 12) + b"Torque drive"


def upload(master: FrameMaster, number: int, index: int, sub: int, *, complete: bool) -> bytes:
    """Upload by any transfer, in segments where needed."""
    head = struct.pack("<BHB4x", 0x40 | (0x10 if complete else 0), index, sub)
    service, body = master.coe(number, SDO_REQUEST, head)
    assert service == SDO_RESPONSE, body.hex()
    if body[0] & 0x02:
        return body[4 : 8 - (body[0] >> 2 & 3)]
    (size,) = struct.unpack_from("<I", body, 4)
    data = body[8:]
    toggle = 0
    while len(data) < size:
        part = master.sdo(number, bytes([0x60 | toggle]) + bytes(7))
        assert part[0] & 0x10 == toggle
        unused = part[0] >> 1 & 7 if len(part) == 8 else 0
        data += part[1 : len(part) - unused]
        assert bool(part[0] & 1) == (len(data) == size)
        toggle ^= 0x10
    assert len(data) == size
    return data


def download(
    master: FrameMaster, number: int, index: int, data: bytes, sizes: list[int], *, complete: bool
) -> int:
    """Download in segments of sizes, the last one as long as needed; return the abort code."""
    first, rest = data[: sizes[0]], data[sizes[0] :]
    command = 0x21 | (0x10 if complete else 0)
    answer = master.sdo(number, struct.pack("<BHBI", command, index, 0, len(data)) + first)
    toggle, parts = 0, sizes[1:]
    while rest and answer[0] != 0x80:
        size = parts.pop(0) if parts else ROOM - 3
        part, rest = rest[:size], rest[size:]
        unused = max(0, 7 - len(part))
        segment = bytes([toggle | unused << 1 | (not rest)]) + part.ljust(7, b"\0")
        answer = master.sdo(number, segment)
        assert answer[0] in (0x20 | toggle, 0x80)
        toggle ^= 0x10
    return int.from_bytes(answer[4:8], "little") if answer[0] == 0x80 else 0


MAPPABLE = st.sampled_from([0x60400010, 0x60710010, 0x60600008, 0x00000008])


@given(
    entries=st.lists(MAPPABLE, max_size=32),
    sizes=st.lists(st.integers(1, ROOM - 10), min_size=1, max_size=30),
)  # fmt: skip
@settings(max_examples=examples(60))
def test_segmented_complete_access_both_ways(entries: list[int], sizes: list[int]) -> None:
    master = FrameMaster("torque_drive")
    master.reach_preop()
    data = struct.pack(f"<H{len(entries)}I", len(entries), *entries)
    assert download(master, DRIVE, 0x1600, data, sizes, complete=True) == 0
    assert upload(master, DRIVE, 0x1600, 0, complete=True) == data
    assert master.upload(DRIVE, 0x1600) == len(entries)


def test_the_longest_mapping_takes_segments(master: FrameMaster) -> None:
    entries = [0x60600008] * 32
    data = struct.pack("<H32I", 32, *entries)
    assert len(data) > ROOM - 10
    assert download(master, DRIVE, 0x1600, data, [ROOM - 10], complete=True) == 0
    assert upload(master, DRIVE, 0x1600, 0, complete=True) == data


def test_faulty_segments(master: FrameMaster) -> None:
    start = struct.pack("<BHBI", 0x31, 0x1600, 0, 130) + bytes(20)
    assert master.sdo(DRIVE, start)[0] == 0x70
    body = master.sdo(DRIVE, bytes([0x10]) + bytes(7))  # the first segment has toggle 0
    assert body == struct.pack("<BHBI", 0x80, 0x1600, 0, 0x05030000)
    body = master.sdo(DRIVE, bytes(8))  # the transfer has ended
    assert body[4:] == struct.pack("<I", 0x05040001)
    master.sdo(DRIVE, start)
    assert master.sdo(DRIVE, bytes([0x01]) + bytes(20))[4:] == struct.pack("<I", 0x06070013)
    master.sdo(DRIVE, start)
    for toggle in (0x00, 0x10):
        answer = master.sdo(DRIVE, bytes([toggle]) + bytes(100))
    assert answer[4:] == struct.pack("<I", 0x06070012)
    assert master.sdo(DRIVE, bytes([0x60]) + bytes(7))[4:] == struct.pack("<I", 0x05040001)


def test_a_wrong_entry_of_complete_access_is_refused(master: FrameMaster) -> None:
    data = struct.pack("<HI", 1, 0x60410010)  # the statusword cannot be received
    assert download(master, DRIVE, 0x1600, data, [50], complete=True) == 0x06040041


# ---- SDO information --------------------------------------------------------------------------


def information(master: FrameMaster, request: bytes) -> list[bytes]:
    """Return the fragments of the answer, headers included."""
    assert master.put_box(DRIVE, b"\0\x80" + request) == 1
    fragments = []
    while (box := master.get_box(DRIVE)) is not None:
        assert box[1][:2] == b"\0\x80"
        fragments.append(box[1][2:])
    return fragments


def test_list_of_objects_in_fragments(master: FrameMaster) -> None:
    counts = information(master, struct.pack("<BBHH", 1, 0, 0, 0))
    assert len(counts) == 1
    assert counts[0][0] == 2
    number = struct.unpack_from("<6H", counts[0], 4)[1]
    parts = information(master, struct.pack("<BBHH", 1, 0, 0, 1))
    left = [struct.unpack_from("<H", part, 2)[0] for part in parts]
    assert left == list(range(len(parts)))[::-1]
    assert [part[0] for part in parts] == [0x82] * (len(parts) - 1) + [0x02]
    data = b"".join(part[4:] for part in parts)
    indices = struct.unpack(f"<{len(data) // 2}H", data)[1:]
    assert len(indices) == number > 40
    assert list(indices) == sorted(indices)
    assert {0x1000, 0x1018, 0x1C12, 0x6040} <= set(indices)
    assert not {0x1014, 0x1017, 0x1400, 0x1800} & set(indices)  # of CAN


def test_descriptions(master: FrameMaster) -> None:
    (one,) = information(master, struct.pack("<BBHH", 3, 0, 0, 0x1018))
    assert one == struct.pack("<BBHHHBB", 4, 0, 0, 0x1018, 5, 4, 9) + b"identity"
    (entry,) = information(master, struct.pack("<BBHHBB", 5, 0, 0, 0x6041, 0, 0))
    assert entry[:12] == struct.pack("<BBHHBBHH", 6, 0, 0, 0x6041, 0, 0, 6, 16)
    assert struct.unpack_from("<H", entry, 12)[0] == 0x87  # read always, in TxPDOs
    (entry,) = information(master, struct.pack("<BBHHBB", 5, 0, 0, 0x6040, 0, 0))
    assert struct.unpack_from("<H", entry, 12)[0] & 0x7F == 0x7F  # written always, in RxPDOs
    for request, code in (
        (struct.pack("<BBHH", 3, 0, 0, 0x1234), 0x06020000),
        (struct.pack("<BBHHBB", 5, 0, 0, 0x1018, 9, 0), 0x06090011),
        (struct.pack("<BBHH", 9, 0, 0, 0), 0x05040001),
    ):
        assert information(master, request) == [struct.pack("<BBHI", 7, 0, 0, code)]
