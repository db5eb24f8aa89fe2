"""Devices of the segment: terminals, oversampling, encoders, drives; every fault and its effect."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable

import pytest
from can_rig import AMC
from frame_master import MS, OP, SAFEOP, FrameMaster

from sim_plant.emulators.cia402 import State
from sim_plant.emulators.eds_file import load_entries
from sim_plant.emulators.ethercat.__main__ import Console
from sim_plant.emulators.ethercat.flywheel_bench import Flywheel, FlywheelCommand, FlywheelParams
from sim_plant.emulators.ethercat.line import BenchLine
from sim_plant.emulators.ethercat.slaves import torque_drive_objects
from sim_plant.emulators.ethercat.terminals import FULL_SCALE
from sim_plant.emulators.ethercat.wire import Wire
from sim_plant.emulators.stator_actuator import StatorActuator
from sim_plant.emulators.torque_drive import TorqueDrive

RUN = 0x0F
DRIVE = 0


def test_digital_outputs_fall_at_the_watchdog() -> None:
    master = FrameMaster("digital_out:8", "digital_in:8")
    master.reach_op()
    master.cycle({0: b"\xa5"})
    master.cycle()
    master.cycle()
    assert (master.line.outputs["digital_out"], master.inputs(1)) == (0xA5, b"\xa5")
    master.pass_time(101)
    assert master.line.outputs["digital_out"] == 0
    master.slaves[0].inject("unplugged")
    assert master.line.outputs["digital_out"] == 0


def test_samples_are_spread_over_the_last_cycle() -> None:
    """Ten samples a ms of 5 V sin(2 pi t), of the cycle that ended with the frame before."""
    master = FrameMaster("analog_in")
    master.reach_preop()
    for index, sub, data in (
        (0x1C13, 0, b"\0"), (0x1C13, 1, b"\0\x1a"), (0x1C13, 2, b"\x15\x1a"), (0x1C13, 0, b"\2"),
    ):  # fmt: skip
        assert master.download(0, index, sub, data) == 0
    master.reach_safeop()
    master.cycle()
    ended_ns = master.now
    master.cycle()
    master.cycle()
    status, counter, *samples = struct.unpack("<HH10i", master.inputs(0))
    assert status == 0
    for number, raw in enumerate(samples, start=1):
        at = 1.0e-9 * (ended_ns - MS + number * MS / 10)
        assert raw == pytest.approx(0.5 * FULL_SCALE * math.sin(2.0 * math.pi * at), abs=1.0)
    master.cycle()
    assert struct.unpack_from("<HH", master.inputs(0))[1] == counter + 1


def test_range_and_broken_wire_of_an_analog_input() -> None:
    master = FrameMaster("analog_in")
    master.reach_op()
    assert master.download(0, 0x8000, 1, struct.pack("<I", 100)) == 0  # 0.1 V
    master.now = 5_250 * MS  # 5 V
    master.cycle()
    master.cycle()
    assert struct.unpack("<HHi", master.inputs(0))[::2] == (0x02, FULL_SCALE)
    master.now = 5_750 * MS  # -5 V
    master.cycle()
    master.cycle()
    assert struct.unpack("<HHi", master.inputs(0))[::2] == (0x01, -FULL_SCALE)
    master.slaves[0].inject("broken_wire")
    master.cycle()
    master.cycle()
    assert struct.unpack("<HHi", master.inputs(0))[::2] == (0x42, FULL_SCALE)


def test_encoders_have_64_bits_of_which_they_use_some() -> None:
    master = FrameMaster("encoder:2", "torque_drive")
    master.reach_op()
    assert master.line.wheel is not None
    master.line.wheel.angle = -2.0 * math.pi  # one turn back
    master.cycle()
    master.cycle()
    status, first, _, second = struct.unpack("<HQHQ", master.inputs(0))
    assert status == 0x04
    assert first == second == (1 << 32) - 20_000
    assert master.download(0, 0x8000, 0x11, b"\x40") == 0
    master.cycle()
    master.cycle()
    _, first, _, second = struct.unpack("<HQHQ", master.inputs(0))
    assert (first, second) == ((1 << 64) - 20_000, (1 << 32) - 20_000)


# ---- drives -----------------------------------------------------------------------------------


def outputs(controlword: int, target: int = 0, mode: int = 10) -> bytes:
    return struct.pack("<Hhbx", controlword, target, mode)


def feedback(master: FrameMaster) -> tuple[int, int, int, int]:
    """Statusword, position, current, mode."""
    values: tuple[int, int, int, int] = struct.unpack("<Hihbx", master.inputs(DRIVE))
    return values


def running() -> FrameMaster:
    """A torque drive in OPERATION ENABLED at 0 A."""
    master = FrameMaster("torque_drive", "encoder:1")
    master.reach_op()
    for _ in range(40):
        master.cycle({DRIVE: outputs(0)})
    for word in (0x06, 0x07, RUN):
        for _ in range(5):
            master.cycle({DRIVE: outputs(word)})
    assert feedback(master)[0] & 0x6F == 0x27
    assert feedback(master)[3] == 10
    return master


def body(master: FrameMaster) -> TorqueDrive:
    device = master.slaves[DRIVE].device
    assert isinstance(device, TorqueDrive)
    return device


def test_the_torque_drive_turns_its_flywheel() -> None:
    """Against the closed form: speed = (k i / b) (1 - exp(-t b / J)), after the lag of the current.

    The lag of 1 ms costs 1 ms of 200 ms; frames and process data cost 2 ms.
    """
    master = running()
    drive = body(master)
    target = drive.raw_target(4.0)
    start = feedback(master)[1]
    for _ in range(200):
        master.cycle({DRIVE: outputs(RUN, target)})
    params = FlywheelParams()
    rate, final = params.damping / params.inertia, 4.0 * params.torque_constant / params.damping
    assert master.line.wheel is not None
    assert master.line.wheel.speed == pytest.approx(final * -math.expm1(-0.2 * rate), rel=0.02)
    assert feedback(master)[2] == pytest.approx(4.0 * 8192.0 / drive.kp, abs=1.0)
    turned = (feedback(master)[1] - start) / params.counts_per_turn * 2.0 * math.pi
    expected = final * (0.2 + math.expm1(-0.2 * rate) / rate)
    assert turned == pytest.approx(expected, rel=0.03)


def test_the_flywheel_follows_the_closed_form_at_any_step() -> None:
    fine, coarse = Flywheel(FlywheelParams()), Flywheel(FlywheelParams())
    for wheel, steps in ((fine, 2000), (coarse, 200)):
        wheel.actuate(FlywheelCommand(2.0, 1))
        for _ in range(steps):
            wheel.advance(0.2 / steps)
    assert coarse.speed == pytest.approx(fine.speed, rel=0.01)
    assert coarse.angle == pytest.approx(fine.angle, rel=0.02)


def test_a_drive_is_the_same_body_on_both_buses() -> None:
    """The CoE dictionary has every object of the device file but those of CAN, with its type."""
    eds = {entry.key: entry for entry in load_entries(AMC)}
    coe = {entry.key: entry for entry in torque_drive_objects(eds.values())}
    of_device = {key for key in eds if key[0] >= 0x2000}
    assert {key: coe[key] for key in of_device} == {key: eds[key] for key in of_device}
    assert not any(0x1400 <= index < 0x1600 or 0x1800 <= index < 0x1A00 for index, _ in coe)


def test_silence_takes_the_torque_away() -> None:
    master = running()
    for _ in range(50):
        master.cycle({DRIVE: outputs(RUN, 1000)})
    assert body(master).current > 1.0
    master.pass_time(101)
    assert master.status(DRIVE) == (SAFEOP | 0x10, 0x1B)
    assert body(master).current == 0.0
    master.pass_time(20)
    assert body(master).machine.state is State.FAULT  # 6007 is 1
    box = master.get_box(DRIVE)
    assert box is not None
    assert box[1][:5] == b"\0\x10" + struct.pack("<HB", 0x8250, 0x11)


def test_leaving_op_on_request_takes_the_torque_away() -> None:
    master = running()
    for _ in range(50):
        master.cycle({DRIVE: outputs(RUN, 1000)})
    assert master.request(DRIVE, SAFEOP) == (SAFEOP, 0)
    for _ in range(5):
        master.cycle({DRIVE: outputs(RUN, 1000)})
    assert body(master).current == 0.0


def test_a_drive_fault_is_an_emergency_and_can_be_reset() -> None:
    master = running()
    master.slaves[DRIVE].inject("drive_fault", 0x2310)
    for _ in range(5):
        master.cycle({DRIVE: outputs(RUN, 1000)})
    assert feedback(master)[0] & 0x4F == 0x08
    box = master.get_box(DRIVE)
    assert box is not None
    assert box[1] == b"\0\x10" + struct.pack("<HB5x", 0x2310, 0x03)
    assert master.upload(DRIVE, 0x603F) == 0x2310
    assert master.status(DRIVE) == (OP, 0)
    for word in (0x00, 0x80):
        for _ in range(3):
            master.cycle({DRIVE: outputs(word)})
    assert feedback(master)[0] & 0x4F == 0x40
    box = master.get_box(DRIVE)
    assert box is not None
    assert box[1] == b"\0\x10" + bytes(8)


def test_the_position_drive_moves_its_carriage() -> None:
    """A remapped drive: 6040, 6060, 607A, 6081 out, 6041, 6061, 6064 in; a move of 2000 units."""
    master = FrameMaster("position_drive")
    master.reach_preop()
    for index, pdos in ((0x1C12, (0x1600, 0x1601)), (0x1C13, (0x1A00, 0x1A01))):
        assert master.download(0, index, 0, b"\0") == 0
        for sub, pdo in enumerate(pdos, start=1):
            assert master.download(0, index, sub, struct.pack("<H", pdo)) == 0
        assert master.download(0, index, 0, b"\2") == 0
    master.reach_safeop()
    master.cycle()
    assert master.request(0, OP) == (OP, 0)

    def drive(controlword: int, count: int = 10) -> tuple[int, int]:
        data = struct.pack("<HbiI", controlword, 1, 2000, 500)
        for _ in range(count):
            master.cycle({0: data})
        status, _, position, _, _ = struct.unpack("<HbiIH", master.inputs(0))
        return status, position

    drive(0, 40)
    for word in (0x06, 0x07, 0x0F):
        drive(word)
    status, position = drive(0x0F)
    assert status & 0x6F == 0x27
    assert position == 0
    drive(0x1F)
    status, position = drive(0x0F, 3000)
    assert status & 0x0400, "target reached"
    assert position == pytest.approx(2000, abs=2)
    device = master.slaves[0].device
    assert isinstance(device, StatorActuator)
    assert master.line.carriage is not None
    assert master.line.carriage.position > 0.0


# ---- faults -----------------------------------------------------------------------------------


def counter_is(master: FrameMaster, expected: int) -> bool:
    return master.cycle() == expected


def is_status(state: int, code: int) -> Callable[[FrameMaster], bool]:
    return lambda master: master.status(DRIVE) == (state, code)


def has_emergency(code: int) -> Callable[[FrameMaster], bool]:
    def check(master: FrameMaster) -> bool:
        box = master.get_box(DRIVE)
        return box is not None and box[1][2:4] == struct.pack("<H", code)

    return check


def inputs_stand_still(master: FrameMaster) -> bool:
    assert master.line.wheel is not None
    seen = set()
    for _ in range(5):
        master.line.wheel.angle += 1.0
        assert master.cycle() == 4
        seen.add(master.inputs(DRIVE))
    return len(seen) == 1


def is_mute(master: FrameMaster) -> bool:
    master.put_box(DRIVE, bytes.fromhex("0020 40 1810 01 00000000"))
    return master.get_box(DRIVE) is None


def clock_differs(master: FrameMaster) -> bool:
    before = master.read(DRIVE, 0x0910, 8)
    master.now += 1000 * MS
    return master.read(DRIVE, 0x0910, 8) - before != 1000 * MS


EFFECTS: dict[str, Callable[[FrameMaster], bool]] = {
    "unplugged": lambda master: master.send(7, 0, b"\0\0")[1] == -1,
    "brown_out": lambda master: master.send(1, 0x0130 << 16, b"\0\0")[0] == b"\1\0",
    "cable_cut": lambda master: counter_is(master, 3),
    "wrong_identity": lambda master: master.upload(DRIVE, 0x1018, 2) == 0xBAD,
    "wkc_short": lambda master: counter_is(master, 1),
    "wkc_short_once": lambda master: counter_is(master, 1) and counter_is(master, 4),
    "inputs_frozen": inputs_stand_still,
    "al_error": is_status(SAFEOP | 0x10, 0x1D),
    "al_refusal": lambda master: (
        master.request(DRIVE, SAFEOP) == (SAFEOP, 0)
        and master.request(DRIVE, OP) == (SAFEOP | 0x10, 0x1D)
    ),
    "watchdog": is_status(SAFEOP | 0x10, 0x1B),
    "emergency": has_emergency(0xFF01),
    "mailbox_silent": is_mute,
    "dc_drift": clock_differs,
    "dc_jump": lambda master: True,  # tests of the clock have its effect
    "eeprom_damaged": lambda master: not master.read(DRIVE, 0x0110, 2) & 1,
}


@pytest.mark.parametrize("name", EFFECTS)
def test_effect_and_end_of_each_fault_of_the_bus_side(name: str) -> None:
    master = FrameMaster("torque_drive", "encoder:1")
    master.reach_op()
    master.cycle()
    slave = master.slaves[DRIVE]
    fault = next(each for each in slave.faults() if each.name == name)
    if name not in ("brown_out", "al_error", "watchdog", "wkc_short_once", "emergency", "dc_jump"):
        assert not fault.once
        assert name == "al_refusal" or not EFFECTS[name](healthy())
    slave.inject(name)
    assert EFFECTS[name](master), fault.effect
    slave.clear(name)
    assert name not in slave.active
    if name in ("unplugged", "brown_out"):
        assert master.send(1, 0x0130 << 16, b"\0\0")[0] == b"\1\0"
    elif name not in ("al_error", "watchdog", "al_refusal"):
        master.cycle()
        assert master.cycle() == 4


def healthy() -> FrameMaster:
    """A healthy line in OP."""
    master = FrameMaster("torque_drive", "encoder:1")
    master.reach_op()
    master.cycle()
    return master


def test_all_faults_have_tests_names_and_effects() -> None:
    master = FrameMaster("torque_drive", "encoder:1", "analog_in", "coupler")
    for slave in master.slaves:
        names = [fault.name for fault in slave.faults()]
        assert len(set(names)) == len(names)
        assert all(fault.effect for fault in slave.faults())
        assert EFFECTS.keys() <= set(names)
        with pytest.raises(ValueError, match="no fault 'gremlin'"):
            slave.inject("gremlin")


def test_names_of_a_line_are_checked_all_at_once() -> None:
    with pytest.raises(ValueError, match=r"'toaster'.*'encoder:99'.*'coupler:2'"):
        FrameMaster("toaster", "encoder:99", "coupler:2")
    with pytest.raises(ValueError, match="at least one slave"):
        FrameMaster()
    line = FrameMaster("digital_in", "digital_in:8").line
    assert isinstance(line, BenchLine)
    assert list(line.segment.slaves) == ["digital_in", "digital_in_2"]


def test_the_console_takes_decimal_and_hexadecimal_values() -> None:
    line = FrameMaster("coupler", "torque_drive").line
    console = Console(line, Wire(line.segment, "none"))
    assert console.execute("inject segment stall 0.3") == {"done": "inject segment stall 0.3"}
    assert line.segment.stall_ns == 300_000_000
    drive = line.segment.slaves["torque_drive"]
    console.execute("inject torque_drive al_refusal 0x1D")
    assert drive.active["al_refusal"] == 0x1D
    assert "error" in console.execute("inject segment stall soon")
