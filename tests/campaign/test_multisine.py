"""Multisines: lines, rms, phases by seed, and the selection of the draw with the least span."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from rig.planning.multisine import (
    Multisine,
    design_multisine,
    line_range,
    one_period,
    peak,
    scale_to_peak,
)


def rms(signal: Multisine) -> float:
    """Return the rms by Parseval: the root of half the sum of the squared amplitudes."""
    return math.sqrt(0.5 * float(np.sum(signal.amplitude**2)))


def crest_factor(signal: Multisine) -> float:
    """Return peak over rms: 1.41 for one sine, about 3 to 4 for random phases."""
    return peak(signal) / rms(signal)


def cosines(signal: Multisine, time: np.ndarray) -> np.ndarray:
    """Return the sum of the cosines, computed term by term from the definition."""
    angle = 2.0 * np.pi * np.outer(time, signal.cycles) / signal.repeat + signal.phase
    return np.asarray(np.cos(angle) @ signal.amplitude)


def test_the_band_of_the_mask4_report_has_241_lines() -> None:
    assert line_range(0.2, 1.0, 300.0) == range(60, 301)
    assert line_range(0.1 + 0.2, 0.7, 10.0) == range(3, 8)  # ends outside the band only by rounding
    assert line_range(0.05, 2.0, 300.0) == range(15, 601)
    assert line_range(0.001, 0.01, 10.0) == range(1, 1)


@settings(max_examples=examples(60))
@given(
    st.floats(0.05, 1.0), st.floats(0.05, 1.0), st.integers(20, 400), st.floats(0.001, 100.0),
    st.sampled_from([0.0, -0.5, -1.4]), st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_any_design_has_its_band_rms_and_slope(
    low: float, width: float, repeat: int, amplitude_rms: float, exponent: float, seed: int
) -> None:
    signal = design_multisine(
        low, low + width, float(repeat), rms=amplitude_rms, exponent=exponent, seed=seed
    )
    frequency = signal.cycles / signal.repeat
    assert low - 1e-6 <= frequency[0] <= frequency[-1] <= low + width + 1e-6
    assert np.array_equal(np.diff(signal.cycles), np.ones(signal.cycles.size - 1))
    assert rms(signal) == pytest.approx(amplitude_rms, rel=1e-12)
    slope = signal.amplitude * frequency**-exponent
    np.testing.assert_allclose(slope, slope[0], rtol=1e-12)
    assert ((signal.phase >= 0.0) & (signal.phase < 2.0 * np.pi)).all()


def test_the_series_is_the_cosine_sum_and_repeats() -> None:
    signal = design_multisine(0.2, 1.0, 20.0, rms=1.0, exponent=-0.5, seed=4)
    one = one_period(signal, 20_000)
    time = np.arange(20_000) * 0.001
    np.testing.assert_allclose(one, cosines(signal, time), atol=1e-11)
    np.testing.assert_allclose(one, cosines(signal, time + 20.0), atol=1e-11)
    assert float(one.std()) == pytest.approx(1.0, rel=1e-12)
    assert float(abs(one.mean())) < 1e-14


def test_the_draw_with_the_least_peak_to_peak_value_is_kept() -> None:
    """The public fbWecCntrl repository selects in this way: the least max - min at dt = 0.01 s.

    The test sums each draw from its cosines, with phases drawn in the same way.
    """
    low, high, repeat, draws = 0.25, 1.0, 40.0, 25
    signal = design_multisine(low, high, repeat, rms=1.0, seed=11, draws=draws)
    phases = np.random.default_rng([11, 1]).uniform(0.0, 2.0 * np.pi, (draws, signal.cycles.size))
    time = np.arange(0.0, repeat, 0.01)
    spans = [float(np.ptp(cosines(signal._replace(phase=phase), time))) for phase in phases]
    assert np.array_equal(signal.phase, phases[int(np.argmin(spans))])
    assert min(spans) < sorted(spans)[draws // 2]


def test_more_draws_lower_the_crest() -> None:
    """Random phases of 241 lines have a crest factor near sqrt(2 ln(2 n)) = 3.5.

    The best of many draws is lower, and never above that of fewer draws of the same seed.
    """
    crest_factors = [
        crest_factor(design_multisine(0.2, 1.0, 300.0, rms=1.0, seed=2, draws=draws))
        for draws in (1, 10, 100)
    ]
    assert 3.0 < crest_factors[0] < 4.5
    assert crest_factors[2] < 3.2
    assert (
        crest_factors[2] <= crest_factors[1] + 0.15
    )  # selected by peak to peak, which is nearly twice the peak


def test_a_peak_between_the_samples_of_a_coarse_series_is_found() -> None:
    signal = design_multisine(0.5, 0.5, 10.0, rms=1.0, seed=0)
    assert crest_factor(signal) == pytest.approx(math.sqrt(2.0), rel=5e-3)
    signal = scale_to_peak(design_multisine(0.2, 1.0, 300.0, rms=1.0, seed=5, draws=20), 769.8)
    fine = one_period(signal, 300_000)  # 1 ms
    assert peak(signal) == pytest.approx(769.8, rel=1e-12)
    assert float(np.abs(fine).max()) == pytest.approx(769.8, rel=5e-3)


def test_realisations_and_seeds_are_independent() -> None:
    """Random signals of n lines correlate with a standard deviation of 1/sqrt(2 n) = 0.046.

    None of 15 pairs exceeds four times that value, and their root mean square is within a factor
    of three of it.
    """
    signals = [
        one_period(
            design_multisine(0.2, 1.0, 300.0, rms=1.0, exponent=-0.5, seed=seed, realisation=i),
            6000,
        )
        for seed in (1, 2)
        for i in (1, 2, 3)
    ]
    rho = np.corrcoef(signals)[np.triu_indices(6, 1)]
    expected = 1.0 / math.sqrt(2.0 * 241.0)
    assert np.abs(rho).max() < 4.0 * expected
    assert expected / 3.0 < math.sqrt(float(np.mean(rho**2))) < 3.0 * expected


SCRIPT = """
import hashlib
from rig.planning.multisine import design_multisine, one_period
for seed, realisation, draws in ((1, 1, 1), (1, 2, 1), (7, 3, 50)):
    signal = design_multisine(0.2, 1.0, 300.0, rms=0.0635, exponent=-0.5, seed=seed,
                              realisation=realisation, draws=draws)
    digest = hashlib.sha256(signal.amplitude.tobytes() + signal.phase.tobytes())
    digest.update(one_period(signal, 300_000).tobytes())
    print(digest.hexdigest())
"""


def test_other_processes_compute_the_same_bits() -> None:
    digests = [
        subprocess.run(
            [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True
        ).stdout.split()
        for _ in range(2)
    ]
    assert digests[0] == digests[1]
    assert len(set(digests[0])) == 3
    here = design_multisine(0.2, 1.0, 300.0, rms=0.0635, exponent=-0.5, seed=1)
    digest = hashlib.sha256(here.amplitude.tobytes() + here.phase.tobytes())
    digest.update(one_period(here, 300_000).tobytes())
    assert digest.hexdigest() == digests[0][0]


def test_invalid_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="no multiple of 1/10 Hz"):
        design_multisine(0.21, 0.29, 10.0, rms=1.0, seed=0)
    for bad in (-1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="rms"):
            design_multisine(0.2, 1.0, 10.0, rms=bad, seed=0)
    for draws in (0, 1001):
        with pytest.raises(ValueError, match=r"draws must be 1 \.\. 1000"):
            design_multisine(0.2, 1.0, 10.0, rms=1.0, seed=0, draws=draws)
    with pytest.raises(ValueError, match="cannot show 300 periods"):
        one_period(design_multisine(0.2, 1.0, 300.0, rms=1.0, seed=0), 600)
