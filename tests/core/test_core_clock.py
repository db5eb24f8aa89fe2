"""The two clocks: absolute deadlines, whole periods skipped and counted, never a burst."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from rig.realtime import clock
from rig.realtime.clock import RealClock, VirtualClock, Wake

PERIOD = 1_000_000  # ns
EINTR = 4


class Host:
    """A host whose time advances only by sleep and work, with late wake-ups."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, start: int = 123_456_789_012) -> None:
        self.now = start
        self.late = itertools.repeat(0)
        self.interrupts = itertools.repeat(0)
        self.deadlines: list[int] = []
        monkeypatch.setattr(clock, "time", SimpleNamespace(monotonic_ns=lambda: self.now))
        self.clock = RealClock(PERIOD * 1e-9)
        self.zero = (start // PERIOD + 2) * PERIOD  # on a multiple of the period
        monkeypatch.setattr(self.clock, "_sleep", self._sleep)

    def _sleep(self, which: int, flags: int, until: Any, rest: Any) -> int:
        assert (which, flags, rest) == (1, 1, None)  # CLOCK_MONOTONIC, TIMER_ABSTIME
        target = self.clock._deadline
        deadline = target.seconds * 1_000_000_000 + target.nanoseconds
        assert 0 <= target.nanoseconds < 1_000_000_000
        if next(self.interrupts):
            return EINTR
        self.deadlines.append(deadline)
        self.now = max(self.now, deadline) + next(self.late)
        return 0


def test_ten_thousand_jittered_ticks_end_on_the_planned_tick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    host = Host(monkeypatch)
    host.late = itertools.cycle([0, 50_000, 900_000, 0, 120_000])
    for tick in range(10_000):
        wake = host.clock.wait_next()
        assert (wake.tick, wake.periods) == (tick, 1)
        host.now += 300_000  # work; late wake-ups leave the next deadline in the past
    assert host.deadlines == [host.zero + k * PERIOD for k in range(10_000)]
    assert wake.now == pytest.approx(9.999)


@settings(max_examples=examples(100))
@given(
    st.lists(st.tuples(st.integers(0, 5 * PERIOD), st.integers(0, 3 * PERIOD)), max_size=60),
    st.integers(0, 10**15),
)
def test_delays_never_shift_the_tick_grid(delays: list[tuple[int, int]], start: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        host = Host(patch, start)
        host.late = iter([late for late, _ in delays])
        before, total = -1, 0
        for _, work in delays:
            wake = host.clock.wait_next()
            assert wake.tick == before + wake.periods
            assert wake.periods >= 1
            assert wake.now == wake.tick * host.clock.dt
            grid = host.zero + wake.tick * PERIOD
            # the wake-up lies within its period: no tick comes before or after its time
            assert grid <= host.now < grid + PERIOD
            deadline = host.zero + (before + 1) * PERIOD
            assert wake.lateness == (host.now - deadline) / 1e9
            before, total = wake.tick, total + wake.periods
            host.now += work
        assert total == before + 1
        assert host.deadlines == sorted(set(host.deadlines))


def test_a_long_stall_skips_whole_periods(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    host = Host(monkeypatch)
    host.late = iter([0, 0, 35 * PERIOD + 400_000, 0, 0])
    wakes = [host.clock.wait_next() for _ in range(5)]
    assert [wake.tick for wake in wakes] == [0, 1, 37, 38, 39]
    assert [wake.periods for wake in wakes] == [1, 1, 36, 1, 1]
    assert wakes[2].lateness == pytest.approx(0.0354)
    assert wakes[3].lateness == 0.0


def test_a_signal_does_not_shorten_a_sleep(monkeypatch: pytest.MonkeyPatch) -> None:
    host = Host(monkeypatch)
    host.interrupts = itertools.cycle([1, 1, 0])
    for tick in range(20):
        assert host.clock.wait_next() == Wake(tick, tick * 0.001, 1, 0.0)


def prepared_host(monkeypatch: pytest.MonkeyPatch, took: int) -> tuple[Host, list[int]]:
    """Return a host with a clock that prepares ticks, and the times of that, ns before the tick."""
    host, left = Host(monkeypatch), list[int]()

    def pass_time() -> int:  # a look at the clock takes 100 ns
        host.now += 100
        return host.now

    def prepare() -> None:
        left.append(-host.now % PERIOD)
        host.now += took

    monkeypatch.setattr(clock, "time", SimpleNamespace(monotonic_ns=pass_time))
    host.clock.prepare_ticks(prepare)
    return host, left


def test_a_prepared_tick_begins_on_time(monkeypatch: pytest.MonkeyPatch) -> None:
    host, left = prepared_host(monkeypatch, 80_000)
    host.late = itertools.cycle([0, 50_000, 95_000])
    wakes = [host.clock.wait_next() for _ in range(300)]
    assert [wake.tick for wake in wakes] == list(range(300))
    assert max(wake.lateness for wake in wakes) < 1e-6
    assert min(wake.lateness for wake in wakes) >= 0.0
    assert host.deadlines[1] == host.zero + PERIOD - 200_000
    assert len(left) == 300
    assert 104_000 < min(left) < 106_000
    assert 198_000 < max(left) < 200_000


def test_a_tick_is_not_prepared_without_time_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    host, left = prepared_host(monkeypatch, 80_000)
    host.late = iter([0, 120_000, 250_000, 3 * PERIOD, 0])
    wakes = [host.clock.wait_next() for _ in range(5)]
    assert [wake.tick for wake in wakes] == [0, 1, 2, 5, 6]
    assert wakes[1].lateness < 1e-6
    assert 49e-6 < wakes[2].lateness < 51e-6
    assert len(left) == 2


def test_a_short_period_has_no_time_to_prepare(monkeypatch: pytest.MonkeyPatch) -> None:
    host = Host(monkeypatch)
    short = RealClock(0.0005)
    monkeypatch.setattr(short, "_sleep", lambda *_: host._sleep(1, 1, None, None))
    host.clock = short
    short.prepare_ticks(lambda: pytest.fail("prepared"))
    for _ in range(5):
        short.wait_next()
    assert all(deadline % 500_000 == 0 for deadline in host.deadlines)


def test_now_counts_from_tick_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    host = Host(monkeypatch)
    assert -0.002 <= host.clock.now() < -0.001
    host.clock.wait_next()
    assert host.clock.now() == 0.0
    host.clock.wait_next()
    assert host.clock.now() == 0.001


@pytest.mark.parametrize("start", [0, 1, PERIOD - 1, PERIOD, 123_456_789_012])
def test_ticks_lie_on_multiples_of_the_period(monkeypatch: pytest.MonkeyPatch, start: int) -> None:
    host = Host(monkeypatch, start)
    host.clock.wait_next()
    assert host.deadlines[0] % PERIOD == 0
    assert host.deadlines[0] - start > PERIOD


@pytest.mark.parametrize("dt", [0.0, -0.001, 1.0 / 3.0, 1.0 / 1024.0, 1e-10])
def test_a_period_of_fractional_nanoseconds_is_refused(dt: float) -> None:
    with pytest.raises(ValueError, match="whole number of nanoseconds"):
        RealClock(dt)


@pytest.mark.parametrize("dt", [0.001, 0.002, 0.005, 0.0001, 1.0 / 128.0])
def test_the_true_sleep_wakes_on_or_after_its_deadline(dt: float) -> None:
    new_clock = RealClock(dt)
    for _ in range(5):
        wake = new_clock.wait_next()
        assert wake.lateness >= 0.0
        assert new_clock.now() >= wake.now


def test_the_virtual_clock_counts_and_is_never_late() -> None:
    new_clock = VirtualClock(0.002)
    for tick in range(100):
        assert new_clock.wait_next() == (tick, tick * 0.002, 1, 0.0)
        assert new_clock.now() == tick * 0.002
