"""The stator's actuator: moves, handshake, homing, gear objects, soft limits, following error."""

from __future__ import annotations

from itertools import pairwise

import pytest
from can_rig import STATOR, BusProbe, ManualSchedule, Rig, manual_rig

from sim_plant.emulators import homing, profile_motion
from sim_plant.emulators.cia402 import State
from sim_plant.emulators.homing import Homing, HomingInputs, Phase
from sim_plant.emulators.profile_motion import Motion, MotionLimits

UM = 5000  # feed: micrometres per turn of the shaft, so positions are micrometres of the stator
PERCENT = 1500  # micrometres


def control(tap: BusProbe, *controlwords: int, pause: float = 0.01) -> None:
    for controlword in controlwords:
        assert tap.write(STATOR, 0x6040, 0, controlword, 2) == 0
        tap.schedule.run(pause)


def enabled_actuator(mode: int = 1, **options: float) -> tuple[Rig, BusProbe, ManualSchedule]:
    """An actuator in OPERATION ENABLED with its true gear, 9 mm/s."""
    rig, tap, schedule = manual_rig(**options)
    settings = [
        (0x6091, 1, 25, 4), (0x6091, 2, 1, 4), (0x6092, 1, UM, 4), (0x6092, 2, 1, 4),
        (0x6081, 0, 108, 4), (0x6083, 0, 6000, 4), (0x6084, 0, 6000, 4), (0x6065, 0, 1000, 4),
        (0x6060, 0, mode, 1),
    ]  # fmt: skip
    for setting in settings:
        assert tap.write(STATOR, *setting) == 0
    schedule.run(0.02)
    control(tap, 0x06, 0x07, 0x0F)
    assert rig.stator.device.machine.state is State.ENABLED
    return rig, tap, schedule


def signed(tap: BusProbe, index: int) -> int:
    value = tap.read(STATOR, index)
    return value - (1 << 32) if value >> 31 else value


def status(tap: BusProbe) -> int:
    return tap.read(STATOR, 0x6041)


def test_move_with_handshake() -> None:
    rig, tap, schedule = enabled_actuator()
    start = rig.world.readings().stator_position
    tap.write(STATOR, 0x607A, 0, -20 * PERCENT, 4)
    control(tap, 0x3F)
    assert status(tap) & 0x1400 == 0x1000  # acknowledged, not reached
    control(tap, 0x0F)
    assert status(tap) & 0x1400 == 0x0000
    schedule.run(1.0)
    assert tap.read(STATOR, 0x606C) >> 31  # moves down
    assert signed(tap, 0x60F4) == pytest.approx(0, abs=200)
    schedule.run(3.0)
    assert status(tap) & 0x0400
    assert signed(tap, 0x6064) == -20 * PERCENT
    assert rig.world.readings().stator_position == pytest.approx(start - 20.0, abs=0.001)


def test_set_points_are_queued_or_change_the_move() -> None:
    rig, tap, schedule = enabled_actuator()
    for target in (10, 5):  # the second waits
        tap.write(STATOR, 0x607A, 0, target * PERCENT, 4)
        control(tap, 0x1F)
        assert status(tap) & 0x1000
        control(tap, 0x0F)
    tap.write(STATOR, 0x607A, 0, 40 * PERCENT, 4)
    control(tap, 0x1F)
    assert not status(tap) & 0x1000  # a third set-point is rejected
    control(tap, 0x0F)
    schedule.run(1.8)
    assert signed(tap, 0x6064) > 8 * PERCENT
    schedule.run(1.5)
    assert signed(tap, 0x6064) == 5 * PERCENT
    tap.write(STATOR, 0x607A, 0, -2 * PERCENT, 4)
    control(tap, 0x7F, 0x0F)  # relative, at once
    schedule.run(1.0)
    assert signed(tap, 0x6064) == 3 * PERCENT
    assert rig.stator.device.machine.state is State.ENABLED


def test_halt_stops_and_releases() -> None:
    _, tap, schedule = enabled_actuator()
    tap.write(STATOR, 0x607A, 0, 10 * PERCENT, 4)
    control(tap, 0x3F, 0x0F)
    schedule.run(0.5)
    control(tap, 0x10F, pause=0.2)
    where = signed(tap, 0x6064)
    assert 0 < where < 10 * PERCENT
    assert status(tap) & 0x400
    schedule.run(0.5)
    assert signed(tap, 0x6064) == pytest.approx(where, abs=2)
    control(tap, 0x0F)
    schedule.run(2.0)
    assert signed(tap, 0x6064) == 10 * PERCENT


def test_soft_limits_apply_and_are_reported() -> None:
    _, tap, schedule = enabled_actuator()
    tap.write(STATOR, 0x607D, 1, -3 * PERCENT, 4)
    tap.write(STATOR, 0x607D, 2, 3 * PERCENT, 4)
    tap.write(STATOR, 0x607A, 0, -9 * PERCENT, 4)
    control(tap, 0x3F, 0x0F)
    schedule.run(2.0)
    assert signed(tap, 0x6064) == -3 * PERCENT
    assert status(tap) & 0x0C00 == 0x0C00


def test_wrong_gear_gives_a_wrong_position() -> None:
    rig, tap, schedule = manual_rig()
    rig.stator.inject("wrong_gear", 0.769)
    assert tap.write(STATOR, 0x6091, 1, 25, 4) == 0
    assert tap.write(STATOR, 0x6091, 2, 1, 4) == 0
    ratio = tap.read(STATOR, 0x6091, 1) / tap.read(STATOR, 0x6091, 2)
    assert ratio == pytest.approx(0.769 * 25.0)
    tap.write(STATOR, 0x6092, 1, UM, 4)
    tap.write(STATOR, 0x6081, 0, 100, 4)
    tap.write(STATOR, 0x6060, 0, 1, 1)
    tap.write(STATOR, 0x6065, 0, 1000, 4)
    schedule.run(0.02)
    control(tap, 0x06, 0x07, 0x0F)
    tap.write(STATOR, 0x607A, 0, 20 * PERCENT, 4)
    control(tap, 0x3F, 0x0F)
    schedule.run(5.0)
    assert rig.world.readings().stator_position + 13.0 == pytest.approx(20.0 * 0.769, abs=0.01)


def test_excessive_speed_is_a_following_error() -> None:
    rig, tap, schedule = enabled_actuator()
    tap.write(STATOR, 0x6081, 0, 240, 4)  # 20 mm/s, the mechanics give 10
    tap.write(STATOR, 0x607A, 0, 30 * PERCENT, 4)
    control(tap, 0x3F, 0x0F)
    schedule.run(0.5)
    assert rig.stator.device.machine.state is State.FAULT
    assert tap.last(0x83)[:3] == bytes.fromhex("1186 21")
    assert rig.world.actuation.stator_enable == 0


@pytest.mark.parametrize(("method", "end"), [(17, -30.0), (-18, 67.0)])
def test_homing_to_switch_or_end_stop(method: int, end: float) -> None:
    rig, tap, schedule = enabled_actuator(mode=6, low=min(end, -30.0))
    tap.write(STATOR, 0x6098, 0, method, 1)
    tap.write(STATOR, 0x607C, 0, round(end * PERCENT), 4)
    tap.write(STATOR, 0x6099, 1, 110, 4)
    assert status(tap) & 0x3400 == 0x0400
    control(tap, 0x1F)
    assert status(tap) & 0x3400 == 0x0000
    for _ in range(20):
        schedule.run(0.8)
        if status(tap) & 0x3400 == 0x1400:
            break
    assert status(tap) & 0x3400 == 0x1400
    position = rig.world.readings().stator_position
    assert position == pytest.approx(end, abs=0.3)
    assert signed(tap, 0x6064) == pytest.approx(position * PERCENT, abs=0.3 * PERCENT)
    control(tap, 0x0F)
    tap.write(STATOR, 0x6060, 0, 1, 1)
    schedule.run(0.02)
    tap.write(STATOR, 0x607A, 0, round(0.9 * end * PERCENT), 4)
    control(tap, 0x3F, 0x0F)
    schedule.run(2.0)
    assert rig.world.readings().stator_position == pytest.approx(0.9 * end, abs=0.3)


def test_homing_at_the_present_position_and_unsupported_method() -> None:
    rig, tap, _ = enabled_actuator(mode=6)
    tap.write(STATOR, 0x607C, 0, -13 * PERCENT, 4)
    control(tap, 0x1F)
    assert status(tap) & 0x3400 == 0x1400
    assert signed(tap, 0x6064) == -13 * PERCENT
    control(tap, 0x0F)
    tap.write(STATOR, 0x6098, 0, 3, 1)
    control(tap, 0x1F)
    assert status(tap) & 0x3400 == 0x2400
    assert rig.stator.device.machine.state is State.ENABLED


def test_homing_is_interrupted_when_its_bit_falls() -> None:
    rig, tap, schedule = enabled_actuator(mode=6)
    tap.write(STATOR, 0x6098, 0, 17, 1)
    control(tap, 0x1F)
    schedule.run(0.5)
    control(tap, 0x0F)
    assert status(tap) & 0x3400 == 0x0400
    where = rig.world.readings().stator_position
    schedule.run(0.5)
    assert rig.world.readings().stator_position == pytest.approx(where, abs=0.1)


def test_supply_and_its_warning_levels() -> None:
    rig, tap, schedule = enabled_actuator()
    assert tap.read(STATOR, 0x4014, 1) == 48000
    assert tap.read(STATOR, 0x4014, 3) == 350
    assert not status(tap) & 0x80
    rig.stator.inject("bus_overvoltage", 50.0)
    schedule.run(0.02)
    assert status(tap) & 0x80
    rig.stator.inject("bus_overvoltage", 52.0)
    schedule.run(0.02)
    assert rig.stator.device.machine.state is State.FAULT


def test_a_profile_ends_at_its_target_and_never_exceeds_its_speed() -> None:
    profile = MotionLimits(10.0, 50.0, 20.0)
    for target in (30.0, -30.0, 0.05, 1.0e-9):
        motion, speeds = Motion(0.0, 0.0), []
        for _ in range(20000):
            motion = profile_motion.step_towards(motion, target, profile, 0.001)
            speeds.append(abs(motion.velocity))
        assert motion == Motion(target, 0.0)
        assert max(speeds) <= 10.0
        rises = [b - a for a, b in pairwise(speeds)]
        assert max(rises) <= 0.05 + 1e-9
    assert profile_motion.step_to_stop(Motion(1.0, -2.0), 100.0, 1.0).velocity == 0.0


def test_end_stop_is_detected_after_a_time_without_motion() -> None:
    look = homing.step
    search = homing.start(-17)
    for _ in range(10):
        search = look(search, HomingInputs(False, False, True, 0.05), 0.02)
    assert search.phase is Phase.SEARCHING
    search = look(
        look(search, HomingInputs(True, False, False, 0.05), 0.04),
        HomingInputs(True, False, False, 0.05),
        0.02,
    )
    assert search.phase is Phase.DONE
    assert homing.direction(Homing(Phase.LEAVING, 17)) == 1
