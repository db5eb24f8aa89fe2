"""Wave calibration of measured data: the record of the pink wave in the empty basin."""

from __future__ import annotations

import numpy as np
import pytest
from measured_data import reference

from rig.planning.multisine import line_range as band
from rig.spectra.wave_lines import Samples, estimate_lines, significant_height, split_periods

REPEAT = 300.0
CYCLES = np.array(band(0.2, 1.0, REPEAT))


@pytest.fixture(scope="module")
def probes() -> list[Samples]:
    """Five probes, 120 to 1320 s: four repeat periods at 20 Hz, in m."""
    text = reference("AWDC-SAADAQ-s00113.twe").read_text(encoding="latin-1").splitlines()
    first = next(i for i, line in enumerate(text) if line.startswith("DATA:"))
    cells = (line.split("\t") for line in text[first:] if line.strip())
    rows = np.array([[float(cell) for cell in row[2:8]] for row in cells])
    inside = (rows[:, 0] >= 119.99) & (rows[:, 0] < 1319.99)
    return [Samples(rows[inside, 0], 0.0254 * rows[inside, i]) for i in range(1, 6)]


def test_the_record_repeats_on_the_lines_of_the_report(probes: list[Samples]) -> None:
    """The lines are multiples of 1/300 Hz from 0.2 to 1 Hz (MASK4 report (Sandia), section 3.2.2).

    These 241 lines contain 97 to 98.5 % of the variance of every probe, out of 5999 possible lines.
    Hm0 is 0.253 m within 1 %.
    """
    for probe in probes:
        pieces = split_periods(probe, REPEAT, probe.time[0])
        assert [len(piece.time) for piece in pieces] == [6000] * 4
        total = 4.0 * float(np.std(probe.value))
        assert total == pytest.approx(0.2528, rel=0.005)
        estimates = estimate_lines(pieces, REPEAT, CYCLES)
        share = (significant_height(estimates.mean) / total) ** 2
        assert 0.96 < share < 0.99
        outside = estimate_lines(pieces, REPEAT, np.arange(301, 1200))
        assert (significant_height(outside.mean) / total) ** 2 < 0.01


def test_the_wave_falls_off_more_steeply_than_the_ideal_pink_one(probes: list[Samples]) -> None:
    """The target is f^-0.5, the measured spectrum f^-1.3 to f^-1.5: hence the key `exponent`."""
    for probe in probes:
        estimates = estimate_lines(split_periods(probe, REPEAT, probe.time[0]), REPEAT, CYCLES)
        slope, _ = np.polyfit(np.log(CYCLES / REPEAT), np.log(np.abs(estimates.mean)), 1)
        assert -1.55 < slope < -1.2


def test_every_probe_of_the_record_has_weak_lines(probes: list[Samples]) -> None:
    """Between 10 and 30 of the 241 lines of each probe are below five standard errors.

    The frequencies differ from probe to probe. The report changed the probe for this reason: one
    was nearly zero at several frequencies.
    """
    weak = []
    for probe in probes:
        estimates = estimate_lines(split_periods(probe, REPEAT, probe.time[0]), REPEAT, CYCLES)
        assert 0.01 < float(np.median(estimates.standard_error / np.abs(estimates.mean))) < 0.06
        weak.append(
            set(np.flatnonzero(np.abs(estimates.mean) < 5.0 * estimates.standard_error).tolist())
        )
    assert all(10 <= len(found) <= 30 for found in weak), [len(found) for found in weak]
    assert len(set.intersection(*weak)) < min(map(len, weak))
