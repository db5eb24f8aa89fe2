"""Emergencies and heartbeats: golden frames, total texts, and a node that falls silent."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from canopen.emcy import EmcyError
from canopen.nmt import NMT_STATES
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen import emcy, heartbeat
from drivers.canopen.codec_error import CodecError
from drivers.canopen.heartbeat import Heartbeat, NmtState
from drivers.cia402 import error_codes


def test_a_golden_emergency() -> None:
    message = emcy.decode(0x085, bytes.fromhex("20 32 05 01 02 03 04 05"))
    assert message == (5, 0x3220, 0x05, bytes((1, 2, 3, 4, 5)))
    assert emcy.describe(message) == (
        "node 5: 0x3220 DC link under-voltage (register 0x05 generic+voltage, maker 0102030405)"
    )
    unknown = emcy.decode(0x0FF, bytes(8))
    assert emcy.describe(unknown) == (
        "node 127: 0x0000 error reset (register 0x00 clear, maker 0000000000)"
    )


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x8130, "heartbeat or life guarding lost"), (0x8611, "following error"),
        (0x2377, "current, output side"), (0x2999, "current"), (0x8777, "monitoring"),
        (0xFF12, "specific to the device"), (0xF012, "additional functions"),
        (0x0001, "error reset or no error"), (0xA000, "reserved"),
    ],
)  # fmt: skip
def test_codes_have_texts(code: int, text: str) -> None:
    assert error_codes.meaning(code) == text


@pytest.mark.parametrize(
    ("code", "is_communication"),
    [(0x7500, True), (0x8110, True), (0x8250, True), (0x8700, True), (0x8611, False), (0, False)],
)
def test_communication_faults_are_no_faults_of_the_drive(code: int, is_communication: bool) -> None:
    assert error_codes.is_communication(code) == is_communication


def test_every_code_has_a_text_that_an_independent_table_does_not_contradict() -> None:
    same = {
        "Error Reset / No Error": "error reset", "Current": "current", "Voltage": "voltage",
        "Temperature": "temperature", "Monitoring": "monitoring", "External Error": "external",
        "Device Hardware": "device hardware", "Device Software": "device software",
        "Additional Modules": "additional modules", "Generic Error": "generic",
        "Device Specific": "specific", "Additional Functions": "additional functions",
    }  # fmt: skip
    for code in range(0x10000):
        text = error_codes.meaning(code)
        assert text
        if code not in error_codes.CODES and code & 0x0F00 in (0x0000, 0x0400):
            peer = EmcyError(code, 0, b"", 0.0).get_desc()
            assert same.get(peer, "") in text or text == "reserved"


@given(
    st.integers(0, 0x7FF) | st.integers(0x80, 0x100) | st.integers(0x700, 0x780),
    st.binary(max_size=12)
    | st.binary(min_size=8, max_size=8)
    | st.sampled_from([b"\0", b"\4", b"\5", b"\x7f"]),
)
def test_decoding_raises_only_its_own_error(cob_id: int, data: bytes) -> None:
    if 0x81 <= cob_id <= 0xFF and len(data) == 8:
        message = emcy.decode(cob_id, data)
        assert struct.pack("<HB", message.code, message.register) + message.vendor == data
        assert message.node == cob_id - 0x80
        assert emcy.describe(message)
    else:
        with pytest.raises(CodecError, match=f"frame {cob_id:#05x}"):
            emcy.decode(cob_id, data)
    if 0x701 <= cob_id <= 0x77F and data in (b"\0", b"\4", b"\5", b"\x7f"):
        beat = heartbeat.decode(cob_id, data)
        assert heartbeat.encode(beat.nmt) == data
        assert beat.node == cob_id - 0x700
    else:
        with pytest.raises(CodecError, match=f"frame {cob_id:#05x}"):
            heartbeat.decode(cob_id, data)


@pytest.mark.parametrize(
    ("codec", "cob_id", "length", "text"),
    [
        (emcy, 0x085, 7, "frame 0x085: expected 8 bytes, got 7 bytes"),
        (emcy, 0x080, 8, "frame 0x080: expected COB-ID 0x081 to 0x0ff, got 0x080"),
        (heartbeat, 0x705, 2, "frame 0x705: expected 1 bytes, got 2 bytes"),
        (heartbeat, 0x700, 1, "frame 0x700: expected COB-ID 0x701 to 0x77f, got 0x700"),
    ],
)
def test_refusals_name_what_was_expected(codec: Any, cob_id: int, length: int, text: str) -> None:
    with pytest.raises(CodecError) as error:
        codec.decode(cob_id, bytes(length))
    assert str(error.value) == text


def test_heartbeats_as_an_independent_table_names_them() -> None:
    names = {
        "INITIALISING": NmtState.BOOT,
        "STOPPED": NmtState.STOPPED,
        "OPERATIONAL": NmtState.OPERATIONAL,
        "PRE-OPERATIONAL": NmtState.PRE_OPERATIONAL,
    }
    wire = {number: names[name] for number, name in NMT_STATES.items() if name in names}
    assert set(wire.values()) == set(names.values())
    for byte in range(0x100):
        if byte in wire:
            assert heartbeat.decode(0x705, bytes((byte,))) == Heartbeat(5, wire[byte])
            assert heartbeat.encode(byte) == bytes((byte,))
        else:
            with pytest.raises(CodecError):
                heartbeat.decode(0x705, bytes((byte,)))
            with pytest.raises(CodecError):
                heartbeat.encode(byte)
    with pytest.raises(CodecError):
        heartbeat.encode(NmtState.SILENT)


def test_a_node_without_heartbeat_is_lost() -> None:
    watch = heartbeat.start(10.0)
    assert heartbeat.is_lost(watch, 10.25, 0.25) == 0
    assert heartbeat.is_lost(watch, 10.251, 0.25) == 1
    watch = heartbeat.record(watch, NmtState.OPERATIONAL, 20.0)
    assert (watch.nmt, heartbeat.is_lost(watch, 20.25, 0.25)) == (NmtState.OPERATIONAL, 0)
    assert heartbeat.is_lost(watch, 20.5, 0.25) == 1


@pytest.mark.parametrize("now", [math.nan, math.inf, -math.inf, 19.9])
def test_an_invalid_time_counts_as_lost(now: float) -> None:
    watch = heartbeat.record(heartbeat.start(10.0), NmtState.OPERATIONAL, 20.0)
    assert heartbeat.is_lost(watch, now, 0.25) == 1
    assert heartbeat.is_lost(watch, 20.0, math.nan) == 1


def test_node_restarts_are_counted() -> None:
    watch = heartbeat.start(0.0)
    for nmt in (NmtState.BOOT, NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL, NmtState.BOOT):
        watch = heartbeat.record(watch, nmt, 1.0)
    assert watch.boots == 2
