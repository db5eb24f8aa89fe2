"""The SII image: read by a parser of its own, through the registers of the controller."""

from __future__ import annotations

import struct

import pytest
from frame_master import FPWR, STATION, FrameMaster

from sim_plant.emulators.ethercat import sii
from sim_plant.emulators.ethercat.sii import Identity, Information


def master_of(*names: str) -> FrameMaster:
    master = FrameMaster(*names)
    for number in range(len(names)):
        address = (-number & 0xFFFF) | 0x0010 << 16
        master.send(2, address, (STATION + number).to_bytes(2, "little"))
    return master


def read_image(master: FrameMaster, number: int, octets: int = 0x800) -> bytes:
    """Read through 0x0502: address and command in one write, 8 octets at a time."""
    data = b""
    for word in range(0, octets // 2, 4):
        assert master.station(FPWR, number, 0x0502, struct.pack("<HI", 0x0100, word))[1] == 1
        assert master.read(number, 0x0502, 2) == 0x0040  # 8 octets, no error, not busy
        data += master.read(number, 0x0508, 8).to_bytes(8, "little")
    return data


def categories(image: bytes) -> dict[int, bytes]:
    found, at = {}, 0x80
    while True:
        kind, size = struct.unpack_from("<HH", image, at)
        if kind == 0xFFFF:
            return found
        found[kind] = image[at + 4 : at + 4 + 2 * size]
        at += 4 + 2 * size


def strings(data: bytes) -> list[str]:
    texts, at = [""], 1
    for _ in range(data[0]):
        texts.append(data[at + 1 : at + 1 + data[at]].decode())
        at += 1 + data[at]
    return texts


def remainder(octets: bytes) -> int:
    """Return the remainder of the polynomial division by x^8 + x^2 + x + 1, start value FF."""
    value = int.from_bytes(octets, "big") << 8
    bits = 8 * len(octets) + 8
    value ^= 0xFF << bits - 8
    for bit in range(bits - 1, 7, -1):
        if value >> bit & 1:
            value ^= 0x107 << bit - 8
    return value


def test_image_of_a_drive() -> None:
    image = read_image(master_of("torque_drive"), 0)
    assert len(image) == 0x800
    assert image[14] == remainder(image[:14])
    assert image[15] == 0
    assert struct.unpack_from("<4I", image, 0x10) == (0x0BAD0EC0, 0x10000500, 1, 0)
    assert struct.unpack_from("<5H", image, 0x30) == (0x1000, 128, 0x1080, 128, 4)
    assert struct.unpack_from("<HH", image, 0x7C) == (15, 1)  # 16 kbit
    found = categories(image)
    assert list(found) == [10, 30, 40, 41]
    general = found[30]
    assert len(general) == 32
    assert strings(found[10])[general[3]] == "Torque drive"
    assert general[5] == 0x2F
    assert found[40][:3] == b"\x01\x02\x03"
    managers = [struct.unpack_from("<HHBBBB", found[41], at) for at in range(0, 32, 8)]
    assert managers == [
        (0x1000, 128, 0x26, 0, 1, 1),
        (0x1080, 128, 0x22, 0, 1, 2),
        (0x1100, 6, 0x64, 0, 1, 3),
        (0x1800, 10, 0x20, 0, 1, 4),
    ]


def test_image_of_terminals() -> None:
    master = master_of("digital_in:3", "digital_out:2", "coupler")
    inputs = categories(read_image(master, 0))
    texts = strings(inputs[10])
    assert texts[1] == "Digital input, 3 channels"
    assert 51 not in inputs
    pdos = inputs[50]
    for number in range(3):
        index, count, manager, _, name, _ = struct.unpack_from("<HBBBBH", pdos, 16 * number)
        assert (index, count, manager, texts[name]) == (
            0x1A00 + number, 1, 0, f"channel {number + 1}",
        )  # fmt: skip
        entry = struct.unpack_from("<HBBBBH", pdos, 16 * number + 8)
        assert entry[:2] == (0x6000 + 16 * number, 1)
        assert entry[3:] == (1, 1, 0)  # BOOL, 1 bit
    outputs = categories(read_image(master, 1))
    assert 50 not in outputs
    assert len(outputs[51]) == 32
    assert struct.unpack_from("<HHBBBB", outputs[41]) == (0x1100, 1, 0x64, 0, 1, 3)
    assert list(categories(read_image(master, 2))) == [10, 30]


def test_a_word_is_written_with_permission_only() -> None:
    master = master_of("coupler")
    assert master.station(FPWR, 0, 0x0508, b"\x34\x12")[1] == 1
    master.station(FPWR, 0, 0x0502, struct.pack("<HI", 0x0200, 0x10))
    assert master.read(0, 0x0502, 2) & 0x4000  # without the write enable bit
    assert read_image(master, 0, 0x40)[0x20:0x22] == b"\0\0"
    master.station(FPWR, 0, 0x0508, b"\x34\x12")
    master.station(FPWR, 0, 0x0502, struct.pack("<HI", 0x0201, 0x10))
    assert master.read(0, 0x0502, 2) == 0x0040
    assert read_image(master, 0, 0x40)[0x20:0x22] == b"\x34\x12"
    master.write(0, 0x0500, 1, 1)  # the device has access
    master.station(FPWR, 0, 0x0502, struct.pack("<HI", 0x0100, 0))
    assert master.read(0, 0x0502, 2) & 0x2000


def test_the_alias_is_read_at_power_on() -> None:
    master = master_of("coupler")
    slave = master.slaves[0]
    slave.eeprom.image[8:10] = b"\x77\x01"
    slave.eeprom.image[14] = remainder(bytes(slave.eeprom.image[:14]))
    slave.inject("brown_out")
    assert slave.controller.get(0x0012, 2) == 0x0177
    assert master.send(4, 0x0177 | 0x0012 << 16, bytes(2))[1] == 0
    assert master.send(2, 0x0103 << 16, b"\x01")[1] == 1  # the alias is an address, too
    assert master.send(4, 0x0177 | 0x0012 << 16, bytes(2)) == (b"\x77\x01", 1)


def test_a_damaged_eeprom_is_reported_and_keeps_init() -> None:
    master = master_of("torque_drive")
    master.slaves[0].inject("eeprom_damaged")
    master.station(FPWR, 0, 0x0502, struct.pack("<HI", 0x0100, 8))
    assert master.read(0, 0x0502, 2) & 0x0800
    assert master.read(0, 0x0508, 8) == 0xFFFF_FFFF_FFFF_FFFF
    assert master.request(0, 2) == (0x11, 0x51)
    assert master.read(0, 0x0110, 2) & 1 == 0
    master.slaves[0].clear("eeprom_damaged")
    master.station(FPWR, 0, 0x0800, bytes.fromhex("0010800026000100"))
    master.station(FPWR, 0, 0x0808, bytes.fromhex("8010800022000100"))
    assert master.request(0, 0x12) == (2, 0)
    assert master.read(0, 0x0110, 2) & 1 == 1


def test_another_device_at_a_place() -> None:
    master = master_of("torque_drive")
    master.slaves[0].inject("wrong_identity", 0x99)
    assert struct.unpack_from("<4I", read_image(master, 0, 0x20), 0x10)[1] == 0x99
    assert master.slaves[0].objects.get(0x1018, 2) == 0x99
    master.slaves[0].clear("wrong_identity")
    assert struct.unpack_from("<4I", read_image(master, 0, 0x20), 0x10)[1] == 0x10000500


def test_an_image_that_is_too_small_is_an_error() -> None:
    with pytest.raises(ValueError, match="exceeds 160"):
        sii.image(Information(Identity(1, 2), "a name that is long enough to fill it"), size=160)
