"""The loop follows the clock of a segment: a simulated loop with drift, jitter and jumps."""

from __future__ import annotations

import random
import statistics

import pytest

from drivers.ethercat import clock
from drivers.ethercat.clock import ClockParams, Follower

MS = 1_000_000  # ns


def offsets(params: ClockParams, ppm: float, ticks: int, jump_at: int = -1) -> list[int]:
    """Return the true offset of each frame of a loop at the reference clock; jitter is 20 us."""
    generator, state = random.Random(1), clock.start()
    deadline, reference = 123_456.0, 777_777.0
    found = []
    for tick in range(ticks):
        if tick == jump_at:
            reference += 300_000.0
        passed = (deadline + generator.expovariate(1.0 / 20_000.0)) * (1.0 + 1e-6 * ppm)
        time_ns = round(passed + reference)
        state, correction = clock.step(params, state, time_ns)
        found.append(clock.offset(params, time_ns))
        deadline += params.cycle_ns + correction
    return found


@pytest.mark.parametrize("ppm", [-200.0, 0.0, 30.0, 200.0])
@pytest.mark.parametrize("cycle", [MS, MS // 4])
def test_the_offset_vanishes_and_the_drift_is_taken_up(ppm: float, cycle: int) -> None:
    found = offsets(ClockParams(cycle, cycle // 2), ppm, 6000)
    # Jitter alone has a standard deviation of 20 us; its mean over 2000 ticks is within 1.5 us.
    assert abs(statistics.mean(found[-2000:])) < 1500
    assert statistics.stdev(found[-2000:]) < 25_000


def test_the_first_correction_brings_the_loop_to_its_place_at_once() -> None:
    found = offsets(ClockParams(MS, MS // 2), 0.0, 3)
    assert abs(found[1]) < 150_000  # jitter of two frames


def test_after_a_jump_a_tick_moves_by_ten_microseconds_at_most() -> None:
    params = ClockParams(MS, MS // 2)
    found = offsets(params, 0.0, 6000, jump_at=2000)
    assert max(abs(each) for each in found[2000:2010]) > 200_000
    assert abs(statistics.mean(found[-1000:])) < 2000
    slow = ClockParams(5 * MS, 0)
    state, correction = clock.step(slow, clock.start()._replace(ticks=5), 2 * MS)
    assert (state.offset_ns, correction) == (2 * MS, -10_000)


def test_each_frame_gives_one_correction_and_deadlines_begin_where_others_ended() -> None:
    follower = Follower(ClockParams(MS, 500_000))
    follower.take(7 * MS + 600_000)
    assert follower.correction() == -100_000
    assert follower.correction() == 0
    for phase, correction in ((300_000, 300_000), (700_000, -300_000), (0, 0)):
        follower.move_to(123 * MS + phase)
        assert follower.correction() == correction
    assert follower.state.ticks == 1  # it goes on with what it knows of the drift


def test_an_offset_is_within_half_a_cycle() -> None:
    params = ClockParams(MS, 500_000)
    assert clock.offset(params, 500_000) == 0
    assert clock.offset(params, 7 * MS + 400_000) == -100_000
    assert clock.offset(params, 7 * MS + 999_999) == 499_999
    assert clock.offset(params, 7 * MS + 1) == -499_999
