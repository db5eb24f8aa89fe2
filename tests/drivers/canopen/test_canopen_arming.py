"""Set-up steps, read-back, and the mismatches that prevent arming."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen import pdo
from drivers.canopen.pdo_steps import (
    heartbeat_consumer,
    rpdo_steps,
    silent_tpdo_step,
    tpdo_steps,
)
from drivers.cia402 import process_data
from drivers.cia402.arming import (
    Mismatch,
    SetupError,
    SetupStep,
    compare,
    format_mismatches,
    parameter_steps,
    read_back,
)
from drivers.cia402.drive_objects import BY_NAME, OBJECTS, REQUIRED, Access

VALUES: dict[str, int | None] = {
    "device_type": 402, "sync_cob_id": 0x80, "heartbeat_consumer": heartbeat_consumer(1, 300),
    "heartbeat_producer": 100, "abort_connection": 3, "quick_stop_option": 2,
    "fault_reaction_option": 0, "encoder_increments": 2000, "encoder_motor_revolutions": 1,
    "gear_motor_revolutions": 25, "gear_shaft_revolutions": 1, "feed": 5000,
    "feed_shaft_revolutions": 1, "max_torque": 1000, "max_current": 1000,
    "position_low": -40000, "position_high": 40000,
}  # fmt: skip
RPDO = pdo.layout(pdo.rpdo_cob_id(1, 5), pdo.AXIS_COMMAND)
TPDO = pdo.layout(pdo.tpdo_cob_id(1, 5), pdo.AXIS_STATUS)


class Dictionary:
    """An object dictionary that obeys, with the rules of remapping a PDO."""

    def __init__(self) -> None:
        self.values: dict[tuple[int, int], int] = {}
        for step in parameter_steps(VALUES):
            self.values[step.object, step.sub] = step.value

    def write(self, step: SetupStep) -> None:
        assert step.access != Access.VERIFY
        if step.object in (0x1600, 0x1A00):
            assert self.values[step.object - 0x200, 1] >> 31 == 1, "mapped while the PDO exists"
            if step.sub:
                assert self.values[step.object, 0] == 0, "mapped while entries count"
        if step.object in (0x1400, 0x1800) and step.sub > 1:
            assert self.values[step.object, 1] >> 31 == 1
        self.values[step.object, step.sub] = step.value

    def follow(self, steps: tuple[SetupStep, ...]) -> dict[tuple[int, int], int | None]:
        for step in steps:
            if step.access != Access.VERIFY:
                self.write(step)
        return {(s.object, s.sub): self.values.get((s.object, s.sub)) for s in read_back(steps)}


def all_steps() -> tuple[SetupStep, ...]:
    return (
        *parameter_steps(VALUES),
        *rpdo_steps(1, RPDO, 1, 200),
        *tpdo_steps(1, TPDO, 1),
        silent_tpdo_step(2, 0x285),
    )


def test_a_drive_that_takes_everything_may_be_armed() -> None:
    steps = all_steps()
    assert compare(steps, Dictionary().follow(steps)) == ()
    assert format_mismatches(()) == ""


def test_a_pdo_is_remapped_in_order() -> None:
    got = [(f"{s.object:04x}:{s.sub}", s.value, s.access) for s in rpdo_steps(1, RPDO, 1, 200)]
    assert got == [
        ("1400:1", 0x80000205, Access.TRANSIENT),
        ("1600:0", 0, Access.TRANSIENT),
        ("1600:1", 0x60400010, Access.SET),
        ("1600:2", 0x60710010, Access.SET),
        ("1600:0", 2, Access.SET),
        ("1400:2", 1, Access.SET),
        ("1400:5", 200, Access.SET),
        ("1400:1", 0x205, Access.SET),
    ]
    got = [(f"{s.object:04x}:{s.sub}", s.value, s.access) for s in tpdo_steps(3, TPDO, 20)]
    assert got[0] == ("1802:1", 0x80000185, Access.TRANSIENT)
    assert got[-2:] == [("1802:2", 20, Access.SET), ("1802:1", 0x185, Access.SET)]
    assert [s.object for s in tpdo_steps(3, TPDO, 20)][1:6] == [0x1A02] * 5


def test_only_the_last_word_on_an_object_is_read_back() -> None:
    steps = all_steps()
    expected = {(s.object, s.sub): s.value for s in read_back(steps)}
    assert len(expected) == len(read_back(steps))
    assert expected[0x1400, 1] == 0x205
    assert expected[0x1600, 0] == 2
    for name in VALUES:
        assert (BY_NAME[name].object, BY_NAME[name].sub) in expected


@pytest.mark.parametrize("step", read_back(all_steps()), ids=lambda s: s.name)
def test_every_object_can_keep_a_drive_from_being_armed(step: SetupStep) -> None:
    steps = all_steps()
    answers = Dictionary().follow(steps)
    bit = 31 if step.name == "TPDO2 COB-ID" else 0
    answers[step.object, step.sub] = step.value ^ 1 << bit
    mismatches = compare(steps, answers)
    assert mismatches == (
        Mismatch(step.object, step.sub, step.name, step.value, step.value ^ 1 << bit),
    )
    assert (
        f"{step.object:#06x}:{step.sub:02x} {step.name}: expected {step.value}"
        in format_mismatches(mismatches)
    )
    answers[step.object, step.sub] = None
    assert "no answer" in format_mismatches(compare(steps, answers))
    del answers[step.object, step.sub]
    assert [m.actual for m in compare(steps, answers)] == [None]


def test_a_wrong_gear_is_reported_by_name() -> None:
    steps = parameter_steps(VALUES)
    answers = Dictionary().follow(steps)
    answers[0x6091, 1] = 1
    answers[0x607D, 1] = 0
    assert format_mismatches(compare(steps, answers)).splitlines() == [
        "0x6091:01 gear_motor_revolutions: expected 25, got 1",
        "0x607d:01 position_low: expected -40000 (-0x9c40), got 0",
    ]


def test_bits_that_are_the_drives_do_not_count() -> None:
    steps = all_steps()
    answers = Dictionary().follow(steps)
    answers[0x1000, 0] = 0x00060192
    answers[0x1800, 1] = 0x40000185
    assert compare(steps, answers) == ()
    answers[0x1005, 0] = 0x40000080  # it would produce SYNC as well
    answers[0x1800, 1] = 0x80000185  # it does not exist
    answers[0x1400, 1] = 0x20000205  # 29-bit frames
    assert [m.name for m in compare(steps, answers)] == [
        "sync_cob_id", "RPDO1 COB-ID", "TPDO1 COB-ID",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"gear_ratio": 25}, "gear_ratio: no such object"),
        ({"abort_connection": 0}, "abort_connection: 0 would switch it off"),
        ({"heartbeat_consumer": 0}, "heartbeat_consumer: 0 would"),
        ({"max_torque": 0}, "max_torque: 0 would"),
        ({"max_torque": 65536}, "max_torque: 65536 does not fit u16, 0 to 65535"),
        ({"quick_stop_option": 40000}, "does not fit i16, -32768 to 32767"),
        ({"position_low": 0, "position_high": 0}, "0 and 0: off"),
        ({"position_low": 5, "position_high": 4}, "not below"),
        ({"position_low": None}, "one without the other"),
    ],
)
def test_a_configuration_that_must_not_reach_a_drive(
    change: dict[str, int | None], why: str
) -> None:
    with pytest.raises(SetupError, match=why):
        parameter_steps({**VALUES, **change})


@pytest.mark.parametrize("name", sorted(REQUIRED))
def test_required_objects_may_be_absent_only_if_null(name: str) -> None:
    without = {key: value for key, value in VALUES.items() if key != name}
    with pytest.raises(SetupError, match=rf"{name}: missing|one without"):
        parameter_steps(without)
    twin = {"position_low": "position_high", "position_high": "position_low"}
    absent = {name: None, **({twin[name]: None} if name in twin else {})}
    left = {step.name for step in parameter_steps({**VALUES, **absent})}
    assert left == set(VALUES) - set(absent)


def test_read_only_objects_are_verified() -> None:
    steps = parameter_steps(VALUES, read_only=frozenset({"feed"}))
    assert {s.name: s.access for s in steps}["feed"] == Access.VERIFY
    with pytest.raises(SetupError, match="fed: no such object"):
        parameter_steps(VALUES, read_only=frozenset({"fed"}))


def test_invalid_pdo_numbers_are_refused() -> None:
    for call in (
        lambda: rpdo_steps(0, RPDO, 1, 200),
        lambda: rpdo_steps(513, RPDO, 1, 200),
        lambda: rpdo_steps(1, RPDO, 1, 0),
        lambda: rpdo_steps(1, RPDO, 256, 200),
        lambda: tpdo_steps(1, TPDO, 0),
        lambda: tpdo_steps(1, TPDO, 241),
        lambda: heartbeat_consumer(0, 200),
        lambda: heartbeat_consumer(1, 0),
        lambda: silent_tpdo_step(0, 0x285),
    ):
        with pytest.raises(SetupError):
            call()
    assert heartbeat_consumer(1, 300) == 0x0001012C


def test_the_table_of_objects_is_one() -> None:
    assert len(BY_NAME) == len(OBJECTS) == len({(o.object, o.sub) for o in OBJECTS})
    assert set(BY_NAME) >= REQUIRED
    assert {item.type for item in OBJECTS} <= set(process_data.TYPES)
    for item in OBJECTS:
        assert item.access in (Access.SET, Access.VERIFY)


@given(st.dictionaries(st.sampled_from(sorted(BY_NAME)), st.integers(-(2**33), 2**33)))
def test_any_configuration_is_taken_or_refused(values: dict[str, int]) -> None:
    try:
        steps = parameter_steps(values, required=frozenset())
    except SetupError:
        return
    assert {step.name for step in steps} == set(values)
    assert compare(steps, {(s.object, s.sub): s.value for s in steps}) == ()
