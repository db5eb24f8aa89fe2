"""Process data: golden bytes, refused mappings, and a peer that maps the same objects."""

from __future__ import annotations

import itertools

import canopen
import pytest
from canopen.objectdictionary import ODVariable, datatypes
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen import pdo
from drivers.canopen.codec_error import CodecError
from drivers.canopen.pdo import PdoError, layout, pack, unpack
from drivers.cia402 import process_data
from drivers.cia402.process_data import Entry, mapping_entries

MAPS = {
    name: getattr(pdo, name)
    for name in (
        "AXIS_COMMAND", "AXIS_STATUS", "AXIS_SLOW_STATUS", "ACTUATOR_TARGET", "ACTUATOR_COMMAND",
        "ACTUATOR_STATUS",
    )
}  # fmt: skip
RANGE = {
    kind: (-(2 ** (8 * n - 1)), 2 ** (8 * n - 1) - 1) if kind[0] == "i" else (0, 2 ** (8 * n) - 1)
    for kind, n in process_data.BYTES.items()
}


def test_golden_frames() -> None:
    command = layout(pdo.rpdo_cob_id(1, 5), pdo.AXIS_COMMAND)
    assert command.cob_id == 0x205
    assert pack(command, 0x000F, -2).hex(" ") == "0f 00 fe ff"
    status = layout(pdo.tpdo_cob_id(1, 5), pdo.AXIS_STATUS)
    assert status.cob_id == 0x185
    assert unpack(status, bytes.fromhex("37 12 fe ff ff ff ff ff")) == (0x1237, -2, -1)
    actuator = layout(0x305, pdo.ACTUATOR_TARGET)
    assert pack(actuator, -4000, 500).hex(" ") == "60 f0 ff ff f4 01 00 00"
    assert mapping_entries(pdo.AXIS_COMMAND) == (0x60400010, 0x60710010)
    assert mapping_entries(pdo.ACTUATOR_STATUS) == (0x60410010, 0x60610008, 0x60640020)


def test_predefined_cob_ids() -> None:
    assert [pdo.rpdo_cob_id(n, 0x7F) for n in (1, 2, 3, 4)] == [0x27F, 0x37F, 0x47F, 0x57F]
    assert [pdo.tpdo_cob_id(n, 1) for n in (1, 2, 3, 4)] == [0x181, 0x281, 0x381, 0x481]
    for number, node in ((0, 5), (5, 5), (1, 0), (1, 128)):
        with pytest.raises(PdoError):
            pdo.rpdo_cob_id(number, node)


@pytest.mark.parametrize("length", [n for n in range(20) if n != 8])
def test_a_wrong_length_names_frame_expected_and_got(length: int) -> None:
    with pytest.raises(CodecError) as error:
        unpack(layout(0x185, pdo.AXIS_STATUS), bytes(length))
    assert str(error.value) == f"frame 0x185: expected 8 bytes, got {length} bytes"
    assert error.value.cob_id == 0x185


def test_a_value_out_of_range_is_named() -> None:
    command = layout(0x205, pdo.AXIS_COMMAND)
    with pytest.raises(CodecError, match="0x205: expected i16 for target torque, got 32768"):
        pack(command, 15, 32768)
    with pytest.raises(CodecError, match="expected u16 for controlword, got -1"):
        pack(command, -1, 0)
    with pytest.raises(CodecError, match="expected i16 for target torque, got nan"):
        pack(command, 15, float("nan"))  # type: ignore[arg-type]
    with pytest.raises(CodecError, match="expected 2 values, got 1"):
        pack(command, 15)


@pytest.mark.parametrize(
    ("entries", "why"),
    [
        ((), "0 bytes"),
        ((process_data.POSITION, process_data.POSITION, process_data.MODE), "9 bytes"),
        ((*pdo.ACTUATOR_COMMAND, *pdo.ACTUATOR_TARGET), "11 bytes"),
        ((Entry(0x2000, 1, "f32", "warmth"),), "0x2000:1 warmth: no type 'f32'"),
    ],
)
def test_invalid_pdos_are_refused(entries: tuple[Entry, ...], why: str) -> None:
    with pytest.raises(PdoError, match=why):
        layout(0x205, entries)


@pytest.mark.parametrize("cob_id", [0, 0x80, 0x180, 0x580, 0x705, -1, 0x8185])
def test_other_cob_ids_are_refused(cob_id: int) -> None:
    with pytest.raises(PdoError):
        layout(cob_id, pdo.AXIS_STATUS)


@pytest.mark.parametrize("name", MAPS)
@given(data=st.data())
def test_a_round_trip_keeps_values_and_bytes(name: str, data: st.DataObject) -> None:
    pdo = layout(0x205, MAPS[name])
    values = tuple(data.draw(st.integers(*RANGE[entry.type])) for entry in pdo.entries)
    frame = pack(pdo, *values)
    assert unpack(pdo, frame) == values
    raw = data.draw(st.binary(min_size=pdo.packing.size, max_size=pdo.packing.size))
    assert pack(pdo, *unpack(pdo, raw)) == raw


@given(st.sampled_from(sorted(MAPS)), st.binary(max_size=64))
def test_no_bytes_raise_anything_but_the_codecs_error(name: str, data: bytes) -> None:
    pdo = layout(0x185, MAPS[name])
    try:
        unpack(pdo, data)
    except CodecError:
        assert len(data) != pdo.packing.size


@pytest.mark.parametrize("name", MAPS)
def test_an_independent_map_packs_the_same_bytes(name: str) -> None:
    types = {
        "u8": datatypes.UNSIGNED8, "i8": datatypes.INTEGER8, "u16": datatypes.UNSIGNED16,
        "i16": datatypes.INTEGER16, "u32": datatypes.UNSIGNED32, "i32": datatypes.INTEGER32,
    }  # fmt: skip
    dictionary = canopen.ObjectDictionary()
    for entry in MAPS[name]:
        variable = ODVariable(entry.name, entry.object, entry.sub)
        variable.data_type, variable.pdo_mappable = types[entry.type], True
        dictionary.add_object(variable)
    node = canopen.RemoteNode(5, dictionary)
    pdo = layout(0x205, MAPS[name])
    peer = canopen.pdo.PdoMap(node.rpdo, None, None)
    for entry in pdo.entries:
        peer.add_variable(entry.object, entry.sub)
    edges = itertools.product(*((*RANGE[e.type], 0, 1) for e in pdo.entries))
    for values in edges:
        for variable, value in zip(peer.map, values, strict=True):
            variable.raw = value
        assert bytes(peer.data) == pack(pdo, *values)
