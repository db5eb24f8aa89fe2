"""Magnetic spring, tare and power of a WaveBot."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers import magnetic_spring
from controllers.blocks import interpolate
from controllers.magnetic_spring import Params, arrived, start, stator_position, step
from controllers.signals import SpringSense
from rig.kinds.wavebot.tick import tare
from rig.realtime.sequence import Phase

# MASK4 report, Table 4-1: stator position (%) -> spring rate (N/m), small displacements.
TABLE = [
    (-93.0, 8340.0), (-73.0, 7670.0), (-53.0, 5873.0), (-33.0, 3379.0), (-13.0, 490.9),
    (7.0, -2763.0), (27.0, -5715.0), (47.0, -8508.0), (67.0, -10013.0),
]  # fmt: skip
BY_RATE = sorted((rate, position) for position, rate in TABLE)
SPRING = Params(tuple(r for r, _ in BY_RATE), tuple(p for _, p in BY_RATE), tolerance=0.5)


@pytest.mark.parametrize(("position", "rate"), TABLE)
def test_the_map_is_inverted_at_its_points(position: float, rate: float) -> None:
    assert stator_position(SPRING, rate) == pytest.approx(position, abs=1e-12)


@given(st.floats(-93.0, 67.0))
def test_the_map_and_its_inverse_agree_between_points(position: float) -> None:
    positions, rates = zip(*TABLE, strict=True)
    rate = interpolate(position, positions, rates)
    assert stator_position(SPRING, rate) == pytest.approx(position, abs=1e-9)


@pytest.mark.parametrize(("rate", "end"), [(8341.0, -93.0), (1e9, -93.0), (-10014.0, 67.0)])
def test_a_rate_beyond_the_map_is_limited_to_its_end(rate: float, end: float) -> None:
    assert stator_position(SPRING, rate) == end


def test_the_stator_does_not_move_before_the_first_rate() -> None:
    state = step(SPRING, start(), 8340.0, 0)
    assert state.command.enable == 0
    assert state.commanded == 0
    assert not arrived(SPRING, state, SpringSense(0.0, 1, 0.0))


def test_the_target_is_recomputed_only_for_a_new_rate() -> None:
    state = step(SPRING, start(), 0.0, 1)
    assert state.command[:3] == (0.0, pytest.approx(-9.983, abs=1e-3), 1)
    for _ in range(10):
        assert step(SPRING, state, 0.0, 1) is state
    other = step(SPRING, state, -5715.0, 1)
    assert other.command == (-5715.0, 27.0, 1)


def test_a_stopped_stator_stays_and_continues_later() -> None:
    state = step(SPRING, start(), 5873.0, 1)
    halted = step(SPRING, state, 3379.0, 0)
    assert halted.command == (5873.0, -53.0, 0)
    assert step(SPRING, halted, 3379.0, 0) is halted
    assert step(SPRING, halted, 3379.0, 1).command == (3379.0, -33.0, 1)
    assert step(SPRING, halted, 5873.0, 1).command == (5873.0, -53.0, 1)


@pytest.mark.parametrize(
    ("position", "at_rest", "there"),
    [(27.0, 1, True), (27.5, 1, True), (26.5, 1, True), (27.51, 1, False), (26.49, 1, False),
     (27.0, 0, False), (math.nan, 1, False)],
)  # fmt: skip
def test_arrived_means_at_the_target_and_at_rest(
    position: float, at_rest: int, there: bool
) -> None:
    state = step(SPRING, start(), -5715.0, 1)
    assert arrived(SPRING, state, SpringSense(position, at_rest, 0.0)) is there


def test_the_old_target_is_not_arrival_at_the_new_one() -> None:
    state = step(SPRING, start(), -5715.0, 1)
    sense = SpringSense(27.0, 1, 0.0)
    assert arrived(SPRING, state, sense)
    assert not arrived(SPRING, step(SPRING, state, 490.9, 1), sense)


def test_the_state_holds_the_last_command() -> None:
    assert magnetic_spring.start() == ((0.0, 0.0, 0), 0)


# --- tare

CHANNELS = len(tare.RawSensors._fields)
RAW = st.builds(tare.RawSensors, *[st.floats(-9, 9)] * 2, *[st.floats(-2e3, 2e3)] * (CHANNELS - 2))
CALM = tare.RawSensors(4.6, -0.1, 0.004, 15.0, -6.0, 1.0, 40.0, 42.0)


@given(st.lists(RAW, min_size=1, max_size=40))
def test_the_zeros_are_the_means_of_the_tare(samples: list[tare.RawSensors]) -> None:
    state = tare.start()
    for raw in samples:
        state = tare.step(state, raw, Phase.TARE)
        assert state.zeros == (*samples[0], 0)  # provisional until its end
    state = tare.step(state, tare.RawSensors(*[7.0] * CHANNELS), Phase.MOVING)
    n = len(samples)
    for column in range(CHANNELS):
        mean = math.fsum(raw[column] for raw in samples) / n
        assert state.zeros[column] == pytest.approx(mean, rel=1e-9, abs=1e-9)
    assert state.zeros.samples == n
    assert tare.step(state, tare.RawSensors(*[1.0] * CHANNELS), Phase.MEASURE) is state


@given(st.lists(st.floats(-9, 9), min_size=1, max_size=30))
def test_the_span_is_the_travel_of_the_body(positions: list[float]) -> None:
    state = tare.start()
    for x in positions:
        state = tare.step(state, CALM._replace(position=x), Phase.TARE)
    assert (state.lowest, state.highest) == (min(positions), max(positions))
    over = tare.step(state, CALM, Phase.MOVING)
    assert (over.lowest, over.highest) == (0.0, 0.0)


def test_a_second_tare_starts_afresh() -> None:
    state = tare.start()
    for phase, x in ((Phase.TARE, 4.6), (Phase.MOVING, 4.7), (Phase.TARE, 4.8), (Phase.TARE, 4.81)):
        state = tare.step(state, CALM._replace(position=x), phase)
    assert (state.lowest, state.highest) == (4.8, 4.81)
    state = tare.step(state, CALM, Phase.MOVING)
    assert state.zeros.position == pytest.approx(4.805)
    assert state.zeros.samples == 2


def test_without_a_tare_the_first_tick_sets_the_zero() -> None:
    state = tare.step(tare.start(), CALM, Phase.MOVING)
    assert state.zeros == (*CALM, 0)


def test_it_starts_empty() -> None:
    assert tare.start() == (((0.0,) * CHANNELS + (0,)), 0, 0, (0.0,) * CHANNELS, 0.0, 0.0)
    seeded = tare.step(tare.start(), CALM, Phase.TARE)
    assert seeded.seeded == tare.step(seeded, CALM, Phase.MOVING).seeded == 1
