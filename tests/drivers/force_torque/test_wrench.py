"""Counts to newtons: closed form, a full 6x6 for cross-talk, units by their definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import CodecError
from drivers.force_torque.wrench import (
    NET_FT_FORCE_UNITS,
    NET_FT_TORQUE_UNITS,
    NEWTON_METRES,
    NEWTONS,
    Matrix,
    Scale,
    Vector6,
    Wrench,
    apply_calibration,
    make_scale,
    to_si,
)

cell = st.floats(-1e6, 1e6)
sixes = st.tuples(cell, cell, cell, cell, cell, cell)
matrices = st.tuples(sixes, sixes, sixes, sixes, sixes, sixes)
UNIT: Matrix = (
    (1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0, 1.0, 0.0, 0.0),
    (0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
)
ZERO: Vector6 = (0.0,) * 6


@given(matrices, sixes, sixes)
def test_a_full_matrix_is_a_product(matrix: Matrix, gauges: Vector6, bias: Vector6) -> None:
    expected = np.array(matrix) @ (np.array(gauges) - np.array(bias))
    assert np.allclose(apply_calibration(matrix, gauges, bias), expected, rtol=1e-9, atol=1e-3)


@given(sixes)
def test_a_tared_load_reads_zero(gauges: Vector6) -> None:
    assert apply_calibration(UNIT, gauges, gauges) == ZERO
    assert apply_calibration(UNIT, gauges, ZERO) == gauges


def test_counts_become_newtons_and_newton_metres() -> None:
    scaling = make_scale(1_000_000.0, 1_000_000.0, "N", "N-m")
    counts = (1_500_000.0, -2_000_000.0, 0.0, 250_000.0, -1.0, 3_000_000.0)
    assert to_si(scaling, counts) == pytest.approx(Wrench(1.5, -2.0, 0.0, 0.25, -1e-6, 3.0))


def test_units_are_what_their_definitions_say() -> None:
    pound, foot, gravity = 0.45359237, 0.3048, 9.80665
    assert NEWTONS["lbf"] == pytest.approx(pound * gravity, rel=1e-15)
    assert NEWTONS["klbf"] == pytest.approx(1000.0 * pound * gravity, rel=1e-15)
    assert NEWTONS["gf"] == pytest.approx(gravity / 1000.0, rel=1e-15)
    assert NEWTON_METRES["lbf-ft"] == pytest.approx(pound * gravity * foot, rel=1e-15)
    assert NEWTON_METRES["lbf-in"] == pytest.approx(pound * gravity * foot / 12.0, rel=1e-15)
    assert NEWTON_METRES["kgf-cm"] == pytest.approx(gravity / 100.0, rel=1e-15)
    assert make_scale(10.0, 5.0, "kN", "N-mm") == Scale(100.0, 0.0002)


def test_the_boxs_codes_count_from_one() -> None:
    assert NET_FT_FORCE_UNITS[2 - 1] == "N"
    assert NET_FT_TORQUE_UNITS[3 - 1] == "N-m"
    assert set(NET_FT_FORCE_UNITS) == set(NEWTONS)
    assert set(NET_FT_TORQUE_UNITS) == set(NEWTON_METRES)


@pytest.mark.parametrize(
    ("force", "torque", "units", "where"),
    [
        (0.0, 1.0, ("N", "N-m"), "counts per force"),
        (1.0, -1.0, ("N", "N-m"), "counts per torque"),
        (math.nan, 1.0, ("N", "N-m"), "counts per force"),
        (1.0, math.inf, ("N", "N-m"), "counts per torque"),
        (1.0, 1.0, ("newton", "N-m"), "force unit"),
        (1.0, 1.0, ("N", "Nm"), "torque unit"),
    ],
)
def test_invalid_scales_are_refused(
    force: float, torque: float, units: tuple[str, str], where: str
) -> None:
    with pytest.raises(CodecError, match=where):
        make_scale(force, torque, *units)
