"""The torque drives: scaling of current, a silent master, analog inputs, limits."""

from __future__ import annotations

import struct

import pytest
from can_rig import HEAVE, SURGE, BusProbe, ManualSchedule, Rig, enable, manual_rig, rpdo
from test_canopen_node import map_tpdo

from sim_plant.emulators.cia402 import State
from sim_plant.emulators.torque_drive import FULL_SCALE, analog, towards_zero

RUN = 0x0F
T1, T2 = 0x180 + HEAVE, 0x180 + SURGE


def running(node: int = HEAVE) -> tuple[Rig, BusProbe, ManualSchedule]:
    """A drive in OPERATION ENABLED that has been following 0 A for 0.15 s."""
    rig, tap, schedule = manual_rig()
    tap.nmt(1)
    enable(tap, node)
    tap.cycle((0x200 + node, rpdo(RUN)), count=150)
    return rig, tap, schedule


def feedback(tap: BusProbe, identifier: int) -> tuple[int, int, int]:
    """Statusword, current and position of TPDO 1."""
    values: tuple[int, int, int] = struct.unpack("<Hhi", tap.last(identifier))
    return values


def test_amc_set_point_and_feedback_of_one_current_differ_by_four() -> None:
    rig, tap, _ = running()
    tap.cycle((0x201, rpdo(RUN, 2949)), count=30)
    amperes = 2949 * 100.0 / 2**15
    assert rig.world.actuation.heave_current == pytest.approx(amperes)
    assert rig.world.readings().heave_current == pytest.approx(amperes, abs=0.01)
    assert feedback(tap, T1)[1] == round(amperes * 2**13 / 100.0) == 737


def test_per_mille_of_rated_torque() -> None:
    rig, tap, _ = running(SURGE)
    tap.cycle((0x202, rpdo(RUN, -450)), count=30)
    assert rig.world.actuation.surge_current == pytest.approx(-9.0)  # rated 20 A
    assert feedback(tap, T2)[1] == -450
    assert tap.read(SURGE, 0x6078) == 0x10000 - 450
    assert tap.write(SURGE, 0x60B2, 0, 50, 2) == 0  # torque offset
    assert rig.world.actuation.surge_current == pytest.approx(-8.0)


def test_the_current_of_sync_n_acts_after_it() -> None:
    rig, tap, _ = running()
    tap.nmt(128)
    assert tap.write(HEAVE, 0x1400, 2, 1, 1) == 0
    tap.nmt(1)
    tap.cycle((0x201, rpdo(RUN, 0)))
    tap.send(0x201, rpdo(RUN, 1000))
    assert rig.world.actuation.heave_current == 0.0
    tap.send(0x80)
    assert rig.world.actuation.heave_current == pytest.approx(3.0518, abs=1e-4)


def test_torque_needs_state_mode_and_enabled_power_stage() -> None:
    rig, tap, schedule = manual_rig()
    tap.nmt(1)
    for word in (0x06, 0x07, RUN):
        tap.cycle((0x201, rpdo(word, 3000)), count=3)
    assert rig.heave.device.machine.state is State.ENABLED
    assert rig.world.actuation.heave_current == 0.0  # mode 0
    tap.write(HEAVE, 0x6060, 0, 10, 1)
    assert tap.read(HEAVE, 0x6061) == 0
    schedule.run(0.004)
    assert tap.read(HEAVE, 0x6061) == 0
    schedule.run(0.002)
    assert tap.read(HEAVE, 0x6061) == 10
    assert rig.world.actuation.heave_current > 9.0
    tap.cycle((0x201, rpdo(RUN, 3000)), count=60)
    assert not feedback(tap, T1)[0] & 0x1000  # the world's stage needs 0.1 s
    tap.cycle((0x201, rpdo(RUN, 3000)), count=60)
    assert feedback(tap, T1)[0] & 0x106F == 0x1027
    tap.cycle((0x201, rpdo(0x07, 3000)), count=200)
    assert rig.world.actuation[:2] == (0.0, 0)


def test_disabling_ramps_the_torque_by_6087() -> None:
    rig, tap, _ = running(SURGE)
    tap.write(SURGE, 0x6087, 0, 2000, 4)  # 40 A/s
    tap.cycle((0x202, rpdo(RUN, 500)), count=10)
    currents = []
    for _ in range(300):
        tap.cycle((0x202, rpdo(0x07, 500)))
        currents.append(rig.world.actuation.surge_current)
    assert currents[0] == pytest.approx(10.0, abs=0.05)
    assert currents[124] == pytest.approx(5.0, abs=0.1)
    assert currents[-1] == 0.0
    assert rig.surge.device.machine.state is State.SWITCHED_ON


@pytest.mark.parametrize(
    ("option", "state", "within"),
    [
        (0, State.ENABLED, None),
        (1, State.FAULT, 0.010),
        (2, State.SWITCH_ON_DISABLED, 0.005),
        (3, State.SWITCH_ON_DISABLED, 0.010),
    ],
)
@pytest.mark.parametrize("by", ["heartbeat", "rpdo"])
def test_silent_master_removes_the_current(
    by: str, option: int, state: State, within: float | None
) -> None:
    rig, tap, schedule = running()
    tap.nmt(128)
    tap.write(HEAVE, 0x6007, 0, option, 2)
    if by == "rpdo":
        assert tap.write(HEAVE, 0x1400, 5, 200, 2) == 0
    else:
        assert tap.write(HEAVE, 0x1016, 1, 0x7F << 16 | 200, 4) == 0
    tap.nmt(1)
    for _ in range(300):
        tap.send(0x77F, "05")
        tap.cycle((0x201, rpdo(RUN, 2000)))
    assert rig.world.readings().heave_current == pytest.approx(6.1, abs=0.1)
    schedule.run(0.195)
    assert rig.world.actuation.heave_current > 6.0
    schedule.run(0.008)
    if within is None:
        assert rig.world.actuation.heave_current > 6.0
    else:
        schedule.run(within)
        assert rig.world.actuation[:2] == (0.0, 0)
        assert rig.world.readings().heave_current == pytest.approx(0.0, abs=0.05)
    assert rig.heave.device.machine.state is state
    assert tap.last(0x81)[:2] == (b"\x30\x81" if by == "heartbeat" else b"\x50\x82")
    assert rig.heave.port.nmt == 127  # 0x1029:1 = 0
    tap.send(0x77F, "05")
    tap.cycle((0x201, rpdo(RUN, 2000)), count=20)
    tap.nmt(1)
    tap.cycle((0x201, rpdo(RUN, 2000)), count=20)
    if option:
        assert rig.world.actuation[:2] == (0.0, 0), "the drive must not restart by itself"


def test_fault_is_reported_and_reset_by_an_edge_once_its_cause_is_gone() -> None:
    rig, tap, schedule = running()
    rig.heave.inject("bus_overvoltage", 420.0)
    schedule.run(0.02)
    assert tap.last(0x81) == bytes.fromhex("1032 05 0000000000")
    assert tap.read(HEAVE, 0x603F) == 0x3210
    assert tap.read(HEAVE, 0x1001) == 0x05
    assert tap.read(HEAVE, 0x200F, 1) == round(420.0 * 2**14 / (1.05 * 400.0))
    assert tap.read(HEAVE, 0x2002, 2) == 4
    tap.cycle((0x201, rpdo(0x00)), (0x201, rpdo(0x80)), count=2)
    assert feedback(tap, T1)[0] & 0x4F == 0x08
    rig.heave.clear("bus_overvoltage")
    schedule.run(0.02)
    tap.cycle((0x201, rpdo(0x00)), (0x201, rpdo(0x80)), count=2)
    assert feedback(tap, T1)[0] & 0x4F == 0x40
    assert tap.last(0x81) == bytes(8)
    assert tap.read(HEAVE, 0x603F) == 0
    assert tap.read(HEAVE, 0x2002, 2) == 0
    assert tap.read(HEAVE, 0x2003, 2) == 4  # the latched copy
    tap.cycle((0x201, rpdo(RUN)), count=20)
    assert feedback(tap, T1)[0] & 0x4F == 0x40


def test_torque_limits_are_reported() -> None:
    rig, tap, _ = running(SURGE)
    tap.write(SURGE, 0x6072, 0, 300, 2)
    tap.cycle((0x202, rpdo(RUN, 900)), count=20)
    assert rig.world.actuation.surge_current == pytest.approx(6.0)
    assert feedback(tap, T2)[0] & 0x800
    rig, tap, _ = running(HEAVE)
    tap.cycle((0x201, rpdo(RUN, 32767)), count=20)  # 100 A, the motor's stage gives 40 A
    assert feedback(tap, T1)[0] & 0x800
    assert feedback(tap, T1)[1] == pytest.approx(40.0 * 2**13 / 100.0, abs=2)


def test_load_cells_on_the_analog_inputs_go_into_a_tpdo() -> None:
    rig, tap, _ = manual_rig()
    map_tpdo(tap, HEAVE, 2, [0x201A0110, 0x201A0210])
    tap.nmt(1)
    enable(tap, HEAVE)
    tap.cycle((0x201, rpdo(RUN, 3000)), count=200)
    lcb, trs = struct.unpack("<hh", tap.last(0x281))
    read = rig.world.readings()
    assert trs == pytest.approx(read.force_trs / 1000.0 * 819.2, abs=2.0)
    assert lcb == pytest.approx(read.force_lcb / 1000.0 * 819.2, abs=8.0)
    assert abs(trs) > 500


def test_analog_inputs_end_at_ten_volts() -> None:
    assert analog(1.0e6, 1000.0) == FULL_SCALE
    assert analog(-1.0e6, 1000.0) == -FULL_SCALE - 1
    assert analog(1000.0, 1000.0) == 819
    assert analog(float("nan"), 1000.0) == 0


def test_towards_zero_ends_at_zero() -> None:
    assert [towards_zero(v, 1.0) for v in (3.0, -3.0, 0.5, -1.0, 0.0)] == [2.0, -2.0, 0.0, 0.0, 0.0]


def test_position_and_velocity_from_the_encoder() -> None:
    rig, tap, schedule = running()
    tap.cycle((0x201, rpdo(RUN, 3000)), count=300)
    read = rig.world.readings()
    assert feedback(tap, T1)[2] == pytest.approx(read.heave_counts, abs=20)
    speed = tap.read(HEAVE, 0x606C)
    truth = rig.world.world.truth().velocity * 12.4666 / 6.283185 * 20000  # counts/s
    assert speed * 20000 / 2**17 == pytest.approx(truth, rel=0.2, abs=1000.0)
    schedule.run(0.01)
