"""Wave calibrations of known seas: coefficients, errors, gaps, weak lines, files and pictures."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from calibration_runs import DT, SEA, BareRow, TimedRow, elevation, plan_of, rows, write

from rig.analysis.report import analyse, write_products
from rig.analysis.summary import as_text
from rig.planning.multisine import design_multisine
from rig.recording.runs import RunError
from rig.spectra.wave_calibration import calibrate_waves, findings
from rig.spectra.wave_lines import (
    Samples,
    estimate_lines,
    line_coefficients,
    mean_period,
    split_periods,
)


def wrapped(phase: Any) -> Any:
    return (phase + np.pi) % (2.0 * np.pi) - np.pi


def samples(step: float, span: float, start: float = 7.31) -> Samples:
    time = start + step * np.arange(round(span / step))
    return Samples(time, elevation(SEA, time))


def check_lines(coefficients: Any, rtol: float = 1e-9) -> None:
    np.testing.assert_allclose(np.abs(coefficients), SEA.amplitude, rtol=rtol)
    np.testing.assert_allclose(wrapped(np.angle(coefficients) - SEA.phase), 0.0, atol=rtol)


def test_even_samples_give_every_line_exactly() -> None:
    pieces = split_periods(samples(0.02, 60.0), 20.0, 7.31)
    assert [len(piece.time) for piece in pieces] == [1000, 1000, 1000]
    estimates = estimate_lines(pieces, 20.0, SEA.cycles)
    check_lines(estimates.mean)
    assert estimates.standard_error.max() < 1e-15


def test_missing_and_uneven_samples_cause_no_leakage() -> None:
    """Least squares is exact with a gap of 1 s and a jitter of a third of a step."""
    complete = samples(0.02, 40.0)
    random = np.random.default_rng(0)
    time = complete.time + 0.007 * random.uniform(-1.0, 1.0, complete.time.size)
    keep = (np.abs(time - 15.0) > 0.5) & (random.uniform(size=time.size) > 0.02)
    pieces = split_periods(Samples(time[keep], elevation(SEA, time[keep])), 20.0, 7.31)
    assert len(pieces) == 2
    check_lines(estimate_lines(pieces, 20.0, SEA.cycles).mean)
    # an FFT that assumes even samples has errors above 5 %
    naive = np.fft.rfft(pieces[0].value)[SEA.cycles] * 2.0 / len(pieces[0].value)
    assert np.abs(np.abs(naive) / SEA.amplitude - 1.0).max() > 0.05


def test_a_sine_with_a_fractional_number_of_samples_per_period() -> None:
    time = 3.0 + 0.02 * np.arange(1000)
    value = 0.1 * np.cos(2.0 * np.pi * 0.3 * time - 0.7) + 0.03
    pieces = split_periods(Samples(time, value), 1.0 / 0.3, 3.0)
    assert len(pieces) == 6
    coefficients = estimate_lines(pieces, 1.0 / 0.3, np.array([1])).mean
    assert np.abs(coefficients[0]) == pytest.approx(0.1, rel=1e-12)
    assert np.angle(coefficients[0]) == pytest.approx(-0.7, rel=1e-12)


def test_a_period_with_too_few_samples_is_left_out() -> None:
    complete = samples(0.02, 60.0)
    hole = (complete.time > 30.0) & (complete.time < 33.0)
    value = np.where(hole, np.nan, complete.value)
    pieces = split_periods(Samples(complete.time, value), 20.0, 7.31)
    assert [round(float(piece.time[0]), 2) for piece in pieces] == [7.31, 47.31]
    most = Samples(complete.time[:905], complete.value[:905])
    assert len(split_periods(most, 20.0, 7.31)) == 1  # 90 % of a period are enough
    assert split_periods(Samples(complete.time[:890], complete.value[:890]), 20.0, 7.31) == []
    assert split_periods(Samples(complete.time, np.full(3000, np.nan)), 20.0, 7.31) == []
    with pytest.raises(ValueError, match="no whole period"):
        estimate_lines([], 20.0, SEA.cycles)
    with pytest.raises(ValueError, match="cannot resolve"):
        line_coefficients(samples(1.0, 20.0), 20.0, SEA.cycles)


def test_the_standard_error_is_that_of_many_repetitions() -> None:
    """White noise of deviation s in n samples gives each part of a line an error of s sqrt(2/n).

    The error is half of it over 4 periods. The mean of the squared errors over lines and 40 trials
    has 10 000 degrees of freedom: 3 %. The actual errors agree with the estimated ones.
    """
    random = np.random.default_rng(1)
    complete = samples(0.02, 80.0)
    estimated, actual = [], []
    for _ in range(40):
        noisy = Samples(complete.time, complete.value + 0.01 * random.standard_normal(4000))
        estimates = estimate_lines(split_periods(noisy, 20.0, 7.31), 20.0, SEA.cycles)
        estimated.append(estimates.standard_error**2)
        actual.append(np.abs(estimates.mean - SEA.amplitude * np.exp(1j * SEA.phase)) ** 2 / 2.0)
    expected = 0.01 * np.sqrt(2.0 / 1000.0) / 2.0
    assert np.sqrt(np.mean(estimated)) == pytest.approx(expected, rel=0.05)
    assert np.sqrt(np.mean(actual)) == pytest.approx(expected, rel=0.08)


def test_the_mean_period_and_its_error() -> None:
    pieces = split_periods(samples(0.02, 80.0, 5.0), 20.0, 5.0)
    mean, error = mean_period(pieces, 20.0, 1000)
    np.testing.assert_allclose(mean, elevation(SEA, 0.02 * np.arange(1000)), atol=1e-12)
    assert error.max() < 1e-14
    mean, error = mean_period(pieces[:1], 20.0, 2000)
    assert np.isnan(mean[1::2]).all()
    assert np.isfinite(mean[::2]).all()
    assert np.isnan(error).all()


@pytest.mark.parametrize("latency", [0.0, 0.001, 0.0137])
def test_probe_samples_are_timed_by_their_age(tmp_path: Path, latency: float) -> None:
    """Amplitude and phase are correct although samples are held for 20 ms and read late."""
    table = calibrate_waves(write(tmp_path / "run", rows(latency=latency)))
    assert table["probe"].values.tolist() == ["probe_1", "probe_2", "probe_3", "elevation"]
    assert table["periods"].values.tolist() == [3, 3, 3, 3]
    for name in ("probe_1", "probe_3", "elevation"):
        one = table.sel(probe=name)
        np.testing.assert_allclose(one["amplitude"], SEA.amplitude, rtol=1e-9)
        np.testing.assert_allclose(wrapped(one["phase"] - SEA.phase), 0.0, atol=1e-9)
        assert float(one["hm0"]) == pytest.approx(0.2, rel=1e-9)
        assert float(one["hm0_total"]) == pytest.approx(0.2, rel=1e-9)
        assert not one["weak"].any()
    half = table.sel(probe="probe_2")
    np.testing.assert_allclose(half["amplitude"], 0.5 * SEA.amplitude, rtol=1e-9)
    turn = 2.0 * np.pi * table["frequency"].values * 0.25
    np.testing.assert_allclose(wrapped(half["phase"] - SEA.phase + turn), 0.0, atol=1e-9)
    time = table["time"].values
    expected = elevation(SEA, time)
    np.testing.assert_allclose(table["mean_period"].sel(probe="probe_1"), expected, atol=1e-9)
    np.testing.assert_allclose(
        table["mean_period"].sel(probe="probe_3"), expected + 0.012, atol=1e-9
    )
    assert table.attrs["hm0_asked_m"] == pytest.approx(0.2, rel=1e-12)
    assert table["amplitude"].attrs["units"] == "m"


def test_weak_lines_of_a_probe_in_a_node_are_reported(tmp_path: Path) -> None:
    """Line 3 vanishes, line 5 has 5 % of its target amplitude."""
    factor = np.ones(SEA.cycles.size)
    factor[3], factor[5] = 0.0, 0.05
    seen = SEA._replace(amplitude=SEA.amplitude * factor)
    table = calibrate_waves(write(tmp_path / "run", rows(seen, noise=1e-4), plan_of()))
    weak = table["weak"].sel(probe="probe_1").values
    assert np.flatnonzero(weak).tolist() == [3, 5]
    frequency = table["frequency"].values
    text = next(text for text in findings(table) if text.startswith("probe_1"))
    assert text.endswith(
        f"2 lines too weak for identification ({frequency[3]:.4g}, {frequency[5]:.4g} Hz)"
    )


def test_noise_appears_in_errors_and_in_the_aperiodic_variance(tmp_path: Path) -> None:
    """With noise of rms 12.5 mm on a sea of rms 50 mm, 1/17 of the variance is not periodic.

    The mean of three periods contains a small part of the noise.
    """
    table = calibrate_waves(write(tmp_path / "run", rows(noise=0.0125, seed=3)))
    one = table.sel(probe="probe_1")
    share = (float(one["hm0"]) / float(one["hm0_total"])) ** 2
    assert share == pytest.approx(16.0 / 17.0, abs=0.01)
    expected = 0.0125 * np.sqrt(2.0 / 1000.0 / 3.0)
    assert np.sqrt(np.mean(one["amplitude_se"] ** 2)) == pytest.approx(expected, rel=0.35)
    # 95 % of normal errors are within 2; 17 lines of 4 degrees of freedom each: within 4
    error = np.abs(one["amplitude"] - SEA.amplitude) / expected
    assert float(error.max()) < 4.0
    assert "± 0." in findings(table)[0]


def test_a_run_that_was_stopped_keeps_its_whole_periods(tmp_path: Path) -> None:
    data = rows()
    cut = data[: round((5.0 + 47.0) / DT)]
    table = calibrate_waves(write(tmp_path / "run", cut))
    assert table["periods"].values.tolist() == [2, 2, 2, 2]
    np.testing.assert_allclose(table["amplitude"][0], SEA.amplitude, rtol=1e-9)
    short = write(tmp_path / "short", data[: round(15.0 / DT)])
    with pytest.raises(RunError, match="no whole repeat period"):
        calibrate_waves(short)
    assert [path.name for path in write_products(short)] == ["summary.txt", "summary.json"]
    assert "no whole repeat period" in as_text(analyse(short).summary)


def test_lost_ticks_cost_no_accuracy(tmp_path: Path) -> None:
    data = rows(latency=0.003)
    keep = np.random.default_rng(2).uniform(size=len(data)) > 0.01
    keep[:2] = True
    table = calibrate_waves(write(tmp_path / "run", data[keep]))
    for name in ("probe_1", "elevation"):
        np.testing.assert_allclose(table["amplitude"].sel(probe=name), SEA.amplitude, rtol=1e-8)


def rows_without(ticks: slice, *, skipped: bool) -> Any:
    """Return a calibration of three periods, 5000 ms to 65 000 ms, without these ticks."""
    data = rows(row_type=TimedRow)
    gone = np.zeros(len(data), bool)
    gone[ticks] = True
    if skipped:  # by the loop, which counts them
        data["timing.skipped"] = np.cumsum(gone)
    return data[~gone]


@pytest.mark.parametrize(
    ("ticks", "withheld"),
    [
        (slice(30_000, 30_100), "repeat period 2 withheld: 100 of 60000"),
        (slice(30_000, 34_000), "repeat period 2 withheld: 4000 of 60000"),  # a fifth of it
        (slice(24_990, 25_010), "repeat periods 1, 2 withheld: 20 of 60000"),
        (slice(64_900, 65_000), "repeat period 3 withheld: 100 of 60000"),
        (slice(4_900, 5_050), "repeat period 3 withheld: 150 of 60100"),  # it ends too early
        (slice(1_000, 1_500), ""),
    ],
)
def test_a_period_with_missing_ticks_is_withheld(
    ticks: slice, withheld: str, tmp_path: Path
) -> None:
    run = write(tmp_path / "run", rows_without(ticks, skipped=False), row_type=TimedRow)
    table = calibrate_waves(run)
    assert table.attrs.get("withheld", "").startswith(withheld)
    left = 3 - withheld.partition(":")[0].count(",") - bool(withheld)
    assert table["periods"].values.tolist() == [left] * 4
    np.testing.assert_allclose(table["amplitude"][0], SEA.amplitude, rtol=1e-9)
    summary = analyse(run).summary
    assert (summary.findings[0].startswith("repeat period")) == bool(withheld)
    assert summary.record is not None
    assert summary.record.state == "incomplete"
    with_incomplete = calibrate_waves(run, incomplete_rows=True)
    assert "withheld" not in with_incomplete.attrs
    there = 2 if ticks.start == 30_000 and ticks.stop == 34_000 else 3
    assert with_incomplete["periods"].values.tolist() == [there] * 4


def test_a_period_in_which_the_loop_skipped_ticks_counts(tmp_path: Path) -> None:
    skipped = rows_without(slice(30_000, 30_100), skipped=True)
    table = calibrate_waves(write(tmp_path / "run", skipped, row_type=TimedRow))
    assert "withheld" not in table.attrs
    assert table["periods"].values.tolist() == [3, 3, 3, 3]


def test_a_calibration_with_missing_ticks_in_every_period(tmp_path: Path) -> None:
    data = rows_without(slice(30_000, 30_010), skipped=False)
    data = data[~np.isin(data["tick"], [10_000, 50_000])]
    run = write(tmp_path / "run", data, row_type=TimedRow)
    with pytest.raises(
        RunError, match=r"no whole .*; repeat periods 1, 2, 3 withheld: 12 of 60000"
    ):
        calibrate_waves(run)


def test_a_single_period_has_no_error(tmp_path: Path) -> None:
    table = calibrate_waves(write(tmp_path / "run", rows(periods=1, noise=1e-3)))
    assert np.isnan(table["amplitude_se"]).all()
    assert np.isnan(table["mean_period_se"]).all()
    assert not table["weak"].any()
    assert "±" not in findings(table)[0]


def test_a_basin_without_probes(tmp_path: Path) -> None:
    data = rows(row_type=BareRow)
    table = calibrate_waves(write(tmp_path / "run", data, row_type=BareRow))
    assert table["probe"].values.tolist() == ["elevation"]
    data["wave.elevation"] = np.nan  # as on a real rig, where it is unknown
    with pytest.raises(RunError, match="no whole repeat period"):
        calibrate_waves(write(tmp_path / "real", data, row_type=BareRow))


def test_another_run_is_no_calibration(tmp_path: Path) -> None:
    run = write(tmp_path / "run", rows(periods=1), plan_of() | {"device": "present"})
    with pytest.raises(RunError, match="no wave calibration"):
        calibrate_waves(run)


def test_the_products_of_a_run(tmp_path: Path) -> None:
    run = write(tmp_path / "run", rows(noise=1e-3))
    estimates = write_products(run)
    assert [path.name for path in estimates] == [
        "wave_calibration.csv",
        "wave_calibration.nc",
        "wave_calibration.png",
        "summary.txt",
        "summary.json",
    ]
    assert all(path.stat().st_size > 500 for path in estimates)
    assert estimates[2].read_bytes().startswith(b"\x89PNG")
    with estimates[0].open() as file:
        header, *lines_read = csv.reader(file)
    assert header[:5] == [
        "cycles",
        "frequency [Hz]",
        "commanded_amplitude [m]",
        "commanded_phase [rad]",
        "probe_1_amplitude [m]",
    ]
    table = calibrate_waves(run)
    column = header.index("probe_2_phase [rad]")
    assert [float(line[column]) for line in lines_read] == table["phase"][1].values.tolist()
    with xarray.open_dataset(estimates[1]) as read:
        assert read.equals(table)
        assert read["frequency"].attrs["units"] == "Hz"
    text = estimates[3].read_text()
    assert "Waves without the device" in text
    heights = r"probe_1: Hm0 (199.9|200.\d) mm ± 0.\d\d by scatter of periods "
    assert re.search(heights + r"\([+-]0.\d % from the target of 200.0 mm\)", text)
    assert "no row was measured" not in text
    assert "rows complete" not in text
    summary = json.loads(estimates[4].read_text())
    assert (summary["rows_done"], summary["alarms"], len(summary["findings"])) == (0, [], 4)


def test_a_long_sea_of_many_lines_is_read_in_seconds(tmp_path: Path) -> None:
    """586 lines of a JONSWAP sea's band over 300 s with gaps use least squares, the slow method."""
    sea = design_multisine(0.05, 2.0, 300.0, rms=0.03, seed=3)
    time = np.delete(0.02 * np.arange(15_000), [100, 7000, 7001])
    coefficients = line_coefficients(Samples(time, elevation(sea, time)), 300.0, sea.cycles)
    np.testing.assert_allclose(np.abs(coefficients), sea.amplitude, rtol=1e-8)
