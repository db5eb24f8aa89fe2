"""Responses and their bands, against what is known and against chance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from known_device import experiment, impedances

from rig.identification import frf
from rig.identification.families import family
from rig.identification.frf import Channel, factor, response
from rig.identification.impedances import models, ratio


def test_without_noise_the_impedances_are_exact() -> None:
    (model,) = models([experiment(1), experiment(2)])
    intrinsic, series = impedances(model.frequency, -5715.0)
    assert model.frequency[[0, -1]] == pytest.approx([0.2, 1.0])
    found = model.responses
    assert np.allclose(found["Z_i"].value, intrinsic, rtol=1e-12)
    assert np.allclose(found["Z_id"].value, series, rtol=1e-12)
    assert np.allclose(found["Z_d"].value, series - intrinsic, rtol=1e-9)
    assert np.allclose(found["Y_i"].value * intrinsic, 1.0)
    assert np.allclose(found["Y_id_command"].value * series, 1.0)
    quotient = ratio(model)
    assert quotient is not None
    assert np.allclose(quotient, series / intrinsic)
    (member,) = family([model], [experiment(1), experiment(2)])
    assert member.drivetrain_damping == pytest.approx(724.0)
    assert member.drivetrain_stiffness == pytest.approx(-5715.0)


@pytest.mark.parametrize(("realisations", "periods"), [(1, 2), (2, 2), (3, 4)])
def test_the_band_of_periods_covers_what_it_says(realisations: int, periods: int) -> None:
    """95 +- 3 % of the lines of 300 experiments; 5,100 lines give 0.3 % of standard error.

    Noise in force and velocity alike, 2 % of a line: F(2, 2M(P-1)) from two periods on.
    """
    inside, radii = 0, []
    for trial in range(300):
        (model,) = models([experiment(trial, periods, 0.02, row=i) for i in range(realisations)])
        true, _ = impedances(model.frequency, -5715.0)
        found = model.responses["Z_i"]
        inside += int(np.sum(np.abs(found.value - true) <= found.noise))
        radii.append(found.noise)
    share = inside / (300 * 17)
    assert 0.92 <= share <= 0.98, share
    assert factor(realisations * (periods - 1)) ** 2 > 3.0  # above that of a known variance


def test_the_band_of_realisations_covers_distortion() -> None:
    """What depends on the realisation, and not on the period, is in the total band alone."""
    inside = {"noise": 0, "total": 0}
    rng = np.random.default_rng(7)
    for _ in range(300):
        references = [np.exp(1j * rng.uniform(0, 6.28, 10)) for _ in range(4)]

        def distorted(gain: complex, size: float, refs: Any = references) -> Channel:
            pairs = [rng.normal(size=(2, 10)) for _ in refs]
            same = [gain * r + size * (p[0] + 1j * p[1]) for r, p in zip(refs, pairs, strict=True)]
            return Channel(tuple(np.stack([z, z]) for z in same))

        found = response(distorted(3 + 1j, 0.05), distorted(1.0, 0.01), references)
        off = np.abs(found.value - (3 + 1j))
        inside["noise"] += int(np.sum(off <= found.noise))
        inside["total"] += int(np.sum(off <= found.total))
    assert inside["noise"] == 0
    assert 0.92 <= inside["total"] / 3000 <= 0.98


def test_noise_at_the_input_does_not_bend_the_response() -> None:
    """Regression on a measured input is biased by its noise; the reference is not."""
    made = [experiment(i, 2, 0.3, row=i) for i in range(400)]
    (model,) = models(made)
    true, _ = impedances(model.frequency, -5715.0)
    middle = np.argmin(np.abs(model.frequency - 0.4))
    assert abs(model.responses["Z_i"].value[middle] / true[middle] - 1.0) < 0.02
    velocity = np.concatenate([one.channels["velocity"] for one in made])
    force = np.concatenate([one.channels["lcb"] for one in made])
    used = made[0].excited
    plain = np.sum(force * velocity.conj(), axis=0) / np.sum(np.abs(velocity) ** 2, axis=0)
    assert abs(plain[used][middle] / true[middle] - 1.0) > 0.05


def test_a_realisation_that_is_run_again_is_more_periods_of_it() -> None:
    (model,) = models([experiment(1), experiment(1), experiment(2)])
    assert (model.realisations, model.periods) == (2, 6)


def test_one_period_of_one_realisation_has_no_band() -> None:
    (model,) = models([experiment(1, 1, 0.01)])
    assert np.isnan(model.responses["Z_i"].band).all()
    assert np.isnan(factor(0))


def test_amplitudes_make_models_of_their_own() -> None:
    peaks = (770.0, 771.0, 1540.0)
    made = models([experiment(i, peak=peak) for i, peak in enumerate(peaks)])
    assert [m.realisations for m in made] == [2, 1]


def test_detection_lines_tell_even_from_odd() -> None:
    """A reference on odd lines, an answer on even ones of a hundredth of it."""
    one = experiment(1, 3)
    number = np.array(one.lines)
    odd = one.excited & (number % 2 == 1)
    reference = np.where(odd, one.reference, 0.0)
    velocity = np.where(odd, 0.1 + 0j, np.where(number % 2 == 0, 0.001, 0.0))
    channels = {**one.channels, "velocity": np.repeat(velocity[None, :], 3, axis=0)}
    one = one._replace(reference=reference, excited=odd, channels=channels)
    (member,) = family(models([one]), [one])
    assert member.even == pytest.approx(0.01)
    assert np.isnan(member.odd)  # no odd line was left out
    assert member.silence == 0.0


def test_a_line_without_reference_is_no_number() -> None:
    channel = Channel((np.ones((2, 3), complex),))
    found = frf.response(channel, channel, [np.array([1.0, 0.0, 1.0 + 0j])])
    assert np.isnan(found.value[1])
    assert found.value[0] == 1.0
