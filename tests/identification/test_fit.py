"""Parametric models of known and measured impedances, and their passivity."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_device import impedances
from measured_data import reference

from rig.identification.fit import FittedImpedance, Section, fit, impedance, zero_crossing

MASK4 = "mask4_impedance_20A_m9228_0p2_1Hz.csv"
GRID = np.arange(60, 301) / 300.0


def poles(model: FittedImpedance) -> np.ndarray:
    """Return the poles of the admittance Y = 1/Z, 1/s."""
    # Z s prod(den) = (M s^2 + B s + K) prod(den) + s sum (c s + d) prod(other den)
    denominators = [np.array([1.0, a, b]) for a, b, _, _ in model.sections]
    numerator = np.array([model.mass, model.damping, model.stiffness])
    for denominator in denominators:
        numerator = np.polymul(numerator, denominator)
    for i, (_, _, c, d) in enumerate(model.sections):
        product = np.array([c, d, 0.0])
        for j, denominator in enumerate(denominators):
            product = np.polymul(product, denominator) if j != i else product
        numerator = np.polyadd(numerator, product)
    return np.asarray(np.roots(numerator), dtype=np.complex128)


@pytest.mark.parametrize(
    ("column", "frequency", "damping"), [(1, 0.642, 1950.0), (3, 0.553, 2620.0)]
)
def test_the_measured_impedances_of_mask4(column: int, frequency: float, damping: float) -> None:
    """Zikn12 and Zidkn12, 20 A, -9228 N/m: natural frequency within 0.5 %, damping within 1 %.

    The numbers are those of an independent fit to the same admittances (M, B, K by least squares).
    """
    data = np.loadtxt(reference(MASK4), delimiter=",")
    model = fit(data[:, 0], data[:, column] + 1j * data[:, column + 1])
    assert model.natural_frequency == pytest.approx(frequency, rel=0.005)
    assert model.damping == pytest.approx(damping, rel=0.01)
    assert model.fit_percent > 80.0
    assert poles(model).real.max() < 0.0


def test_the_difference_of_the_measured_impedances_is_the_drivetrain() -> None:
    """Z_d = Z_id - Z_i: damping 724 N s/m, stiffness -5.9 kN/m; the quotient is no impedance."""
    data = np.loadtxt(reference(MASK4), delimiter=",")
    drivetrain = data[:, 3] - data[:, 1] + 1j * (data[:, 4] - data[:, 2])
    omega = 2 * np.pi * data[:, 0]
    assert np.median(drivetrain.real) == pytest.approx(724.0, rel=0.01)
    stiffness = np.linalg.lstsq(1.0 / omega[:, None], -drivetrain.imag, rcond=None)[0][0]
    assert stiffness == pytest.approx(-5905.0, rel=0.03)


def test_a_second_order_device_is_recovered() -> None:
    s = 2j * np.pi * GRID
    model = fit(GRID, 1400.0 * s + 1900.0 + 23000.0 / s)
    assert (model.mass, model.damping, model.stiffness) == pytest.approx((1400.0, 1900.0, 23000.0))
    assert model.fit_percent == pytest.approx(100.0, abs=1e-6)
    assert model.natural_frequency == pytest.approx(np.sqrt(23000.0 / 1400.0) / (2 * np.pi))


@pytest.mark.parametrize(("order", "least"), [(2, 88.0), (4, 99.0), (6, 99.5)])
def test_radiation_needs_a_higher_order(order: int, least: float) -> None:
    """The linear plant's Z_i: every section improves the fit, and the model stays passive."""
    z, _ = impedances(GRID, 0.0)
    model = fit(GRID, z, order)
    assert model.order == order
    assert model.fit_percent > least
    wide = np.geomspace(1e-3, 1e3, 2001)
    assert impedance(model, wide).real.min() >= 0.0
    assert poles(model).real.max() < 0.0
    assert zero_crossing(GRID, z) == pytest.approx(model.natural_frequency, rel=0.01)


Share = st.floats(1e-3, 0.999)


Sections = st.lists(
    st.tuples(st.floats(0.05, 30), st.floats(0.05, 200), st.floats(1, 1e5), Share), max_size=3
)


@given(Sections, st.floats(0, 1e4))
def test_every_model_is_passive_and_stable(
    sections: list[tuple[float, float, float, float]], damping: float
) -> None:
    model_sections = tuple(Section(a, b, c, share * a * c) for a, b, c, share in sections)
    model = FittedImpedance(1500.0, damping, 20000.0, model_sections, np.nan, np.nan)
    frequency = np.geomspace(1e-3, 1e3, 400)
    z = impedance(model, frequency)
    assert z.real.min() >= -1e-9 * np.abs(z).max()
    model_poles = poles(model)
    assert len(model_poles) == 2 + 2 * len(model_sections)
    assert model_poles.real.max() <= 1e-6
    # Poles are the zeros of Z: M prod(s - pole) = s Z prod(s^2 + a s + b).
    s = 2j * np.pi * frequency
    scaled = s * z
    for a, b, _, _ in model_sections:
        scaled = scaled * (s * s + a * s + b)
    product = 1500.0 * np.prod(s[:, None] - model_poles[None, :], axis=1)
    scale = 1500.0 * np.prod(np.abs(s[:, None]) + np.abs(model_poles)[None, :], axis=1)
    assert np.abs(product - scaled).max() <= 1e-6 * scale.max()
    assert (np.abs(product - scaled) <= 1e-5 * scale).all()


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 10**6))
def test_a_fit_to_active_data_is_passive(seed: int) -> None:
    """Negative real parts, as noise causes at the ends of a band."""
    rng = np.random.default_rng(seed)
    s = 2j * np.pi * GRID[::8]
    z = 1400.0 * s + 200.0 + 23000.0 / s + rng.normal(size=s.size) * 800.0
    model = fit(GRID[::8], z, 4)
    assert impedance(model, np.geomspace(1e-3, 1e3, 300)).real.min() >= 0.0


def test_invalid_orders_and_too_few_lines_are_refused() -> None:
    z, _ = impedances(GRID, 0.0)
    with pytest.raises(ValueError, match="order 3: allowed 2, 4, 6, 8"):
        fit(GRID, z, 3)
    with pytest.raises(ValueError, match="too few for a model"):
        fit(GRID[:3], z[:3], 4)
    assert np.isnan(zero_crossing(GRID[:5], z[:5]))
