"""Alignment of a recorder's clock, compared with true parameters drawn from seeds."""

from __future__ import annotations

import numpy as np
import pytest
from two_clocks import Truth, draw_truth, make_recording, make_reference

from rig.interop.basin.align import (
    Alignment,
    Clock,
    MatchedChannel,
    SyncReference,
    align,
    phase_track,
)

SEEDS = 200


def align_truth(truth: Truth, seed: int) -> Alignment:
    return align(make_recording(truth, seed), make_reference(truth), "TTLTrigger", "SINESIGNAL")


def errors(alignment: Alignment, truth: Truth) -> tuple[float, float]:
    """Return the greatest error of run time over the record (s), and the error of the drift."""
    tau = np.array([0.0, 0.5, 1.0]) * truth.length
    largest = np.abs(alignment.clock.to_run(tau) - truth.run_time(tau)).max()
    return float(largest), alignment.clock.drift - truth.drift


def test_900_s_at_50_hz_and_20_db_over_200_seeds() -> None:
    """Run time within 1 ms in the whole record, drift within 1 ppm, false alarms in at most 1 %.

    In theory the drift's standard error is 0.29 ppm: 2.25 ms a cycle / (900 s sqrt(900 / 12)).
    The reported errors are right: normalised by them, errors have a deviation of 1 +- 0.15
    (3 / sqrt(2 N)).
    """
    truths = [draw_truth(seed) for seed in range(SEEDS)]
    found = [align_truth(truth, seed) for seed, truth in enumerate(truths)]
    assert sum(bool(alignment.alarms) for alignment in found) <= 0.01 * SEEDS
    offset, drift = np.array([errors(*pair) for pair in zip(found, truths, strict=True)]).T
    assert offset.max() < 1e-3
    assert np.abs(drift).max() < 1e-6
    assert np.std(drift) == pytest.approx(0.29e-6, rel=0.2)
    assert np.std(drift / [alignment.clock.drift_error for alignment in found]) == pytest.approx(
        1.0, abs=0.15
    )
    by_edge = np.array([alignment.edge_residual for alignment in found])
    assert np.abs(by_edge).max() <= 0.011  # half a step of 20 ms, and the tick
    assert np.std(by_edge) == pytest.approx(0.02 / 12**0.5, rel=0.2)
    assert np.abs([alignment.correlation_residual for alignment in found]).max() < 1e-3


def test_900_s_at_200_hz() -> None:
    """Four times the samples give half the error; 40 seeds without a false alarm."""
    truths = [draw_truth(seed, rate=200.0) for seed in range(40)]
    found = [align_truth(truth, seed) for seed, truth in enumerate(truths)]
    assert not any(alignment.alarms for alignment in found)
    offset, drift = np.array([errors(*pair) for pair in zip(found, truths, strict=True)]).T
    assert offset.max() < 5e-4
    assert np.abs(drift).max() < 0.6e-6
    assert np.std(drift) == pytest.approx(0.145e-6, rel=0.35)  # 3 / sqrt(2 N)


@pytest.mark.parametrize("rate", [50.0, 200.0])
@pytest.mark.parametrize("slip", [0.02, -0.02])
def test_slip_in_the_middle_is_detected_and_corrected(rate: float, slip: float) -> None:
    truth = draw_truth(11, rate=rate, slip=slip, slip_at=430.0)
    alignment = align_truth(truth, 11)
    (alarm,) = alignment.alarms
    assert "slips by" in alarm
    assert alignment.clock.slip == pytest.approx(slip, abs=1e-3)
    assert alignment.clock.slip_at == pytest.approx(430.0, abs=2.0)
    tau = np.array([0.0, 400.0, 460.0, 900.0])
    assert np.abs(alignment.clock.to_run(tau) - truth.run_time(tau)).max() < 2e-3


def test_slip_of_5_ms_is_detected_and_noise_is_not() -> None:
    assert align_truth(draw_truth(4, slip=0.005), 4).clock.slip == pytest.approx(0.005, abs=1e-3)
    assert align_truth(draw_truth(4), 4).clock.slip == 0.0


@pytest.mark.parametrize("delay", [0.04, -0.04, 0.3])
def test_disagreement_of_trigger_and_sine_raises_an_alarm(delay: float) -> None:
    """The limit is 25 ms; with a step of 20 ms, 40 ms always raise the alarm."""
    for seed in range(5):
        alignment = align_truth(draw_truth(seed, edge_error=delay), seed)
        assert any("trigger and sine disagree" in alarm for alarm in alignment.alarms), seed


def test_delay_below_one_step_raises_no_alarm() -> None:
    assert not align_truth(draw_truth(1, edge_error=0.01), 1).alarms


def test_wrong_rate_of_the_file_raises_an_alarm() -> None:
    (alarm,) = align_truth(draw_truth(2, drift=1e-3), 2).alarms
    assert "rate of the file" in alarm


def test_noisy_sine_raises_an_alarm() -> None:
    assert any("dB above" in alarm for alarm in align_truth(draw_truth(2, snr_db=0.0), 2).alarms)


def test_sine_may_come_from_a_generator_with_its_own_clock() -> None:
    """Both sides record a sine of 1.00003 Hz with any phase; only their difference matters."""
    truth, seed = draw_truth(8), 8
    record, run_reference = make_recording(truth, seed), make_reference(truth)

    def generator(t: np.ndarray) -> np.ndarray:
        return np.sin(2.0 * np.pi * 1.00003 * t + 2.1)

    random = np.random.default_rng(99)
    noise = 0.05 * random.normal(size=record.time.size)
    record.channels["SINESIGNAL"][:] = generator(truth.run_time(record.time)) + noise
    t = np.arange(0.0, 900.0, 0.005)
    track = phase_track(t, generator(t) + 0.05 * random.normal(size=t.size), 1.0)
    alignment = align(record, SyncReference(run_reference.edge, track), "TTLTrigger", "SINESIGNAL")
    offset, drift = errors(alignment, truth)
    assert not alignment.alarms
    assert offset < 1e-3
    assert abs(drift) < 1e-6


def test_edge_alone_gives_an_offset_without_drift() -> None:
    truth = draw_truth(3)
    alignment = align(make_recording(truth, 3), make_reference(truth), "TTLTrigger", None)
    assert (alignment.method, alignment.alarms) == ("edge", ())
    assert "drift is not known" in alignment.remarks[0]
    tau = truth.edge - truth.offset
    assert alignment.clock.to_run(tau) == pytest.approx(truth.run_time(np.array(tau)), abs=0.011)
    assert alignment.clock.error(tau) == pytest.approx(0.02 / 12**0.5, rel=0.01)
    assert alignment.clock.error(tau + 900.0) > 0.04  # a quartz clock may drift by 50 ppm


def test_missing_edge_requires_a_stated_offset() -> None:
    truth = draw_truth(3, edge=1e6)
    record, run_reference = make_recording(truth, 3), make_reference(truth)
    record.channels["TTLTrigger"][:] = 0.0
    with pytest.raises(ValueError, match="does not rise"):
        align(record, run_reference, "TTLTrigger", "SINESIGNAL")
    alignment = align(
        record, run_reference, "TTLTrigger", "SINESIGNAL", stated_offset=truth.offset + 0.2
    )
    assert errors(alignment, truth)[0] < 1e-3  # the sine corrects the stated offset


def irregular_wave(t: np.ndarray) -> np.ndarray:
    """Return a wave of 40 lines, 0.2 to 1 Hz, at run time t."""
    random = np.random.default_rng(42)
    lines = zip(random.uniform(0.2, 1.0, 40), random.uniform(0.0, 6.28, 40), strict=True)
    return sum((np.sin(2 * np.pi * f * t + phase) for f, phase in lines), np.zeros_like(t))


@pytest.mark.parametrize("slip", [0.0, 0.02])
def test_matched_channel_replaces_the_sine(slip: float) -> None:
    """A wave with 20 dB on both sides and a slope of 4.1 per second: the standard error is
    0.1 sqrt(2) / (4.1 sqrt(400)) = 1.7 ms per block of 10 s, 0.2 ms and 0.8 ppm for 87 blocks;
    a slip increases it.
    """
    truth, random = draw_truth(5, slip=slip), np.random.default_rng(6)
    record = make_recording(truth, 5)
    tau = record.time
    noise = 0.1 * np.std(irregular_wave(tau))
    record.channels["wave"][:] = irregular_wave(truth.run_time(tau)) + noise * random.normal(
        size=tau.size
    )
    t = np.arange(0.0, 870.0, 0.01)
    match = MatchedChannel("wave", t, irregular_wave(t) + noise * random.normal(size=t.size))
    alignment = align(record, make_reference(truth), "TTLTrigger", None, match=match)
    tau = np.array([0.0, 400.0, 500.0, 900.0])  # outside the block with the slip
    assert np.abs(alignment.clock.to_run(tau) - truth.run_time(tau)).max() < (
        2e-3 if slip else 1e-3
    )
    assert alignment.clock.drift == pytest.approx(truth.drift, abs=8e-6 if slip else 3e-6)
    assert np.std(alignment.residuals) == pytest.approx(1.9e-3, rel=0.3)
    assert bool(alignment.alarms) == (slip != 0.0)
    assert alignment.clock.slip == pytest.approx(slip, abs=4e-3)


def test_uncorrelated_matched_channel_is_refused() -> None:
    truth = draw_truth(5)
    t = np.arange(0.0, 870.0, 0.01)
    match = MatchedChannel("wave", t, np.random.default_rng(1).normal(size=t.size))
    with pytest.raises(ValueError, match="correlate in 0 of 86 blocks of 10 s; needed 5"):
        align(make_recording(truth, 5), make_reference(truth), "TTLTrigger", None, match=match)


def test_clock_conversion_round_trip() -> None:
    clock = Clock(3.0, 20e-6, 450.0, 1e-4, 1e-7, 400.0, 0.02)
    tau = np.array([0.0, 399.99, 400.0, 900.0])
    assert np.allclose(clock.from_run(clock.to_run(tau)), tau, rtol=0.0, atol=1e-9)
    skipped = clock.to_run(400.0) - 0.01
    assert clock.from_run(skipped) == 400.0
