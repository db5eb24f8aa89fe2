"""Every fault of every emulated node: visible effect on the bus, and its end."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest
from can_rig import HEAVE, STATOR, SURGE, BusProbe, ManualSchedule, Rig, manual_rig, rpdo
from test_canopen_node import map_tpdo

from sim_plant.emulators.canopen_node import CanopenNode
from sim_plant.emulators.cia402 import State
from sim_plant.emulators.cia402_drive import Cia402Drive

NAMES = {"heave": HEAVE, "surge": SURGE, "stator": STATOR}


class Bench(NamedTuple):
    """One node under test: mode set, OPERATION ENABLED, TPDO 1 with every SYNC, heartbeat 50 ms."""

    rig: Rig
    tap: BusProbe
    schedule: ManualSchedule
    node: CanopenNode[Cia402Drive]
    number: int

    def listen(self, count: int = 120) -> dict[int, list[bytes]]:
        """Return the node's frames during some cycles of 1 ms, by function code."""
        self.tap.received.clear()
        self.tap.cycle(count=count)
        frames_of_node = [
            frame for frame in self.tap.received if frame.identifier & 0x7F == self.number
        ]
        return {
            code: [f.data for f in frames_of_node if f.identifier & 0x780 == code] for code in CODES
        }

    def read(self, index: int, sub: int = 0) -> int:
        return self.tap.read(self.number, index, sub)

    def write(self, index: int, sub: int, value: int, octets: int) -> None:
        self.tap.write(self.number, index, sub, value, octets)

    def answers(self) -> bool:
        self.tap.received.clear()
        self.tap.send(0x600 + self.number, bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0]))
        return bool(self.tap.of(0x580 + self.number))

    def emergency(self, code: int) -> bool:
        """Return whether the last EMCY and 603F have a code and the drive is in FAULT."""
        emergencies = self.tap.of(0x80 + self.number)[-1:]
        code_bytes = code.to_bytes(2, "little")
        return (
            bool(emergencies)
            and emergencies[0][:2] == code_bytes
            and self.read(0x603F) == code
            and self.read(0x6041) & 0x4F == 0x08
        )

    def control(self, *words: int) -> None:
        for word in words:
            self.write(0x6040, 0, word, 2)
            self.schedule.run(0.01)


CODES = (0x080, 0x180, 0x580, 0x700)


def bench(name: str) -> Bench:
    rig, tap, schedule = manual_rig()
    bench_under_test = Bench(rig, tap, schedule, getattr(rig, name), NAMES[name])
    bench_under_test.write(0x1017, 0, 50, 2)
    map_tpdo(tap, bench_under_test.number, 1, [0x60410010, 0x60640020])
    bench_under_test.write(0x6065, 0, 1000, 4)
    bench_under_test.write(0x6060, 0, 1 if name == "stator" else 10, 1)
    tap.nmt(1)
    schedule.run(0.02)
    bench_under_test.control(0x06, 0x07, 0x0F)
    schedule.run(0.15)
    assert bench_under_test.node.device.machine.state is State.ENABLED
    return bench_under_test


def silent(b: Bench) -> bool:
    received = b.listen()
    return not received[0x180] and not received[0x700] and b.answers()


def no_heartbeat(b: Bench) -> bool:
    received = b.listen()
    return bool(received[0x180]) and not received[0x700]


def no_pdo(b: Bench) -> bool:
    received = b.listen()
    return not received[0x180] and bool(received[0x700])


def off(b: Bench) -> bool:
    return not any(b.listen().values()) and not b.answers()


def late(b: Bench) -> bool:
    b.tap.received.clear()
    b.tap.send(0x80)
    b.schedule.run(0.0015)
    early = b.tap.of(0x180 + b.number)
    b.schedule.run(0.001)
    return not early and len(b.tap.of(0x180 + b.number)) == 1


def write_lost(b: Bench) -> bool:
    b.write(0x605A, 0, 5, 2)
    return b.read(0x605A) == 2


def stuck(b: Bench) -> bool:
    before = b.read(0x6041)
    b.control(0x00)
    return b.node.device.machine.state is State.SWITCH_ON_DISABLED and b.read(0x6041) == before


def mode_stuck(b: Bench) -> bool:
    b.write(0x6060, 0, 0, 1)
    b.schedule.run(0.1)
    return b.read(0x6061) != 0


def will_not_enable(b: Bench) -> bool:
    b.control(0x00)
    return b.read(0x6041) & 0x6F == 0x27


def frozen(b: Bench) -> bool:
    before = b.read(0x6064)
    b.rig.world.world.release(0.2)  # 50 mm: thousands of counts
    b.schedule.run(0.05)
    return b.read(0x6064) == before


def torque_missing(b: Bench) -> bool:
    b.tap.cycle((0x200 + b.number, rpdo(0x0F, 500)), count=50)
    current = b.rig.world.actuation[0 if b.number == HEAVE else 5]
    return b.read(0x6041) & 0x106F == 0x1027 and current == 0.0 and b.read(0x6077) == 0


def inverted(b: Bench) -> bool:
    b.tap.cycle((0x200 + b.number, rpdo(0x0F, 500)), count=50)
    current = b.rig.world.actuation[0 if b.number == HEAVE else 5]
    return current < -0.5 and b.read(0x6077) & 0x8000 != 0


def count_offset(b: Bench, cycles: int = 1) -> int:
    """Return the difference of 6064 from the world's counts."""
    b.tap.cycle(count=cycles)
    read = b.rig.world.readings()
    return b.read(0x6064) - (read.heave_counts if b.number == HEAVE else read.surge_counts)


def encoder_is_reversed(b: Bench) -> bool:
    before, start = b.read(0x6064), b.rig.world.readings().heave_counts
    b.rig.world.world.release(0.2)
    b.tap.cycle(count=50)
    shown = (b.read(0x6064) - before + (1 << 31)) % (1 << 32) - (1 << 31)
    moved = b.rig.world.readings().heave_counts - start
    return abs(moved) > 1000 and shown == -moved


def inverted_cell(b: Bench) -> bool:
    b.rig.world.world.release(0.2)  # loads the column, and pulls the string pot
    b.tap.cycle(count=20)
    now = b.rig.world.readings()
    force = now.force_lcb
    shown = (b.read(0x201A, 1) ^ 0x8000) - 0x8000
    return abs(force) > 1.0 and force * shown < 0.0


def blocked(b: Bench) -> bool:
    b.write(0x607A, 0, 20000, 4)
    b.control(0x1F)
    b.schedule.run(1.0)
    return b.emergency(0x8611)


def homing_fails(b: Bench) -> bool:
    b.write(0x6060, 0, 6, 1)
    b.schedule.run(0.01)
    b.control(0x1F)
    return b.read(0x6041) & 0x3400 == 0x2400


Sign = Callable[[Bench], bool]
# fault -> check of its visible effect
SIGNS: dict[str, Sign] = {
    "node_reset": lambda b: b.listen()[0x700] == [b"\0"] and not b.rig.world.actuation.heave_enable,
    "powered_off": off,
    "silent": silent,
    "heartbeat_lost": no_heartbeat,
    "pdo_lost": no_pdo,
    "sdo_lost": lambda b: not b.answers() and bool(b.listen()[0x180]),
    "bus_off": off,
    "tpdo_length": lambda b: {len(data) for data in b.listen()[0x180]} == {5},
    "tpdo_delay": late,
    "babble": lambda b: bool(b.listen()) and len(b.tap.of(0x07F)) > 200,
    "write_ignored": write_lost,
    "drive_fault": lambda b: b.emergency(0xFF00),
    "over_temperature": lambda b: b.emergency(0x4310),
    "bus_undervoltage": lambda b: b.emergency(0x3220),
    "bus_overvoltage": lambda b: b.emergency(0x3210),
    "stuck_statusword": stuck,
    "mode_stuck": mode_stuck,
    "will_not_enable": will_not_enable,
    "encoder_frozen": frozen,
    "encoder_wrapped": lambda b: b.read(0x6064) == 0x7FFFFFFF - 100,
    "wrong_kp": lambda b: b.read(0x20D8, 0xC) == 500,
    "no_torque": torque_missing,
    "inverted_motor": inverted,
    "encoder_reversed": encoder_is_reversed,
    "encoder_step": lambda b: count_offset(b) == 4000,
    "encoder_creep": lambda b: 35 < count_offset(b, 100) < 60,
    "load_cell_inverted": inverted_cell,
    "load_cell_saturated": lambda b: b.read(0x201A, 1) == 8191,
    "load_cell_dead": lambda b: b.read(0x201A, 1) == b.read(0x201A, 2) == 0,
    "limit_switch": lambda b: b.read(0x60FD) & 1 == 1,
    "wrong_gear": lambda b: b.read(0x6091, 1) / b.read(0x6091, 2) == pytest.approx(0.769 * 25.0),
    "blocked": blocked,
    "homing_fails": homing_fails,
}
VALUES = {"write_ignored": 0x605A}
# Faults without a visible effect: surge uses CiA 402 units; surge and stator do not move here.
BLIND = {
    ("surge", "wrong_kp"),
    ("surge", "encoder_frozen"),
    ("surge", "encoder_reversed"),
    ("stator", "encoder_frozen"),
}
# Faults whose effect is also visible without the fault.
QUIET_WATER = {"load_cell_dead"}
ONCE = {"node_reset", "drive_fault"}


def cases() -> list[tuple[str, str]]:
    rig, _, _ = manual_rig()
    return [(name, fault.name) for name in NAMES for fault in getattr(rig, name).faults()]


CASES = cases()
FIRST = {fault: name for name, fault in reversed(CASES)}  # a node that has it


@pytest.mark.parametrize(("name", "fault"), CASES)
def test_every_fault_of_every_node_is_visible(name: str, fault: str) -> None:
    sign = SIGNS[fault]
    if (name, fault) in BLIND:
        return
    if fault not in QUIET_WATER and name == FIRST[fault]:
        assert not sign(bench(name)), "the sign is there without the fault"
    b = bench(name)
    b.node.inject(fault, VALUES.get(fault))
    b.schedule.run(0.02)
    assert sign(b)
    assert (fault in b.node.active) is (fault not in ONCE)
    b.node.clear(fault)
    b.schedule.run(0.1)
    assert b.node.active == {}
    assert b.answers()


def test_node_reports_bus_off_and_stays_stopped() -> None:
    b = bench("heave")
    b.tap.cycle((0x201, rpdo(0x0F, 2000)), count=20)
    assert b.rig.world.actuation.heave_current > 6.0
    b.node.inject("bus_off")
    b.schedule.run(0.01)
    assert b.rig.world.actuation[:2] == (0.0, 0)
    b.node.clear("bus_off")
    assert b.tap.last(0x81)[:2] == b"\x40\x81"
    assert b.read(0x6041) & 0x4F == 0x08


def test_power_off_removes_the_current_and_power_on_boots() -> None:
    b = bench("heave")
    b.tap.cycle((0x201, rpdo(0x0F, 2000)), count=20)
    b.node.inject("powered_off")
    assert b.rig.world.actuation[:2] == (0.0, 0)
    b.tap.received.clear()
    b.node.clear("powered_off")
    b.schedule.run(0.08)
    assert b.tap.of(0x701) == [b"\0"]
    assert b.read(0x6041) & 0x4F == 0x40


def test_unknown_faults_are_refused_by_name() -> None:
    rig, _, _ = manual_rig()
    with pytest.raises(ValueError, match="no fault 'gremlin'; there are babble, bus_off"):
        rig.heave.inject("gremlin")
    rig.heave.clear("gremlin")


def test_every_fault_is_described() -> None:
    rig, _, _ = manual_rig()
    for node in rig.nodes:
        names = [fault.name for fault in node.faults()]
        assert len(names) == len(set(names))
        assert all(fault.effect for fault in node.faults())
