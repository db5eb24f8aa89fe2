"""Alignment of a recorder's clock against truths drawn from seeds that it does not see."""

from __future__ import annotations

import numpy as np
import pytest
from two_clocks import Truth, drawn, recording, reference

from rig.interop.basin.align import Alignment, Reference, Twin, align
from rig.interop.basin.clock import Clock
from rig.interop.basin.sync import phase_track

SEEDS = 200


def aligned(truth: Truth, seed: int) -> Alignment:
    return align(recording(truth, seed), reference(truth), "TTLTrigger", "SINESIGNAL")


def errors(one: Alignment, truth: Truth) -> tuple[float, float]:
    """Greatest error of run time over the record (s), and the error of the drift."""
    tau = np.array([0.0, 0.5, 1.0]) * truth.length
    worst = np.abs(one.clock.to_run(tau) - truth.run_time(tau)).max()
    return float(worst), one.clock.drift - truth.drift


def test_900_s_at_50_hz_and_20_db_over_200_seeds() -> None:
    """Anywhere in the record below 1 ms, drift below 1 ppm, no false alarm in 200 (1 % allowed).

    By theory the drift's standard error is 0.29 ppm: 2.25 ms a cycle / (900 s sqrt(900 / 12)).
    The stated errors are right: in their units, errors have a deviation of 1 +- 0.15
    (3 / sqrt(2 N)).
    """
    truths = [drawn(seed) for seed in range(SEEDS)]
    found = [aligned(truth, seed) for seed, truth in enumerate(truths)]
    assert sum(bool(one.alarms) for one in found) <= 0.01 * SEEDS
    offset, drift = np.array([errors(*pair) for pair in zip(found, truths, strict=True)]).T
    assert offset.max() < 1e-3
    assert np.abs(drift).max() < 1e-6
    assert np.std(drift) == pytest.approx(0.29e-6, rel=0.2)
    assert np.std(drift / [one.clock.drift_error for one in found]) == pytest.approx(1.0, abs=0.15)
    by_edge = np.array([one.edge_less_fit for one in found])
    assert np.abs(by_edge).max() <= 0.011  # half a step of 20 ms, and the tick
    assert np.std(by_edge) == pytest.approx(0.02 / 12**0.5, rel=0.2)
    assert np.abs([one.correlation_less_fit for one in found]).max() < 1e-3


def test_900_s_at_200_hz() -> None:
    """Four times the samples: half the error, of 40 seeds. No false alarm among them."""
    truths = [drawn(seed, rate=200.0) for seed in range(40)]
    found = [aligned(truth, seed) for seed, truth in enumerate(truths)]
    assert not any(one.alarms for one in found)
    offset, drift = np.array([errors(*pair) for pair in zip(found, truths, strict=True)]).T
    assert offset.max() < 5e-4
    assert np.abs(drift).max() < 0.6e-6
    assert np.std(drift) == pytest.approx(0.145e-6, rel=0.35)  # 3 / sqrt(2 N)


@pytest.mark.parametrize("rate", [50.0, 200.0])
@pytest.mark.parametrize("slip", [0.02, -0.02])
def test_a_slip_in_the_middle_is_found_and_followed(rate: float, slip: float) -> None:
    truth = drawn(11, rate=rate, slip=slip, slip_at=430.0)
    one = aligned(truth, 11)
    (said,) = one.alarms
    assert "slips by" in said
    assert one.clock.slip == pytest.approx(slip, abs=1e-3)
    assert one.clock.slip_at == pytest.approx(430.0, abs=2.0)
    tau = np.array([0.0, 400.0, 460.0, 900.0])
    assert np.abs(one.clock.to_run(tau) - truth.run_time(tau)).max() < 2e-3


def test_a_slip_of_5_ms_is_found_too_and_noise_is_not() -> None:
    assert aligned(drawn(4, slip=0.005), 4).clock.slip == pytest.approx(0.005, abs=1e-3)
    assert aligned(drawn(4), 4).clock.slip == 0.0


@pytest.mark.parametrize("late", [0.04, -0.04, 0.3])
def test_trigger_and_sine_that_disagree_are_alarmed(late: float) -> None:
    """By more than 25 ms: with a step of 20 ms, 40 ms are told in any case."""
    for seed in range(5):
        one = aligned(drawn(seed, edge_error=late), seed)
        assert any("trigger and sine disagree" in said for said in one.alarms), seed


def test_a_delay_below_the_step_is_no_alarm() -> None:
    assert not aligned(drawn(1, edge_error=0.01), 1).alarms


def test_a_rate_that_is_not_the_files_is_alarmed() -> None:
    (said,) = aligned(drawn(2, drift=1e-3), 2).alarms
    assert "rate of the file" in said


def test_a_sine_in_noise_is_alarmed() -> None:
    assert any("dB above" in said for said in aligned(drawn(2, snr_db=0.0), 2).alarms)


def test_the_runs_own_sine_may_come_from_a_generator_with_a_clock_of_its_own() -> None:
    """Both sides record a sine of 1.00003 Hz with any phase: only the clocks' difference counts."""
    truth, seed = drawn(8), 8
    record, own = recording(truth, seed), reference(truth)

    def generator(t: np.ndarray) -> np.ndarray:
        return np.sin(2.0 * np.pi * 1.00003 * t + 2.1)

    random = np.random.default_rng(99)
    noise = 0.05 * random.normal(size=record.time.size)
    record.channels["SINESIGNAL"][:] = generator(truth.run_time(record.time)) + noise
    t = np.arange(0.0, 900.0, 0.005)
    track = phase_track(t, generator(t) + 0.05 * random.normal(size=t.size), 1.0)
    one = align(record, Reference(own.edge, track), "TTLTrigger", "SINESIGNAL")
    offset, drift = errors(one, truth)
    assert not one.alarms
    assert offset < 1e-3
    assert abs(drift) < 1e-6


def test_edge_alone_gives_an_offset_and_says_what_it_cannot() -> None:
    truth = drawn(3)
    one = align(recording(truth, 3), reference(truth), "TTLTrigger", None)
    assert (one.method, one.alarms) == ("edge", ())
    assert "drift is not known" in one.remarks[0]
    tau = truth.edge - truth.offset
    assert one.clock.to_run(tau) == pytest.approx(truth.run_time(np.array(tau)), abs=0.011)
    assert one.clock.error(tau) == pytest.approx(0.02 / 12**0.5, rel=0.01)
    assert one.clock.error(tau + 900.0) > 0.04  # a quartz may be off by 50 ppm


def test_without_any_edge_a_person_must_state_the_offset() -> None:
    truth = drawn(3, edge=1e6)
    record, own = recording(truth, 3), reference(truth)
    record.channels["TTLTrigger"][:] = 0.0
    with pytest.raises(ValueError, match="does not rise"):
        align(record, own, "TTLTrigger", "SINESIGNAL")
    one = align(record, own, "TTLTrigger", "SINESIGNAL", stated=truth.offset + 0.2)
    assert errors(one, truth)[0] < 1e-3  # the sine mends what the statement lacks


def irregular(t: np.ndarray) -> np.ndarray:
    """A wave of many lines, 0.2 to 1 Hz, at run time t."""
    random = np.random.default_rng(42)
    lines = zip(random.uniform(0.2, 1.0, 40), random.uniform(0.0, 6.28, 40), strict=True)
    return sum((np.sin(2 * np.pi * f * t + phase) for f, phase in lines), np.zeros_like(t))


@pytest.mark.parametrize("slip", [0.0, 0.02])
def test_what_both_recorded_stands_in_for_a_sine(slip: float) -> None:
    """A wave, 20 dB on both sides, with a slope of 4.1 a second: a block of 10 s is good to
    0.1 sqrt(2) / (4.1 sqrt(400)) = 1.7 ms, 87 of them to 0.2 ms and 0.8 ppm; a slip costs more.
    """
    truth, random = drawn(5, slip=slip), np.random.default_rng(6)
    record = recording(truth, 5)
    tau = record.time
    noise = 0.1 * np.std(irregular(tau))
    record.channels["wave"][:] = irregular(truth.run_time(tau)) + noise * random.normal(
        size=tau.size
    )
    t = np.arange(0.0, 870.0, 0.01)
    twin = Twin("wave", t, irregular(t) + noise * random.normal(size=t.size))
    one = align(record, reference(truth), "TTLTrigger", None, twin=twin)
    tau = np.array([0.0, 400.0, 500.0, 900.0])  # apart from the block in which it slips
    assert np.abs(one.clock.to_run(tau) - truth.run_time(tau)).max() < (2e-3 if slip else 1e-3)
    assert one.clock.drift == pytest.approx(truth.drift, abs=8e-6 if slip else 3e-6)
    assert np.std(one.residual) == pytest.approx(1.9e-3, rel=0.3)
    assert bool(one.alarms) == (slip != 0.0)
    assert one.clock.slip == pytest.approx(slip, abs=4e-3)


def test_twins_that_are_none_are_refused() -> None:
    truth = drawn(5)
    t = np.arange(0.0, 870.0, 0.01)
    twin = Twin("wave", t, np.random.default_rng(1).normal(size=t.size))
    with pytest.raises(ValueError, match="alike in 0 of 86 blocks of 10 s; needed 5"):
        align(recording(truth, 5), reference(truth), "TTLTrigger", None, twin=twin)


def test_a_clock_there_and_back() -> None:
    clock = Clock(3.0, 20e-6, 450.0, 1e-4, 1e-7, 400.0, 0.02)
    tau = np.array([0.0, 399.99, 400.0, 900.0])
    assert np.allclose(clock.from_run(clock.to_run(tau)), tau, rtol=0.0, atol=1e-9)
    left_out = clock.to_run(400.0) - 0.01
    assert clock.from_run(left_out) == 400.0
