"""One World for all emulated devices: real time, bounded catch-up, one latched actuation."""

from __future__ import annotations

import pytest
from can_rig import still_world
from plant_files import DT

from sim_plant.emulators.shared_world import SharedWorld


class Clock:
    """A manually set clock."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def make_shared_world(burst: int = 100) -> tuple[SharedWorld, Clock]:
    clock = Clock()
    shared_rig = SharedWorld(still_world(), DT, clock, burst=burst)
    assert shared_rig.catch_up() == 0  # starts time
    return shared_rig, clock


def test_the_first_call_starts_time_and_whole_ticks_follow_the_clock() -> None:
    shared_rig, clock = make_shared_world()
    for k in range(1, 301):
        clock.now = 1000.0 + k * DT
        assert shared_rig.catch_up() == 1
    assert (shared_rig.ticks, shared_rig.late_ticks, shared_rig.dropped_ticks) == (300, 0, 0)
    assert shared_rig.time == pytest.approx(0.3)
    clock.now += 0.4 * DT
    assert shared_rig.catch_up() == 0
    clock.now -= 0.1
    assert shared_rig.catch_up() == 0


def test_start_sets_the_origin_of_time() -> None:
    clock = Clock()
    shared_rig = SharedWorld(still_world(), DT, clock)
    shared_rig.start(clock.now + 2.0 * DT)
    assert shared_rig.catch_up() == 0
    clock.now += 2.9 * DT
    assert shared_rig.catch_up() == 0
    clock.now += 0.2 * DT
    assert shared_rig.catch_up() == 1


def test_late_ticks_are_counted() -> None:
    shared_rig, clock = make_shared_world()
    clock.now += 30 * DT
    assert shared_rig.catch_up() == 30
    assert (shared_rig.ticks, shared_rig.late_ticks, shared_rig.dropped_ticks) == (30, 29, 0)


def test_catch_up_is_bounded_and_lost_time_is_dropped() -> None:
    shared_rig, clock = make_shared_world(burst=10)
    clock.now += 50 * DT
    assert shared_rig.catch_up() == 10
    assert shared_rig.catch_up() == 0
    assert (shared_rig.ticks, shared_rig.late_ticks, shared_rig.dropped_ticks) == (10, 10, 40)
    clock.now += DT
    assert shared_rig.catch_up() == 1
    with pytest.raises(ValueError, match="burst"):
        SharedWorld(still_world(), DT, clock, burst=0)


def test_devices_write_their_own_fields_of_one_actuation() -> None:
    shared_rig, clock = make_shared_world()
    shared_rig.actuate(heave_current=5.0, heave_enable=1)
    shared_rig.actuate(surge_current=-4.0, surge_enable=1)
    clock.now += 0.09
    shared_rig.catch_up()
    assert shared_rig.readings().heave_enabled == 0
    for _ in range(10):  # far beyond the simulated drives' own watchdog
        clock.now += 0.05
        shared_rig.catch_up()
    received = shared_rig.readings()
    assert received.heave_current == pytest.approx(5.0, abs=0.1)
    assert received.surge_current == pytest.approx(-4.0, abs=0.1)
    shared_rig.actuate(heave_current=0.0)
    clock.now += 0.05
    shared_rig.catch_up()
    assert shared_rig.readings().heave_current == pytest.approx(0.0, abs=0.1)
    assert shared_rig.actuation.surge_current == -4.0
    with pytest.raises((TypeError, ValueError)):
        shared_rig.actuate(heave_curent=1.0)


def test_stopped_world_has_no_time_and_no_command() -> None:
    shared_rig, clock = make_shared_world()
    shared_rig.actuate(heave_current=5.0, heave_enable=1)
    clock.now += 0.01
    shared_rig.catch_up()
    shared_rig.stop()
    clock.now += 1.0
    assert shared_rig.catch_up() == 0
    assert shared_rig.stopped
    assert shared_rig.ticks == 10
    assert shared_rig.actuation.heave_enable == 0
