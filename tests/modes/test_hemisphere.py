"""One floating hemisphere in the files of four programs, against theory and published runs.

The files in `hemisphere/` are capytaine's own exports (configs/plants/compute_hemisphere_bem.py):
what reads them was not written next to what wrote them.
"""

from __future__ import annotations

import mode_plants
import numpy as np
import pytest
from mode_plants import HEMISPHERE
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from sim_plant.modes.bem import BemModes, read_modes, stated_mass
from sim_plant.modes.bem_content import RIGID_MODES, Water

DEEP = Water(density=1000.0, gravity=9.81, depth=np.inf)
MASS = 2000.0 * np.pi / 3.0  # kg, of the displaced water
# A. Hulme, J. Fluid Mech. 121, 1982, table 1: K a, added mass by the displaced mass, damping by it
# and omega.
HULME = np.array([
    (0.1, 0.8627, 0.1816), (0.2, 0.7938, 0.2793), (0.3, 0.7157, 0.3254), (0.4, 0.6452, 0.3410),
    (0.5, 0.5861, 0.3391), (0.6, 0.5381, 0.3271), (0.8, 0.4698, 0.2899), (1.0, 0.4284, 0.2484),
    (1.4, 0.3924, 0.1756), (2.0, 0.3884, 0.1031), (3.0, 0.4111, 0.0452), (4.0, 0.4322, 0.0219),
])  # fmt: skip
# Runs of Nemoh 2.3 and 3.0.2 for a sphere of radius 5 m, 50 m deep, in the examples of WEC-Sim:
# rad/s; A11, kg; B11, N s/m; X1 and X3, N/m, each modulus and phase, rad.
NEMOH_2 = (
    (1.0, 172101.4, 27636.89, 321388.7, -1.515387, 407379.8, -0.2286643),
    (1.4, 152136.0, 131545.5, 422726.2, -1.424789, 248975.0, -0.6021240),
)
NEMOH_3_FORCES = (
    (1.0, 321292.6, -1.515308, 407263.6, -0.2287664),
    (1.4, 422920.6, -1.424713, 249012.4, -0.6023003),
)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, BemModes]:
    """Return the results of the programs by name; all but Capytaine's lack or add something."""
    capytaine = read_modes(HEMISPHERE)
    folder = tmp_path_factory.mktemp("hemisphere")
    out = mode_plants.write_out(folder / "hemisphere.out", capytaine, [1, 2, 3, 4, 5, 6])
    return {
        "Capytaine": capytaine,
        "WAMIT numeric": read_modes(HEMISPHERE.with_suffix(".1"), water=DEEP),
        "WAMIT formatted": read_modes(out, water=Water(density=1000.0)),
        "Nemoh": read_modes(HEMISPHERE.parent),
        "BEMIO": read_modes(mode_plants.write_bemio(folder / "hemisphere.h5", capytaine)),
    }


@pytest.mark.parametrize("program", ["WAMIT numeric", "WAMIT formatted", "Nemoh", "BEMIO"])
def test_four_programs_agree(files: dict[str, BemModes], program: str) -> None:
    """Within 1 %; the files have six or seven digits, and Nemoh's has no A_inf."""
    one, other = files["Capytaine"], files[program]
    assert one.modes == other.modes == RIGID_MODES
    np.testing.assert_allclose(one.frequency, other.frequency, rtol=1e-5)
    assert (one.density, one.gravity, one.depth) == (other.density, other.gravity, other.depth)
    for name, allowed in (
        ("added_mass", 1e-5), ("damping", 1e-5), ("excitation", 1e-5), ("stiffness", 1e-5),
        ("added_mass_infinite", 0.01),
    ):  # fmt: skip
        mine, others = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(mine, others, atol=allowed * np.abs(mine).max(), err_msg=name)


def test_conventions_and_formats_are_stated(files: dict[str, BemModes]) -> None:
    stated = {program: (bem.source, bem.phase) for program, bem in files.items()}
    assert stated == {
        "Capytaine": ("Capytaine 3.0.0 NetCDF", "e^{-i omega t}"),
        "WAMIT numeric": ("WAMIT .1, .3 and .hst", "e^{+i omega t}"),
        "WAMIT formatted": ("WAMIT .out", "e^{+i omega t}"),
        "Nemoh": ("Nemoh", "e^{-i omega t}"),
        "BEMIO": ("WEC-Sim BEMIO .h5", "e^{+i omega t}"),
    }


def test_masses_are_those_of_the_displaced_water(files: dict[str, BemModes]) -> None:
    assert stated_mass(files["Capytaine"], 2) == (
        pytest.approx(MASS, rel=1e-6),
        "inertia_matrix of the BEM file",
    )
    mass, source = stated_mass(files["Nemoh"], 2)
    assert mass == pytest.approx(MASS, rel=1e-6)
    assert source.startswith("displaced: 1000 kg/m3 * 2.09")


def at(bem: BemModes, values: NDArray[np.float64], omega: float) -> float:
    return float(CubicSpline(2.0 * np.pi * bem.frequency, values)(omega))


@pytest.mark.parametrize("program", ["Capytaine", "WAMIT numeric", "Nemoh", "BEMIO"])
def test_heave_is_that_of_hulme(files: dict[str, BemModes], program: str) -> None:
    """Added mass within 0.2 %, damping within 0.3 % of its peak; the mesh has 864 panels."""
    bem = files[program]
    for ka, mass, damping in HULME:
        omega = float(np.sqrt(9.81 * ka))
        assert at(bem, bem.added_mass[:, 2, 2], omega) / MASS == pytest.approx(mass, rel=0.002)
        found = at(bem, bem.damping[:, 2, 2], omega) / (MASS * omega)
        assert found == pytest.approx(damping, abs=0.001)
    assert bem.added_mass_infinite[2, 2] / MASS == pytest.approx(0.5, rel=0.003)
    assert bem.stiffness is not None
    assert bem.stiffness[2, 2] == pytest.approx(9810.0 * np.pi, rel=3e-3)  # a 48-gon


def test_published_runs_of_nemoh_agree_by_froude_scaling(files: dict[str, BemModes]) -> None:
    """Coefficients within 2 %, forces within 1 % and 0.01 rad, for another mesh, depth and size.

    Nemoh's indirect method on 1,250 panels has 1 % too much added mass, as capytaine's with it.
    """
    bem = files["Nemoh"]
    root = np.sqrt(5.0)
    for omega, mass, damping, surge, surge_phase, heave, heave_phase in NEMOH_2:
        scaled = omega * root
        assert 125.0 * at(bem, bem.added_mass[:, 0, 0], scaled) == pytest.approx(mass, rel=0.02)
        found = 125.0 / root * at(bem, bem.damping[:, 0, 0], scaled)
        assert found == pytest.approx(damping, rel=0.02)
        assert_force(bem, scaled, 0, surge, surge_phase)
        assert_force(bem, scaled, 2, heave, heave_phase)
    for omega, surge, surge_phase, heave, heave_phase in NEMOH_3_FORCES:
        assert_force(bem, omega * root, 0, surge, surge_phase)
        assert_force(bem, omega * root, 2, heave, heave_phase)


def assert_force(bem: BemModes, omega: float, mode: int, modulus: float, phase: float) -> None:
    force = bem.excitation[:, mode]
    found = complex(at(bem, force.real, omega), at(bem, force.imag, omega))
    assert 25.0 * abs(found) == pytest.approx(modulus, rel=0.01)
    assert np.angle(found) == pytest.approx(phase, abs=0.01)
