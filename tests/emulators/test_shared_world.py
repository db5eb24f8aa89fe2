"""One World for all emulated devices: real time, bounded catching up, one latched actuation."""

from __future__ import annotations

import pytest
from can_rig import still_world
from plant_files import DT

from sim_plant.emulators.shared_world import SharedWorld


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def shared(burst: int = 100) -> tuple[SharedWorld, Clock]:
    clock = Clock()
    one = SharedWorld(still_world(), DT, clock, burst=burst)
    assert one.catch_up() == 0  # starts time
    return one, clock


def test_the_first_call_starts_time_and_whole_ticks_follow_the_clock() -> None:
    one, clock = shared()
    for k in range(1, 301):
        clock.now = 1000.0 + k * DT
        assert one.catch_up() == 1
    assert (one.ticks, one.late, one.dropped) == (300, 0, 0)
    assert one.time == pytest.approx(0.3)
    clock.now += 0.4 * DT
    assert one.catch_up() == 0
    clock.now -= 0.1
    assert one.catch_up() == 0


def test_time_that_was_started_begins_there() -> None:
    clock = Clock()
    one = SharedWorld(still_world(), DT, clock)
    one.start(clock.now + 2.0 * DT)
    assert one.catch_up() == 0
    clock.now += 2.9 * DT
    assert one.catch_up() == 0
    clock.now += 0.2 * DT
    assert one.catch_up() == 1


def test_ticks_done_after_their_time_are_counted() -> None:
    one, clock = shared()
    clock.now += 30 * DT
    assert one.catch_up() == 30
    assert (one.ticks, one.late, one.dropped) == (30, 29, 0)


def test_a_burst_is_bounded_and_lost_time_is_not_made_up() -> None:
    one, clock = shared(burst=10)
    clock.now += 50 * DT
    assert one.catch_up() == 10
    assert one.catch_up() == 0
    assert (one.ticks, one.late, one.dropped) == (10, 10, 40)
    clock.now += DT
    assert one.catch_up() == 1
    with pytest.raises(ValueError, match="burst"):
        SharedWorld(still_world(), DT, clock, burst=0)


def test_devices_write_their_own_fields_of_one_actuation() -> None:
    one, clock = shared()
    one.actuate(heave_current=5.0, heave_enable=1)
    one.actuate(surge_current=-4.0, surge_enable=1)
    clock.now += 0.09
    one.catch_up()
    assert one.readings().heave_enabled == 0
    for _ in range(10):  # far beyond the simulated drives' own watchdog
        clock.now += 0.05
        one.catch_up()
    read = one.readings()
    assert read.heave_current == pytest.approx(5.0, abs=0.1)
    assert read.surge_current == pytest.approx(-4.0, abs=0.1)
    one.actuate(heave_current=0.0)
    clock.now += 0.05
    one.catch_up()
    assert one.readings().heave_current == pytest.approx(0.0, abs=0.1)
    assert one.actuation.surge_current == -4.0
    with pytest.raises((TypeError, ValueError)):
        one.actuate(heave_curent=1.0)


def test_a_stopped_world_stands_still_with_nothing_asked_for() -> None:
    one, clock = shared()
    one.actuate(heave_current=5.0, heave_enable=1)
    clock.now += 0.01
    one.catch_up()
    one.stop()
    clock.now += 1.0
    assert one.catch_up() == 0
    assert one.stopped
    assert one.ticks == 10
    assert one.actuation.heave_enable == 0
