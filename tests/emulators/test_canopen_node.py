"""CiA 301 behaviour of every emulated node: boot, SDO, NMT, heartbeat, PDOs, guards."""

from __future__ import annotations

import pytest
from can_rig import ACTUATOR, AMC, HEAVE, RATED, STATOR, BusProbe, manual_rig, rpdo
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from sim_plant.emulators.device_objects import Objects
from sim_plant.emulators.eds_file import load_entries

T1 = 0x180 + HEAVE
STOPPED, OPERATIONAL, PRE_OPERATIONAL = 4, 5, 127


def map_tpdo(tap: BusProbe, node: int, number: int, entries: list[int], **parameters: int) -> None:
    """Configure a TPDO in the order of CiA 301: off, map, parameters, on."""
    comm, map_ = 0x17FF + number, 0x19FF + number
    cob_id = 0x80 + 0x100 * number + node
    steps = [(comm, 1, 1 << 31 | cob_id, 4), (map_, 0, 0, 1)]
    steps += [(map_, sub, entry, 4) for sub, entry in enumerate(entries, start=1)]
    steps += [(map_, 0, len(entries), 1), (comm, 2, parameters.get("type", 1), 1)]
    steps += [(comm, 3, parameters.get("inhibit", 0), 2), (comm, 5, parameters.get("timer", 0), 2)]
    for step in [*steps, (comm, 1, cob_id, 4)]:
        assert tap.write(node, *step) == 0, step


@pytest.mark.parametrize("eds", [AMC, RATED, ACTUATOR])
def test_device_files_are_read_completely(eds: str) -> None:
    objects = Objects(load_entries(eds, 5))
    assert objects.get(0x1000) & 0xFFFF == 402
    assert objects.get(0x1014) == 0x85
    assert objects.get(0x1800, 1) == 0x185
    for base in (0x1600, 0x1A00):
        for number in range(8):
            for sub in range(1, objects.get(base + number) + 1):
                entry = objects.get(base + number, sub)
                object_type = objects.types[entry >> 16, entry >> 8 & 0xFF]
                assert object_type.mappable
                assert entry & 0xFF == object_type.bits


def test_actuator_defaults_match_the_manual() -> None:
    objects = Objects(load_entries(ACTUATOR, 0x7F))
    assert objects.get(0x6098) == 35
    defaults = {
        0x2030: 50, 0x2034: 49677, 0x2035: 10000, 0x6065: 256, 0x6066: 100, 0x6067: 10,
        0x6072: 100, 0x6073: 1000, 0x607A: 4000, 0x6080: 30000, 0x6081: 500, 0x6083: 500,
        0x6085: 5000, 0x6087: 100, 0x609A: 500, 0x60A8: 0xFF410000, 0x60A9: 0x00B44700,
        0x6007: 1, 0x605A: 2, 0x605B: 1, 0x605C: 1, 0x605D: 1, 0x605E: 2, 0x1005: 0x80, 0x1017: 0,
    }  # fmt: skip
    assert {index: objects.get(index) for index in defaults} == defaults
    assert (objects.get(0x608F, 1), objects.get(0x6099, 1), objects.get(0x6099, 2)) == (
        2000,
        50,
        10,
    )
    assert not {0x6076, 0x6078, 0x6079} & {index for index, _ in objects.types}


def test_boot_up_then_silence() -> None:
    _, tap, schedule = manual_rig()
    assert sorted(frame.identifier for frame in tap.received) == [0x701, 0x702, 0x703]
    assert {frame.data for frame in tap.received} == {b"\0"}
    schedule.run(1.0)
    assert len(tap.received) == 3


def test_heartbeats_report_the_nmt_state() -> None:
    rig, tap, schedule = manual_rig()
    assert tap.write(HEAVE, 0x1017, 0, 50, 2) == 0
    for command, state in ((0, PRE_OPERATIONAL), (1, OPERATIONAL), (2, STOPPED), (128, 127)):
        tap.nmt(command, HEAVE)
        tap.received.clear()
        schedule.run(0.501)
        assert tap.of(0x701) == [bytes([state])] * 10
        assert rig.surge.port.nmt == PRE_OPERATIONAL
    tap.write(HEAVE, 0x1017, 0, 0, 2)
    tap.received.clear()
    schedule.run(0.5)
    assert tap.received == []


def test_reset_node_and_reset_communication_restore_their_objects() -> None:
    _, tap, schedule = manual_rig()
    tap.write(HEAVE, 0x6007, 0, 0, 2)
    for command, kept in ((130, 5000), (129, 10000)):
        tap.write(HEAVE, 0x1017, 0, 100, 2)
        tap.write(HEAVE, 0x6087, 0, 5000, 4)
        tap.received.clear()
        tap.nmt(command, HEAVE)
        schedule.run(0.06)
        assert tap.of(0x701) == [b"\0"]
        assert tap.read(HEAVE, 0x1017) == 0
        assert tap.read(HEAVE, 0x6087) == kept


def test_stored_parameters_survive_a_reset_and_can_be_restored() -> None:
    _, tap, schedule = manual_rig()
    assert tap.write(HEAVE, 0x1010, 1, 0x12345678, 4) == 0x08000020
    for index, signature, expected in ((0x1010, 0x65766173, 77), (0x1011, 0x64616F6C, 10000)):
        tap.write(HEAVE, 0x6087, 0, 77, 4)
        assert tap.write(HEAVE, index, 1, signature, 4) == 0
        tap.nmt(129, HEAVE)
        schedule.run(0.06)
        assert tap.read(HEAVE, 0x6087) == expected
    assert tap.read(HEAVE, 0x1010, 1) == 1


@pytest.mark.parametrize(
    ("index", "sub", "value", "octets", "abort"),
    [
        (0x5555, 0, 0, 4, 0x06020000),  # no object
        (0x1018, 9, 0, 4, 0x06090011),  # no subindex
        (0x6041, 0, 0, 2, 0x06010002),  # read only
        (0x6040, 0, 0, 4, 0x06070010),  # length
        (0x6060, 0, 3, 1, 0x06090030),  # a mode it does not have
        (0x1029, 1, 7, 1, 0x06090031),  # too high
        (0x605D, 0, 0, 2, 0x06090032),  # too low
        (0x1600, 1, 0x60400010, 4, 0x08000022),  # mapping while the PDO is on
        (0x1800, 2, 250, 1, 0x06090030),  # reserved transmission type
        (0x1800, 1, 0x199, 4, 0x06090030),  # another COB-ID while it is on
        (0x1003, 0, 1, 1, 0x06090030),
    ],
)
def test_sdo_refusals(index: int, sub: int, value: int, octets: int, abort: int) -> None:
    _, tap, _ = manual_rig()
    assert tap.write(HEAVE, index, sub, value, octets) == abort


def test_invalid_pdo_mapping_is_refused() -> None:
    _, tap, _ = manual_rig()
    assert tap.write(HEAVE, 0x1A02, 1, 0x60640020, 4) == 0x08000022  # count is not 0
    assert tap.write(HEAVE, 0x1A02, 0, 0, 1) == 0
    assert tap.write(HEAVE, 0x1A02, 1, 0x10180120, 4) == 0x06040041  # not mappable
    assert tap.write(HEAVE, 0x1A02, 1, 0x60640010, 4) == 0x06040041  # width
    for sub in (1, 2, 3):
        assert tap.write(HEAVE, 0x1A02, sub, 0x60640020, 4) == 0
    assert tap.write(HEAVE, 0x1A02, 0, 3, 1) == 0x06040042  # 96 bits
    assert tap.write(HEAVE, 0x1A02, 0, 2, 1) == 0
    assert tap.write(HEAVE, 0x1602, 1, 0x60640020, 4) == 0x06040041  # an RPDO cannot write it


@settings(max_examples=examples(30))
@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8)), max_size=20))
def test_any_frame_leaves_the_node_working(frames: list[tuple[int, bytes]]) -> None:
    _, tap, schedule = SHARED
    for identifier, data in frames:
        tap.send(identifier, data)
        tap.send(0x600 + HEAVE, data)
    schedule.run(0.01)
    tap.received.clear()
    tap.nmt(129)
    schedule.run(0.2)
    assert tap.read(HEAVE, 0x1000) == 0x00020192


SHARED = manual_rig()


@pytest.mark.parametrize(("type_", "count"), [(1, 20), (2, 10), (7, 2), (240, 0)])
def test_synchronous_tpdos_come_with_every_nth_sync(type_: int, count: int) -> None:
    _, tap, _ = manual_rig()
    map_tpdo(tap, HEAVE, 1, [0x60410010, 0x60640020], type=type_)
    tap.nmt(1)
    tap.cycle(count=20)
    assert len(tap.of(T1)) == count
    assert all(len(data) == 6 for data in tap.of(T1))


def test_type_0_comes_with_sync_after_a_change() -> None:
    _, tap, _ = manual_rig()
    map_tpdo(tap, HEAVE, 1, [0x60410010], type=0)
    tap.nmt(1)
    tap.cycle(count=10)
    assert len(tap.of(T1)) == 1
    tap.cycle((0x201, rpdo(0x06)), count=5)
    assert len(tap.of(T1)) == 2


def test_event_tpdos_keep_their_inhibit_time_and_timer() -> None:
    _, tap, schedule = manual_rig()
    map_tpdo(tap, HEAVE, 1, [0x60410010], type=255, inhibit=500)
    map_tpdo(tap, HEAVE, 2, [0x60FD0020], type=254, timer=100)
    tap.nmt(1)
    tap.received.clear()
    for word in (0x06, 0x07, 0x06, 0x07):
        tap.send(0x201, rpdo(word))
        schedule.run(0.01)
    assert len(tap.of(T1)) == 1  # entering OPERATIONAL was an event
    schedule.run(0.96)
    assert len(tap.of(T1)) == 2
    assert len(tap.of(0x281)) == 10


def test_tpdo_delay_after_sync() -> None:
    rig, tap, schedule = manual_rig()
    rig.heave.inject("tpdo_delay", 0.0003)
    tap.nmt(1)
    tap.send(0x80)
    assert tap.of(T1) == []
    schedule.run(0.00031)
    assert len(tap.of(T1)) == 1


def test_synchronous_rpdos_act_with_the_next_sync_others_at_once() -> None:
    rig, tap, _ = manual_rig()
    tap.nmt(1)
    tap.send(0x201, rpdo(0x06))
    assert rig.heave.objects.get(0x6040) == 0x06
    tap.nmt(128)
    assert tap.write(HEAVE, 0x1400, 2, 1, 1) == 0
    tap.nmt(1)
    tap.send(0x201, rpdo(0x07))
    assert rig.heave.objects.get(0x6040) == 0x06
    tap.send(0x80)
    assert rig.heave.objects.get(0x6040) == 0x07


def test_pdos_flow_in_operational_only() -> None:
    rig, tap, _ = manual_rig()
    tap.cycle((0x201, rpdo(0x06)), count=3)
    assert tap.of(T1) == []
    assert rig.heave.objects.get(0x6040) == 0


def test_a_pdo_of_wrong_length_is_an_emergency() -> None:
    rig, tap, _ = manual_rig()
    tap.nmt(1)
    tap.send(0x201, "0600")
    assert tap.last(0x81) == bytes.fromhex("1082 11 0000000000")
    assert rig.heave.objects.get(0x6040) == 0
    tap.send(0x201, "0600 0000 00")
    assert tap.last(0x81)[:2] == b"\x20\x82"
    assert rig.heave.objects.get(0x6040) == 6
    assert tap.read(HEAVE, 0x1003) == 2
    assert tap.read(HEAVE, 0x1003, 1) == 0x8220
    assert tap.read(HEAVE, 0x1003, 2) == 0x8210
    assert tap.write(HEAVE, 0x1003, 0, 0, 1) == 0
    assert tap.read(HEAVE, 0x1003) == 0


@pytest.mark.parametrize(("behaviour", "state"), [(0, PRE_OPERATIONAL), (1, 5), (2, STOPPED)])
def test_silent_master_is_detected_in_time(behaviour: int, state: int) -> None:
    rig, tap, schedule = manual_rig()
    assert tap.write(STATOR, 0x1016, 1, 0x7F << 16 | 200, 4) == 0
    assert tap.write(STATOR, 0x1029, 1, behaviour, 1) == 0
    tap.nmt(1)
    schedule.run(1.0)  # never received: not monitored
    for _ in range(10):
        tap.send(0x77F, "05")
        schedule.run(0.15)
    assert rig.stator.port.nmt == OPERATIONAL
    schedule.run(0.045)
    assert rig.stator.port.nmt == OPERATIONAL
    schedule.run(0.01)
    assert rig.stator.port.nmt == state
    assert tap.last(0x83)[:3] == bytes.fromhex("3081 11")


def test_returning_heartbeat_clears_the_error() -> None:
    _, tap, schedule = manual_rig()
    tap.write(HEAVE, 0x6007, 0, 0, 2)
    tap.write(HEAVE, 0x1016, 1, 0x7F << 16 | 200, 4)
    tap.send(0x77F, "05")
    schedule.run(0.3)
    assert tap.read(HEAVE, 0x1001) == 0x11
    tap.send(0x77F, "05")
    assert tap.last(0x81) == bytes(8)
    assert tap.read(HEAVE, 0x1001) == 0


def test_only_nmt_and_heartbeat_while_stopped() -> None:
    _, tap, _ = manual_rig()
    tap.write(HEAVE, 0x1017, 0, 100, 2)
    tap.nmt(2)
    tap.received.clear()
    tap.send(0x601, "40 00 10 00 00 00 00 00")
    tap.cycle((0x201, rpdo(0x06)), count=150)
    assert {frame.identifier for frame in tap.received} == {0x701}
