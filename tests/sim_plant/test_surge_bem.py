"""Surge coefficients: WAMIT, Haskind, the decided first values, the fit; heave recomputed."""

from __future__ import annotations

import numpy as np
import pytest
from plant_files import CAPYTAINE, bem, plant, surge_bem

from sim_plant.bem import Bem, radiation_impedance

# WAMIT 7.2 of WEC-Sim_Applications (Load_Mitigating_Controls, waveBotBuoy.out), 6.1 m of water,
# 0.8584 m3: period (s), A11, B11, |X1|, non-dimensional with 1 m and unit density.
WAMIT = np.array(
    [
        [3.342120, 3.536302e-01, 1.282294e-02, 3.869806e-01],
        [2.001014, 3.968141e-01, 1.480303e-01, 7.674615e-01],
        [1.539997, 2.881472e-01, 2.442800e-01, 7.586955e-01],
        [1.000507, 1.065891e-01, 1.606088e-01, 3.996945e-01],
    ]
)
# First values on the way to this file: Hz, kg, N s/m, N/m
FIRST = np.array(
    [
        [0.30, 379, 27, 3865],
        [0.40, 422, 163, 6166],
        [0.50, 424, 512, 7821],
        [0.60, 351, 933, 8033],
        [0.65, 302, 1082, 7676],
        [0.80, 180, 1220, 5971],
        [1.00, 111, 1030, 3937],
    ]
)


def at(hull: Bem, f: np.ndarray) -> np.ndarray:
    """Added mass, damping and |Fe| at frequencies (Hz).

    Logarithms are interpolated: damping rises with the seventh power of frequency at 0.3 Hz, where
    a straight line between the file's frequencies is 5 % too high.
    """
    rows = (hull.added_mass, hull.damping, np.abs(hull.excitation))
    known = np.log(hull.frequency)
    return np.array([np.exp(np.interp(np.log(f), known, np.log(row))) for row in rows])


def test_surge_is_that_of_another_code() -> None:
    """WAMIT point by point: 1.5 % for another mesh, 2.5 % at 0.3 Hz.

    There its 6.1 m of water make waves of 2 % less length than those of deep water (k h = 2.2); at
    0.5 Hz they do not (k h = 6.1).
    """
    omega = 2 * np.pi / WAMIT[:, 0]
    reference = np.array(
        [1000.0 * WAMIT[:, 1], 1000.0 * omega * WAMIT[:, 2], 9806.65 * WAMIT[:, 3]]
    )
    computed = at(surge_bem(), omega / (2 * np.pi))
    tolerance = np.array([0.025, 0.015, 0.015, 0.015])
    assert np.all(np.abs(computed / reference - 1.0) <= tolerance)
    assert surge_bem().added_mass_infinite == pytest.approx(154.93, rel=0.02)


def test_first_values_belong_to_a_hull_one_centimetre_deeper() -> None:
    """Point by point within 9 %: they were computed with all 0.17 m of the cylinder immersed.

    The heave file's hull (0.16 m immersed, 0.8561 m3) is kept, so that both axes are one hull.
    """
    computed = at(surge_bem(), FIRST[:, 0])
    reference = FIRST[:, 1:].T
    assert np.all(np.abs(computed / reference - 1.0) <= 0.09)
    assert np.all(computed[:, :6] < reference[:, :6])


@pytest.mark.parametrize(("name", "share"), [("heave", 4.0), ("surge", 8.0)])
def test_damping_and_excitation_obey_haskind(name: str, share: float) -> None:
    """B = k |Fe|² / (share rho g c_g): 4 for an axisymmetric hull in heave, 8 in surge.

    1.2 % in surge; the coarser mesh of the heave file is 3.4 % off above 0.8 Hz.
    """
    hull = bem() if name == "heave" else surge_bem()
    inside = (hull.frequency > 0.25) & (hull.frequency < 1.2)
    omega = 2 * np.pi * hull.frequency[inside]
    force = np.abs(hull.excitation[inside])
    damping = omega**2 / 9.81 * force**2 / (share * 1000.0 * 9.81 * 9.81 / (2 * omega))
    tolerance = 0.035 if name == "heave" else 0.012
    np.testing.assert_allclose(hull.damping[inside], damping, rtol=tolerance)


def test_heave_computed_with_surge_is_the_heave_file() -> None:
    """Another mesh, the same hull: 1.5 % at every frequency of 0.2-1 Hz, and in phase."""
    with np.load(CAPYTAINE) as file:
        inside = (file["f_hz"] > 0.2) & (file["f_hz"] < 1.0)
        pairs = [
            (file["A"], bem().added_mass),
            (file["B"], bem().damping),
            (file["Fe_complex"], bem().excitation),
        ]
        for anew, kept in pairs:
            assert np.abs(anew / kept - 1.0)[inside].max() <= 0.015
        assert float(file["Ainf"]) == pytest.approx(bem().added_mass_infinite, rel=0.005)


def test_phase_is_capytaines() -> None:
    """At long waves surge force follows the slope of the wave: -90 degrees in e^{-i omega t}."""
    hull = surge_bem()
    assert np.degrees(np.angle(hull.excitation[2])) == pytest.approx(-90.0, abs=1.0)
    assert hull.depth == np.inf


def fit(f: np.ndarray) -> np.ndarray:
    hull = plant().build().surge.body
    s = 2j * np.pi * f
    top = np.polyval([hull.b4, hull.b3, hull.b2, hull.b1, 0.0], s)
    return top / np.polyval([1.0, hull.a4, hull.a3, hull.a2, hull.a1, hull.a0], s)


def test_five_states_follow_the_bem() -> None:
    hull = surge_bem()
    inside = (hull.frequency >= 0.2) & (hull.frequency <= 1.0)
    table = radiation_impedance(hull)[inside]
    error = np.abs(fit(hull.frequency[inside]) - table) / np.abs(table)
    assert error.max() <= 0.001  # required: 0.005


def test_radiation_gives_no_energy() -> None:
    hull = plant().build().surge.body
    k = fit(np.logspace(-3, 5, 20001) / (2 * np.pi)).real
    assert k.min() >= -1e-6 * k.max()
    assert hull.a4 * hull.b4 >= hull.b3
    roots = np.roots([1.0, hull.a4, hull.a3, hull.a2, hull.a1, hull.a0])
    assert roots.real.max() < 0.0


def test_added_mass_is_the_infinite_one() -> None:
    file = plant().surge.added_mass_infinite.value
    assert file == pytest.approx(surge_bem().added_mass_infinite, abs=0.01)
