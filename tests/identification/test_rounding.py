"""Rounding to whole counts: spectrum of its error, the part that periods share, bands with it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from known_device import make_experiment

from rig.identification.comparison import _values
from rig.identification.frf import band_radius
from rig.identification.impedances import models
from rig.spectra.periods import amplitudes
from rig.spectra.rounding import shared_rounding

PERIOD, LINES, TICK = 4000, 20, 0.001


def motion(rng: Any, deviation: float, lines: Any = range(1, LINES + 1)) -> Any:
    """Return one period of a multisine with random phases, standard deviation in counts."""
    phase = 2.0 * np.pi * np.arange(PERIOD) / PERIOD
    total = sum(np.cos(k * phase + rng.uniform(0.0, 2.0 * np.pi)) for k in lines)
    return deviation * total / np.std(total) + rng.uniform()


def rounding_error(samples: Any, periods: int, exact: Any) -> Any:
    """Return the error of the mean lines of rounded samples."""
    found = amplitudes(np.rint(samples), 0.0, TICK, PERIOD, LINES)
    assert len(found) == periods
    return found.mean(axis=0) - amplitudes(exact, 0.0, TICK, PERIOD, LINES)[0]


@pytest.mark.parametrize("deviation", [2.0, 5.0, 100.0])
def test_the_deviation_is_that_of_repeated_experiments(deviation: float) -> None:
    """Of 60 motions times 20 lines: 1200 squares scatter by 3 %. At 2 counts it is 10 % small."""
    rng = np.random.default_rng(3)
    true, stated = [], []
    for _ in range(60):
        exact = motion(rng, deviation)
        twice = np.tile(exact, 2)
        true.append(np.mean(np.abs(rounding_error(twice, 2, exact)) ** 2))
        stated.append(np.mean(shared_rounding(np.rint(twice), PERIOD, LINES) ** 2))
    assert np.mean(stated) == pytest.approx(np.mean(true), rel=0.15)
    white = 1.0 / (3.0 * PERIOD)  # (2/N)^2 N/12, of errors that no two samples share
    assert (np.mean(true) > 2.0 * white) == (deviation < 10.0)  # slow motion has more at its lines


def test_fast_motion_has_the_white_error_of_the_closed_form() -> None:
    """1/(3 N) counts^2 of a line: 1e5 counts move hundreds of counts a sample."""
    rng = np.random.default_rng(4)
    stated = shared_rounding(np.rint(np.tile(motion(rng, 1e5), 2)), PERIOD, LINES)
    assert np.mean(stated**2) == pytest.approx(1.0 / (3.0 * PERIOD), rel=0.15)


def test_noise_of_one_count_leaves_nothing_that_periods_share() -> None:
    rng = np.random.default_rng(5)
    exact = motion(rng, 20.0)
    noisy = np.tile(exact, 4) + rng.normal(size=4 * PERIOD)
    alone = shared_rounding(np.rint(np.tile(exact, 4)), PERIOD, LINES)
    assert shared_rounding(np.rint(noisy), PERIOD, LINES).max() < 0.2 * alone.min()


def test_a_single_period_and_a_body_at_rest_share_all_of_it() -> None:
    exact = motion(np.random.default_rng(6), 20.0)
    one, two = (shared_rounding(np.rint(np.tile(exact, n)), PERIOD, LINES) for n in (1, 2))
    assert np.allclose(one, two)
    assert shared_rounding(np.full(2 * PERIOD, 7.0), PERIOD, LINES).max() < 1e-15


@pytest.mark.parametrize("realisations", [1, 2])
def test_the_band_has_it_as_a_known_variance(realisations: int) -> None:
    """95 +- 2 % of the lines: errors of velocity that all periods share, no other noise."""
    rng, inside = np.random.default_rng(8), []
    for trial in range(100):
        experiments = []
        for row in range(realisations):
            exact = make_experiment(10 * trial + row)
            deviation = 0.01 * np.abs(exact.channels["velocity"][0])
            error = deviation / np.sqrt(2.0) * (rng.normal(size=(2, deviation.size)).T @ [1, 1j])
            channels = {**exact.channels, "velocity": exact.channels["velocity"] + error}
            experiments.append(exact._replace(channels=channels, rounding=deviation))
        (model,) = models(experiments)
        (known,) = models([each._replace(rounding=None) for each in experiments])
        (perfect,) = models([make_experiment(1)])
        for name in ("Z_i", "Z_d", "Y_i"):
            found, value = model.responses[name], perfect.responses[name].value
            inside += (np.abs(found.value - value) <= found.band).tolist()
            assert not known.responses[name].rounding.any()
    assert 0.93 <= np.mean(inside) <= 0.97, np.mean(inside)


def test_bands_add_random_radii_in_squares_and_distances_in_full() -> None:
    noise, total = np.array([3.0, np.nan]), np.array([np.nan, 6.0])
    assert band_radius(noise, total, np.full(2, 1.0), np.full(2, 4.0)) == pytest.approx([6.0, 7.0])
    parts = {"re": [1.0], "im": [0.0], "noise_band": [3.0], "total_band": [None]}
    stored = _values({**parts, "systematic_band": [1.0], "rounding_band": [4.0]})
    assert stored[1] == pytest.approx([6.0])
    assert _values(parts)[1] == pytest.approx([3.0])  # files before 2027 have neither
