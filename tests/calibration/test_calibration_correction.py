"""Corrections and their inverses: exact for decimals, refused outside their validity."""

from __future__ import annotations

import math
from datetime import date
from decimal import Decimal
from fractions import Fraction
from functools import partial
from pathlib import Path

import pytest
from calibration_files import CALIBRATIONS, calibration
from hypothesis import assume, given
from hypothesis import strategies as st

from rig.config.calibration_file import OffsetCorrection, ScaleCorrection, TableCorrection
from rig.recording.calibration import (
    RecordingTime,
    ValidityError,
    apply_calibration,
    apply_correction,
    open_history,
)

invert_correction = partial(apply_correction, invert=True)
invert_calibration = partial(apply_calibration, invert=True)

LOG_RATES = {
    10_000: 7690, 5000: 3845, -6000: -4614, -8000: -6152, -10_000: -7690, -12_000: -9228,
}  # fmt: skip
"""Rates of the MASK4 log before run 51, and their values by section 4.1 of the report."""


def test_the_spring_rates_of_the_mask4_log() -> None:
    known = open_history(CALIBRATIONS).find("mask4_spring_rate@2").file
    for written, true in LOG_RATES.items():
        read = apply_calibration(known, written, RecordingTime("MASK4", 24))
        assert (read.value, read.given, read.by, read.inside) == (true, written, known.title, True)
        assert invert_calibration(known, true, RecordingTime("MASK4", 24)).value == written
    for rate in (-6152.0, -9228.0, 0.0):
        read = apply_calibration(known, rate, RecordingTime("MASK4", 62))
        assert (read.value, read.inside) == (rate, False)
        assert invert_calibration(known, rate, RecordingTime("MASK4", 62)).value == rate


def test_run_50_is_corrected_and_run_51_is_not() -> None:
    known = open_history(CALIBRATIONS).find("mask4_spring_rate").file
    values = [
        apply_calibration(known, -10_000.0, RecordingTime("MASK4", run)).value
        for run in (0, 50, 51, 52)
    ]
    assert values == [-7690.0, -7690.0, -10_000.0, -10_000.0]
    assert apply_calibration(known, -10_000.0, RecordingTime("MASK3", 50)).value == -10_000.0


def decimals(digits: int, exponents: tuple[int, int] = (-4, 6)) -> st.SearchStrategy[float]:
    """Return a strategy for numbers as people write them: a few digits and a decimal point."""
    whole = st.integers(-(10**digits) + 1, 10**digits - 1)
    return st.builds(lambda n, e: float(Decimal(n).scaleb(e)), whole, st.integers(*exponents))


factors = decimals(4, (-4, 2)).filter(lambda f: abs(f) >= 1e-6)
finite = st.floats(-1e12, 1e12).filter(lambda x: x == 0.0 or abs(x) > 1e-12)


@given(decimals(11), factors)
def test_a_scale_of_four_digits_is_inverted_exactly(x: float, factor: float) -> None:
    scale = ScaleCorrection(kind="scale", factor=factor)
    assert invert_correction(scale, apply_correction(scale, x)) == x


@given(decimals(7, (-4, 2)), decimals(7, (-4, 2)))
def test_an_offset_is_inverted_exactly(x: float, offset: float) -> None:
    """For sums within the 15 digits of a float."""
    assume(abs(offset) <= 1e6)
    shift = OffsetCorrection(kind="offset", offset=offset)
    assert invert_correction(shift, apply_correction(shift, x)) == x


@given(finite, factors)
def test_a_scale_is_the_nearest_float_to_the_exact_product(x: float, factor: float) -> None:
    """Fractions are independent of the decimal arithmetic."""
    scale = ScaleCorrection(kind="scale", factor=factor)
    exact = Fraction(repr(x)) * Fraction(repr(factor))
    assert apply_correction(scale, x) == float(exact)
    # inverse: half an ulp of the product plus half an ulp of the quotient
    assert invert_correction(scale, apply_correction(scale, x)) == pytest.approx(
        x, rel=4.5e-16, abs=0
    )


knots = st.lists(decimals(6), min_size=2, max_size=8, unique=True).map(sorted)


@given(knots, st.data())
def test_a_table_is_exact_at_its_pairs_and_monotone_between(
    xs: list[float], data: st.DataObject
) -> None:
    size = len(xs)
    ys = data.draw(st.lists(decimals(6), min_size=size, max_size=size, unique=True).map(sorted))
    if data.draw(st.booleans()):
        ys = ys[::-1]
    table = TableCorrection(kind="table", recorded=tuple(xs), corrected=tuple(ys))
    for x, y in zip(xs, ys, strict=True):
        assert apply_correction(table, x) == y
        assert invert_correction(table, y) == x
    x = data.draw(st.floats(xs[0], xs[-1]))
    y = apply_correction(table, x)
    assert min(ys) <= y <= max(ys)
    i = max(i for i in range(size - 1) if xs[i] <= x)
    fraction = (Fraction(repr(x)) - Fraction(repr(xs[i]))) / (
        Fraction(repr(xs[i + 1])) - Fraction(repr(xs[i]))
    )
    between = Fraction(repr(ys[i])) + fraction * (Fraction(repr(ys[i + 1])) - Fraction(repr(ys[i])))
    assert y == float(between)


def test_a_table_is_not_extrapolated() -> None:
    table = TableCorrection(kind="table", recorded=(0.0, 1.0), corrected=(10.0, 5.0))
    assert apply_correction(table, 0.5) == 7.5
    assert invert_correction(table, 7.5) == 0.5
    for action, value in (
        (apply_correction, -0.1),
        (apply_correction, 1.1),
        (invert_correction, 4.9),
        (invert_correction, 10.1),
    ):
        with pytest.raises(ValidityError, match="outside the table; allowed"):
            action(table, value)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_values_that_are_not_finite_are_refused(value: float) -> None:
    for correction in (
        ScaleCorrection(kind="scale", factor=2.0),
        OffsetCorrection(kind="offset", offset=1.0),
        TableCorrection(kind="table", recorded=(0.0, 1.0), corrected=(0.0, 1.0)),
    ):
        for action in (apply_correction, invert_correction):
            with pytest.raises(ValueError, match="not a finite number"):
                action(correction, value)
    with pytest.raises(ValueError, match="larger than any float"):
        apply_correction(ScaleCorrection(kind="scale", factor=10.0), 1e308)


def test_outside_its_range_a_calibration_follows_its_rule(tmp_path: Path) -> None:
    valid = "{dates: {from: 2023-09-15, before: 2023-09-26}}"
    for day, inside in (("14", False), ("15", True), ("25", True), ("26", False)):
        at = RecordingTime(day=date.fromisoformat(f"2023-09-{day}"))
        lenient = calibration(tmp_path, valid=valid)
        read = apply_calibration(lenient, 8.0, at)
        assert (read.value, read.inside) == ((4.0, True) if inside else (8.0, False))
        strict = calibration(tmp_path, valid=valid, outside="refuse")
        if inside:
            assert apply_calibration(strict, 8.0, at).value == 4.0
            assert invert_calibration(strict, 4.0, at).value == 8.0
        else:
            for action in (apply_calibration, invert_calibration):
                with pytest.raises(ValidityError, match=r"one v1 does not hold for 2023-09-\d\d"):
                    action(strict, 8.0, at)


def test_an_unknown_validity_is_an_error(tmp_path: Path) -> None:
    """A calibration with `outside: unchanged` does not treat an unknown run as outside either."""
    runs, dates = calibration(tmp_path), calibration(tmp_path, valid="{dates: {from: 2023-01-01}}")
    for at in (
        RecordingTime(),
        RecordingTime(day=date(2023, 1, 1)),
        RecordingTime(series="T"),
        RecordingTime(run=3),
    ):
        with pytest.raises(ValidityError, match="no run number is known"):
            apply_calibration(runs, 1.0, at)
    with pytest.raises(ValidityError, match="of T run 3 no date is known"):
        apply_calibration(dates, 1.0, RecordingTime("T", 3))


def test_the_computation_is_described(tmp_path: Path) -> None:
    file = calibration(tmp_path)
    assert apply_calibration(file, 8.0, RecordingTime("T", 3)).description() == "8 by one v1 is 4"
    outside = apply_calibration(file, 8.0, RecordingTime("T", 30)).description()
    assert outside == "8: outside the range of one v1, unchanged"
