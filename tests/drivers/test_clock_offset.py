"""Clock offset with drift and delays: ages never too small, and close to the true ones."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from drivers import clock_offset

WINDOW = 2.0


@given(
    st.lists(st.floats(0.0, 0.1), min_size=1, max_size=200),
    st.floats(-1e6, 1e6),
    st.floats(0.001, 3.0),
)
def test_a_sample_time_is_never_after_its_arrival(
    delays: list[float], offset: float, period: float
) -> None:
    state = clock_offset.start()
    smallest = min(delays)
    for n, delay in enumerate(delays):
        taken = n * period
        state = clock_offset.step(state, WINDOW, taken - offset, taken + delay)
        host_time = clock_offset.to_host_time(state, taken - offset)
        assert host_time <= taken + delay + 1e-6
        assert host_time >= taken + smallest - 1e-6


def test_one_quick_message_is_enough() -> None:
    state = clock_offset.start()
    for n in range(1000):
        delay = 0.001 if n == 300 else 0.020 + 0.001 * (n % 7)
        state = clock_offset.step(state, WINDOW, 50.0 + n * 0.001, n * 0.001 + delay)
    assert abs(clock_offset.to_host_time(state, 50.5) - 0.501) < 1e-9


def test_drift_is_followed_within_two_windows() -> None:
    for drift in (100e-6, -100e-6):
        state = clock_offset.start()
        worst_young = worst_old = 0.0
        for n in range(60_000):
            taken = n * 0.001
            state = clock_offset.step(state, WINDOW, taken * (1.0 + drift), taken)
            off = clock_offset.to_host_time(state, taken * (1.0 + drift)) - taken
            worst_young, worst_old = max(worst_young, off), min(worst_old, off)
        assert worst_young < 1e-9  # the reported age is never too small
        assert worst_old > -2.0 * WINDOW * 100e-6 - 1e-6


def test_after_a_long_silence_the_old_windows_count_no_more() -> None:
    state = clock_offset.step(clock_offset.start(), WINDOW, 0.0, 0.0)
    state = clock_offset.step(state, WINDOW, 100.0, 100.5)  # the clock lost half a second
    assert clock_offset.to_host_time(state, 100.0) == 100.5
    state = clock_offset.step(clock_offset.start(), WINDOW, 0.0, 0.0)
    state = clock_offset.step(state, WINDOW, 2.5, 3.0)  # the previous window still counts
    assert clock_offset.to_host_time(state, 2.5) == 2.5
