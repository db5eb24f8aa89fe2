"""Radiation fit and impedance: against BEM, passivity, and the measured MASK4 impedance."""

from __future__ import annotations

import numpy as np
import pytest
from closed_form import intrinsic_impedance, radiation
from measured_data import reference
from plant_files import PLANTS, bem, plant

from sim_plant.bem import excitation_at, radiation_impedance, read_bem


def zero_crossing(f: np.ndarray, reactance: np.ndarray) -> float:
    """Return the last upward crossing, interpolated."""
    i = np.flatnonzero((reactance[:-1] < 0) & (reactance[1:] >= 0))[-1]
    return float(f[i] - reactance[i] * (f[i + 1] - f[i]) / (reactance[i + 1] - reactance[i]))


def test_five_states_follow_the_bem() -> None:
    hull = bem()
    inside = (hull.frequency >= 0.2) & (hull.frequency <= 1.0)
    table = radiation_impedance(hull)[inside]
    fit = radiation(plant().build(), hull.frequency[inside])
    assert np.max(np.abs(fit - table) / np.abs(table)) <= 0.005


def test_radiation_gives_no_energy() -> None:
    params = plant().build()
    body = params.body
    k = radiation(params, np.logspace(-3, 5, 20001) / (2 * np.pi)).real
    assert k.min() >= -1e-6 * k.max()
    assert body.a4 * body.b4 >= body.b3


def test_added_mass_is_the_infinite_one() -> None:
    assert plant().body.added_mass_infinite.value == pytest.approx(
        bem().added_mass_infinite, abs=0.01
    )


def test_npz_and_netcdf_are_the_same_hull() -> None:
    pytest.importorskip("h5py", reason="h5netcdf reads nothing without an HDF5 backend")
    npz, netcdf = read_bem(PLANTS / "wavebot_bem.npz"), read_bem(PLANTS / "wavebot_bem.nc")
    for a, b in zip(npz, netcdf, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


def test_invalid_bem_file_is_refused(tmp_path) -> None:
    np.savez(tmp_path / "empty.npz", f_hz=np.zeros(3))
    with pytest.raises(ValueError, match="no field"):
        read_bem(tmp_path / "empty.npz")
    with pytest.raises(ValueError, match=r"\.npz or \.nc"):
        read_bem(tmp_path / "hull.csv")


def test_excitation_lags_in_the_capytaine_convention() -> None:
    """-60.7 degrees at 0.65 Hz (WAMIT: +60.2), and linear interpolation is good to 0.2 %."""
    hull = bem()
    value = excitation_at(hull, np.array([0.65]))[0]
    assert np.degrees(np.angle(value)) == pytest.approx(-60.7, abs=0.2)
    assert abs(value) == pytest.approx(6425.0, rel=0.002)
    # Error of linear interpolation is h²/8 of the second derivative: take every other point.
    coarse = hull._replace(frequency=hull.frequency[::2], excitation=hull.excitation[::2])
    inside = (hull.frequency > 0.2) & (hull.frequency < 1.0)
    error = excitation_at(coarse, hull.frequency) / hull.excitation - 1
    assert np.max(np.abs(error[inside])) / 4 <= 0.002
    assert excitation_at(hull, np.array([2.5]))[0] == 0


def test_impedance_is_the_measured_one() -> None:
    """Stated plant against the MASK4 20 A identification, 0.3-0.8 Hz."""
    data = np.loadtxt(reference("mask4_impedance_20A_m9228_0p2_1Hz.csv"), delimiter=",")
    data = data[(data[:, 0] >= 0.3) & (data[:, 0] <= 0.8)]
    f, measured = data[:, 0], data[:, 1] + 1j * data[:, 2]
    model = intrinsic_impedance(plant("wavebot_linear").build(), f)
    error = np.abs(model - measured) / np.abs(measured)
    assert error.mean() <= 0.12
    assert error.max() <= 0.30
    assert zero_crossing(f, model.imag) == pytest.approx(0.642, rel=0.03)


@pytest.mark.parametrize(("rate", "expected"), [(0.0, 0.631), (-5905.0, 0.534)])
def test_natural_frequency(rate: float, expected: float) -> None:
    f = np.linspace(0.3, 0.9, 6001)
    reactance = intrinsic_impedance(plant("wavebot_linear").build(), f) + rate / (2j * np.pi * f)
    assert zero_crossing(f, reactance.imag) == pytest.approx(expected, abs=0.001)


@pytest.mark.parametrize(("rate", "printed"), [(0.0, 0.65), (8340.0, 0.73), (-10013.0, 0.48)])
def test_equation_3_1_with_its_own_mass(rate: float, printed: float) -> None:
    """MASK4 report eq. 3.1 with the script's A = 646.17 kg: no mass is better than 0.011 Hz."""
    natural = np.sqrt((plant().body.hydrostatic.value + rate) / (860.0 + 646.17)) / (2 * np.pi)
    assert natural == pytest.approx(printed, abs=0.012)
