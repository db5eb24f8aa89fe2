"""The signal generator against closed forms, and the bound of its steps."""

from __future__ import annotations

from itertools import pairwise
from math import isfinite, nan, pi, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from controllers import signal_generator
from controllers.signal_generator import CHIRP, NONE, SINE, STEP, Params, SetPoint

DT = 0.001
RAMP = Params(0.2)
AT_ONCE = Params(0.0)


def forces(
    signal: SetPoint,
    ticks: int,
    params: Params = AT_ONCE,
    state: signal_generator.State | None = None,
) -> tuple[signal_generator.State, list[float]]:
    state = state or signal_generator.start()
    found = []
    for _ in range(ticks):
        state, force = signal_generator.step(params, state, signal, DT)
        found.append(force)
    return state, found


def test_a_sine_has_its_closed_form() -> None:
    _, found = forces(SetPoint(SINE, 120.0, 0.7, 0.0, 0.0), 20_000)
    for k, force in enumerate(found):
        assert force == pytest.approx(120.0 * sin(2 * pi * 0.7 * k * DT), abs=1e-7)


def test_a_chirp_has_its_closed_form_and_starts_over() -> None:
    f1, f2, duration = 0.2, 8.0, 5.0
    _, found = forces(SetPoint(CHIRP, 50.0, f1, f2, duration), 5000)
    for k, force in enumerate(found):
        t = k * DT
        phase = 2 * pi * (f1 * t + (f2 - f1) * t * t / (2 * duration))
        assert force == pytest.approx(50.0 * sin(phase), abs=1e-6)
    state, _ = forces(SetPoint(CHIRP, 50.0, f1, f2, duration), 5001)
    assert state.elapsed == pytest.approx(DT, abs=2 * DT)


def test_a_step_is_ramped() -> None:
    _, found = forces(SetPoint(STEP, 100.0, 0.0, 0.0, 0.0), 400, RAMP)
    for k, force in enumerate(found, 1):
        assert force == pytest.approx(min(100.0, 100.0 * k * DT / 0.2), abs=1e-9)


def test_an_amplitude_is_ramped_from_the_present_one() -> None:
    state, _ = forces(SetPoint(SINE, 100.0, 1.0, 0.0, 0.0), 500, RAMP)
    for k in range(1, 300):
        state, _ = signal_generator.step(RAMP, state, SetPoint(SINE, 40.0, 1.0, 0.0, 0.0), DT)
        assert state.amplitude.value == pytest.approx(max(40.0, 100.0 - 60.0 * k * DT / 0.2))


@pytest.mark.parametrize("first", [SINE, STEP, CHIRP])
@pytest.mark.parametrize("then", [NONE, SINE, STEP, CHIRP])
def test_another_kind_first_ramps_to_zero(first: int, then: int) -> None:
    if first == then:
        return
    state, _ = forces(SetPoint(first, 100.0, 2.0, 3.0, 5.0), 333, RAMP)
    amplitudes = []
    for _ in range(450):
        before = state
        state, _ = signal_generator.step(RAMP, state, SetPoint(then, 80.0, 2.0, 3.0, 5.0), DT)
        amplitudes.append(state.amplitude.value)
        if state.kind != before.kind:
            assert before.amplitude.value == 0.0
    assert 0.0 in amplitudes
    assert amplitudes[-1] == (0.0 if then == NONE else 80.0)


signals = st.builds(
    SetPoint,
    st.sampled_from([NONE, SINE, STEP, CHIRP]).map(float),
    st.floats(0.0, 500.0),
    st.floats(0.0, 20.0),
    st.floats(0.0, 20.0),
    st.floats(1.0, 60.0),
)


@settings(max_examples=examples(150))
@given(st.lists(st.tuples(signals, st.integers(1, 400)), min_size=1, max_size=6))
def test_no_force_jumps(sets: list[tuple[SetPoint, int]]) -> None:
    """A tick changes the force by the amplitude's ramp and by the sine's slope, no more."""
    state, found, bound = signal_generator.start(), [0.0], 0.0
    for signal, ticks in sets:
        state, more = forces(signal, ticks, RAMP, state)
        found += more
    largest = max(signal.amplitude for signal, _ in sets)
    bound = largest * DT / RAMP.ramp + largest * 2 * pi * 20.0 * DT
    assert all(abs(b - a) <= bound * (1 + 1e-9) for a, b in pairwise(found))
    assert all(abs(force) <= largest * (1 + 1e-12) for force in found)


def test_at_rest_nothing_is_left_to_do() -> None:
    state, _ = forces(SetPoint(SINE, 100.0, 1.0, 0.0, 0.0), 300, RAMP)
    off = SetPoint(NONE, 0.0, 1.0, 0.0, 0.0)
    assert not signal_generator.at_rest(state, off)
    state, found = forces(off, 250, RAMP, state)
    assert signal_generator.at_rest(state, off)
    assert found[-1] == 0.0


@pytest.mark.parametrize(
    "bad", [SetPoint(SINE, nan, 1.0, 0.0, 0.0), SetPoint(SINE, 10.0, nan, 0.0, 0.0)]
)
def test_a_number_that_is_not_finite_never_becomes_a_force(bad: SetPoint) -> None:
    _, found = forces(bad, 5, RAMP)
    assert not isfinite(found[-1])
