"""Corrections applied and taken back: exact for decimals, refused where they do not hold."""

from __future__ import annotations

import math
from datetime import date
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import pytest
from calibration_files import CALIBRATIONS, calibration
from hypothesis import assume, given
from hypothesis import strategies as st

from rig.config.calibration_file import OffsetCorrection, ScaleCorrection, TableCorrection
from rig.recording.calibration import (
    At,
    OutsideError,
    apply,
    corrected,
    invert,
    open_history,
    recorded,
)

LOG_RATES = {
    10_000: 7690, 5000: 3845, -6000: -4614, -8000: -6152, -10_000: -7690, -12_000: -9228,
}  # fmt: skip
"""Rates of the MASK4 log before run 51, and what they are by the report's section 4.1."""


def test_the_spring_rates_of_the_mask4_log() -> None:
    known = open_history(CALIBRATIONS).find("mask4_spring_rate@2").file
    for written, true in LOG_RATES.items():
        read = corrected(known, written, At("MASK4", 24))
        assert (read.value, read.given, read.by, read.inside) == (true, written, known.title, True)
        assert recorded(known, true, At("MASK4", 24)).value == written
    for rate in (-6152.0, -9228.0, 0.0):
        read = corrected(known, rate, At("MASK4", 62))
        assert (read.value, read.inside) == (rate, False)
        assert recorded(known, rate, At("MASK4", 62)).value == rate


def test_run_50_is_corrected_and_run_51_is_not() -> None:
    known = open_history(CALIBRATIONS).find("mask4_spring_rate").file
    values = [corrected(known, -10_000.0, At("MASK4", run)).value for run in (0, 50, 51, 52)]
    assert values == [-7690.0, -7690.0, -10_000.0, -10_000.0]
    assert corrected(known, -10_000.0, At("MASK3", 50)).value == -10_000.0


def decimals(digits: int, exponents: tuple[int, int] = (-4, 6)) -> st.SearchStrategy[float]:
    """Numbers as people write them: a few digits and a point somewhere."""
    whole = st.integers(-(10**digits) + 1, 10**digits - 1)
    return st.builds(lambda n, e: float(Decimal(n).scaleb(e)), whole, st.integers(*exponents))


factors = decimals(4, (-4, 2)).filter(lambda f: abs(f) >= 1e-6)
finite = st.floats(-1e12, 1e12).filter(lambda x: x == 0.0 or abs(x) > 1e-12)


@given(decimals(11), factors)
def test_a_scale_of_four_digits_is_taken_back_to_the_last_bit(x: float, factor: float) -> None:
    scale = ScaleCorrection(kind="scale", factor=factor)
    assert invert(scale, apply(scale, x)) == x


@given(decimals(7, (-4, 2)), decimals(7, (-4, 2)))
def test_an_offset_is_taken_back_to_the_last_bit(x: float, offset: float) -> None:
    """Where the sum has no more than the 15 digits that a float holds."""
    assume(abs(offset) <= 1e6)
    shift = OffsetCorrection(kind="offset", offset=offset)
    assert invert(shift, apply(shift, x)) == x


@given(finite, factors)
def test_a_scale_is_the_nearest_float_to_the_exact_product(x: float, factor: float) -> None:
    """Fractions of the decimals know nothing of this arithmetic."""
    scale = ScaleCorrection(kind="scale", factor=factor)
    exact = Fraction(repr(x)) * Fraction(repr(factor))
    assert apply(scale, x) == float(exact)
    # back: half an ulp of the product, half an ulp of the quotient
    assert invert(scale, apply(scale, x)) == pytest.approx(x, rel=4.5e-16, abs=0)


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
        assert apply(table, x) == y
        assert invert(table, y) == x
    x = data.draw(st.floats(xs[0], xs[-1]))
    y = apply(table, x)
    assert min(ys) <= y <= max(ys)
    i = max(i for i in range(size - 1) if xs[i] <= x)
    fraction = (Fraction(repr(x)) - Fraction(repr(xs[i]))) / (
        Fraction(repr(xs[i + 1])) - Fraction(repr(xs[i]))
    )
    between = Fraction(repr(ys[i])) + fraction * (Fraction(repr(ys[i + 1])) - Fraction(repr(ys[i])))
    assert y == float(between)


def test_a_table_ends_where_it_ends() -> None:
    table = TableCorrection(kind="table", recorded=(0.0, 1.0), corrected=(10.0, 5.0))
    assert apply(table, 0.5) == 7.5
    assert invert(table, 7.5) == 0.5
    for action, value in ((apply, -0.1), (apply, 1.1), (invert, 4.9), (invert, 10.1)):
        with pytest.raises(OutsideError, match="outside the table; allowed"):
            action(table, value)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused(value: float) -> None:
    for correction in (
        ScaleCorrection(kind="scale", factor=2.0),
        OffsetCorrection(kind="offset", offset=1.0),
        TableCorrection(kind="table", recorded=(0.0, 1.0), corrected=(0.0, 1.0)),
    ):
        for action in (apply, invert):
            with pytest.raises(ValueError, match="not a finite number"):
                action(correction, value)
    with pytest.raises(ValueError, match="larger than any float"):
        apply(ScaleCorrection(kind="scale", factor=10.0), 1e308)


def test_outside_its_range_a_calibration_refuses_or_leaves_alone(tmp_path: Path) -> None:
    valid = "{dates: {from: 2023-09-15, before: 2023-09-26}}"
    for day, inside in (("14", False), ("15", True), ("25", True), ("26", False)):
        at = At(day=date.fromisoformat(f"2023-09-{day}"))
        lenient = calibration(tmp_path, valid=valid)
        read = corrected(lenient, 8.0, at)
        assert (read.value, read.inside) == ((4.0, True) if inside else (8.0, False))
        strict = calibration(tmp_path, valid=valid, outside="refuse")
        if inside:
            assert corrected(strict, 8.0, at).value == 4.0
            assert recorded(strict, 4.0, at).value == 8.0
        else:
            for action in (corrected, recorded):
                with pytest.raises(OutsideError, match=r"one v1 does not hold for 2023-09-\d\d"):
                    action(strict, 8.0, at)


def test_what_cannot_be_told_is_no_guess(tmp_path: Path) -> None:
    """Also a lenient calibration does not take an unknown run for one outside."""
    runs, dates = calibration(tmp_path), calibration(tmp_path, valid="{dates: {from: 2023-01-01}}")
    for at in (At(), At(day=date(2023, 1, 1)), At(series="T"), At(run=3)):
        with pytest.raises(OutsideError, match="no run number is known"):
            corrected(runs, 1.0, at)
    with pytest.raises(OutsideError, match="of T run 3 no date is known"):
        corrected(dates, 1.0, At("T", 3))


def test_what_was_done_is_said(tmp_path: Path) -> None:
    file = calibration(tmp_path)
    assert corrected(file, 8.0, At("T", 3)).description() == "8 by one v1 is 4"
    outside = corrected(file, 8.0, At("T", 30)).description()
    assert outside == "8: outside the range of one v1, unchanged"
