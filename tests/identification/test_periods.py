"""Lines of repeat periods: exact for periodic signals, at any start of the window."""

from __future__ import annotations

import numpy as np
import pytest

from rig.spectra.periods import (
    amplitudes,
    common_period_ticks,
    excited_lines,
    fill_lost_ticks,
)

DT = 0.001


@pytest.mark.parametrize("start", [0.0, 3.217, 41.0])
def test_lines_have_their_phase_on_the_wave_clock(start: float) -> None:
    """Two whole periods and a remainder: amplitude and phase of each line to rounding."""
    t = start + DT * np.arange(4700)
    wave = 3.0 * np.cos(2 * np.pi * 1.5 * t + 0.7) + 0.2 * np.cos(2 * np.pi * 4.0 * t - 2.0) + 9.0
    lines = amplitudes(wave, start, DT, 2000, 10)
    assert lines.shape == (2, 10)
    expected = np.zeros(10, complex)
    expected[2], expected[7] = 3.0 * np.exp(0.7j), 0.2 * np.exp(-2.0j)
    assert np.abs(lines - expected).max() < 1e-9


def test_few_lost_ticks_are_interpolated_and_many_refused() -> None:
    ticks = np.delete(np.arange(1000), [17, 500, 501])
    values = np.sin(2 * np.pi * ticks / 1000.0)
    filled = fill_lost_ticks(ticks, values)
    assert len(filled) == 1000
    assert np.abs(filled - np.sin(2 * np.pi * np.arange(1000) / 1000.0)).max() < 1e-4
    with pytest.raises(ValueError, match="ticks are missing"):
        fill_lost_ticks(np.arange(0, 1000, 2), values[:500])
    with pytest.raises(ValueError, match="not finite"):
        fill_lost_ticks(np.arange(3), np.array([0.0, np.nan, 1.0]))


@pytest.mark.parametrize(
    ("periods", "ticks"),
    [([20.0], 20_000), ([1.0 / 0.3], 10_000), ([20.0, 12.0], 60_000), ([0.5, 300.0], 300_000)],
)
def test_a_common_period_is_a_whole_number_of_ticks(periods: list[float], ticks: int) -> None:
    assert common_period_ticks(periods, DT, 600_000) == ticks


@pytest.mark.parametrize(
    ("periods", "message"),
    [([20.0], "shorter than"), ([2.0**0.5], "on no tick"), ([7.0, 9.0], "no common")],
)
def test_a_window_without_a_common_period_is_refused(periods: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        common_period_ticks(periods, DT, 15_000)


def test_excited_lines_of_a_reference() -> None:
    assert excited_lines(np.array([0.0, 1.0, 0.45j, 0.01, -0.2])).tolist() == [
        False, True, True, False, True,
    ]  # fmt: skip
