"""Frequency responses and their bands: exact values and coverage."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from known_device import impedances, make_experiment

from rig.identification import frf
from rig.identification.experiments import BODY
from rig.identification.families import family
from rig.identification.frf import Channel, band_factor, response
from rig.identification.impedances import models, ratio


def test_without_noise_the_impedances_are_exact() -> None:
    (model,) = models([make_experiment(1), make_experiment(2)])
    intrinsic, series = impedances(model.frequency, -5715.0)
    assert model.frequency[[0, -1]] == pytest.approx([0.2, 1.0])
    responses = model.responses
    assert np.allclose(responses["Z_i"].value, intrinsic, rtol=1e-12)
    assert np.allclose(responses["Z_id"].value, series, rtol=1e-12)
    assert np.allclose(responses["Z_d"].value, series - intrinsic, rtol=1e-9)
    assert np.allclose(responses["Y_i"].value * intrinsic, 1.0)
    assert np.allclose(responses["Y_id_command"].value * series, 1.0)
    quotient = ratio(model)
    assert quotient is not None
    assert np.allclose(quotient, series / intrinsic)
    (member,) = family([model], [make_experiment(1), make_experiment(2)])
    assert member.drivetrain_damping == pytest.approx(724.0)
    assert member.drivetrain_stiffness == pytest.approx(-5715.0)


@pytest.mark.parametrize(("realisations", "periods"), [(1, 2), (2, 2), (3, 4)])
def test_coverage_of_the_band_of_periods(realisations: int, periods: int) -> None:
    """95 +- 3 % of the lines of 300 experiments; 5,100 lines give 0.3 % of standard error.

    Noise in force and velocity alike, 2 % of a line: F(2, 2M(P-1)) from two periods on.
    """
    inside, radii = 0, []
    for trial in range(300):
        (model,) = models(
            [make_experiment(trial, periods, 0.02, row=i) for i in range(realisations)]
        )
        expected, _ = impedances(model.frequency, -5715.0)
        z_i = model.responses["Z_i"]
        inside += int(np.sum(np.abs(z_i.value - expected) <= z_i.noise))
        radii.append(z_i.noise)
    covered = inside / (300 * 17)
    assert 0.92 <= covered <= 0.98, covered
    assert band_factor(realisations * (periods - 1)) ** 2 > 3.0  # larger than for a known variance


def test_coverage_of_the_band_of_realisations() -> None:
    """Distortion that depends on the realisation, not on the period, is only in the total band."""
    inside = {"noise": 0, "total": 0}
    rng = np.random.default_rng(7)
    for _ in range(300):
        references = [np.exp(1j * rng.uniform(0, 6.28, 10)) for _ in range(4)]

        def distorted(gain: complex, deviation: float, refs: Any = references) -> Channel:
            pairs = [rng.normal(size=(2, 10)) for _ in refs]
            per_realisation = [
                gain * r + deviation * (pair[0] + 1j * pair[1])
                for r, pair in zip(refs, pairs, strict=True)
            ]
            return Channel(tuple(np.stack([z, z]) for z in per_realisation))

        result = response(distorted(3 + 1j, 0.05), distorted(1.0, 0.01), references)
        error = np.abs(result.value - (3 + 1j))
        inside["noise"] += int(np.sum(error <= result.noise))
        inside["total"] += int(np.sum(error <= result.total))
    assert inside["noise"] == 0
    assert 0.92 <= inside["total"] / 3000 <= 0.98


def test_input_noise_does_not_bias_the_response() -> None:
    """Regression on a measured input is biased by its noise; the reference is not."""
    experiments_ = [make_experiment(i, 2, 0.3, row=i) for i in range(400)]
    (model,) = models(experiments_)
    expected, _ = impedances(model.frequency, -5715.0)
    index = np.argmin(np.abs(model.frequency - 0.4))
    assert abs(model.responses["Z_i"].value[index] / expected[index] - 1.0) < 0.02
    velocity = np.concatenate([item.channels["velocity"] for item in experiments_])
    force = np.concatenate([item.channels[BODY] for item in experiments_])
    used = experiments_[0].excited
    regression = np.sum(force * velocity.conj(), axis=0) / np.sum(np.abs(velocity) ** 2, axis=0)
    assert abs(regression[used][index] / expected[index] - 1.0) > 0.05


def test_a_repeated_realisation_adds_periods() -> None:
    (model,) = models([make_experiment(1), make_experiment(1), make_experiment(2)])
    assert (model.realisations, model.periods) == (2, 6)


def test_one_period_of_one_realisation_has_no_band() -> None:
    (model,) = models([make_experiment(1, 1, 0.01)])
    assert np.isnan(model.responses["Z_i"].band).all()
    assert np.isnan(band_factor(0))


def test_each_amplitude_has_its_own_model() -> None:
    peaks = (770.0, 771.0, 1540.0)
    by_amplitude = models([make_experiment(i, peak=peak) for i, peak in enumerate(peaks)])
    assert [model.realisations for model in by_amplitude] == [2, 1]


def test_detection_lines_separate_even_from_odd() -> None:
    """A reference on odd lines, with a response of 1 % on even lines."""
    odd_experiment = make_experiment(1, 3)
    number = np.array(odd_experiment.lines)
    odd = odd_experiment.excited & (number % 2 == 1)
    reference = np.where(odd, odd_experiment.reference, 0.0)
    velocity = np.where(odd, 0.1 + 0j, np.where(number % 2 == 0, 0.001, 0.0))
    channels = {**odd_experiment.channels, "velocity": np.repeat(velocity[None, :], 3, axis=0)}
    odd_experiment = odd_experiment._replace(reference=reference, excited=odd, channels=channels)
    (member,) = family(models([odd_experiment]), [odd_experiment])
    assert member.even == pytest.approx(0.01)
    assert np.isnan(member.odd)  # no odd line was left out
    assert member.noise_floor == 0.0


def test_a_line_without_reference_is_nan() -> None:
    channel = Channel((np.ones((2, 3), complex),))
    result = frf.response(channel, channel, [np.array([1.0, 0.0, 1.0 + 0j])])
    assert np.isnan(result.value[1])
    assert result.value[0] == 1.0
