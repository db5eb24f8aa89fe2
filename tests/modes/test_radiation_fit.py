"""The fitted radiation: accurate in the wave band, stable, passive, quick, zero at rest."""

from __future__ import annotations

import time
from pathlib import Path

import mode_plants
import numpy as np
import plant_files
import pytest
from mode_plants import CYLINDER, TWO_BODY, WAVEBOT

from sim_plant.modes import radiation
from sim_plant.modes.bem import BemModes, impedance, read_modes
from sim_plant.modes.radiation import Radiation, fit, response

GRID = np.geomspace(1e-4, 1e5, 4001)  # rad/s
HEMISPHERE = mode_plants.HEMISPHERE
FILES = (WAVEBOT, CYLINDER, TWO_BODY, HEMISPHERE)


def eigenvalues(memory: Radiation) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    states = len(memory.source)
    system = np.diag(memory.diagonal)
    system[range(states), memory.partner] += memory.cross
    found: np.ndarray[tuple[int, ...], np.dtype[np.complex128]] = np.linalg.eigvals(system)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_it_is_stable_and_passive_at_all_frequencies(path: Path) -> None:
    memory = fit(read_modes(path))
    assert eigenvalues(memory).real.max() < 0.0
    assert radiation.smallest_damping(memory, GRID) > -1e-12


def test_four_coupled_modes_are_passive() -> None:
    memory = fit(mode_plants.four_modes())
    assert radiation.smallest_damping(memory, GRID) > -1e-12
    assert set(memory.source) == {0, 1, 2, 3}  # one block
    assert np.all(np.any(memory.output, axis=1))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_it_is_zero_at_rest(path: Path) -> None:
    memory = fit(read_modes(path))
    at_rest = np.abs(response(memory, np.array([1e-9]))).max()
    assert at_rest < 1e-7 * np.abs(response(memory, GRID)).max()


@pytest.mark.parametrize(
    ("path", "modes", "allowed"),
    [
        (WAVEBOT, ["Heave"], 0.01),
        (CYLINDER, ["Surge", "Heave", "Pitch"], 0.01),
        (HEMISPHERE, ["Surge", "Heave", "Pitch"], 0.01),
        (TWO_BODY, ["float__Heave", "disc__Heave"], 0.035),
    ],
    ids=lambda value: getattr(value, "stem", None),
)
def test_the_error_in_the_wave_band(path: Path, modes: list[str], allowed: float) -> None:
    """The added mass of the disc is 97 % A_inf: 0.2 % noise of A is 4 % of the rest."""
    bem = read_modes(path, modes)
    memory = fit(bem)
    assert memory.error.max() <= allowed
    omega = 2.0 * np.pi * bem.frequency
    target = impedance(bem)
    peak = np.sqrt(np.einsum("ii->i", np.abs(target).max(axis=0)))
    gap = np.abs(radiation.total_response(memory, omega) - target) / np.outer(peak, peak)
    band = (bem.frequency > 0.2) & (bem.frequency < 0.7)
    assert gap[band].max() <= allowed


def test_the_order_follows_the_tolerance() -> None:
    bem = mode_plants.cylinder("Heave")
    orders = [len(fit(bem, tolerance).source) for tolerance in (0.1, 0.05, 0.012)]
    assert orders == sorted(orders)
    assert orders[0] < orders[-1] <= radiation.MAX_ORDER


def test_uncoupled_modes_share_no_states() -> None:
    memory = fit(mode_plants.cylinder())
    heave = [k for k, mode in enumerate(memory.source) if mode == 1]
    assert np.all(memory.output[[0, 2]][:, heave] == 0.0)
    assert np.any(memory.output[2, [k for k, mode in enumerate(memory.source) if mode == 0]])


def test_irregular_frequencies_are_left_out_and_reported() -> None:
    """The WaveBot's file, without a lid, is wrong near 1.67 Hz; the cylinder's has a lid."""
    assert 1.66949 in fit(read_modes(WAVEBOT)).left_out.round(5)
    assert fit(read_modes(CYLINDER)).left_out.size == 0


def test_the_wavebot_agrees_with_its_five_states() -> None:
    """Two fits of one file differ by the sum of their errors: 1 % and 0.3 % of the peak."""
    memory = fit(read_modes(WAVEBOT))
    file = plant_files.plant().body.radiation
    s = 2j * np.pi * np.linspace(0.2, 1.0, 81)
    other = np.polyval([*file.numerator.value, 0.0], s) / np.polyval(
        [1, *file.denominator.value], s
    )
    gap = np.abs(response(memory, s.imag)[:, 0, 0] - other)
    assert gap.max() < 0.013 * np.abs(other).max()


def test_two_modes_take_less_than_five_seconds() -> None:
    bem = read_modes(TWO_BODY)
    begin = time.process_time()
    fit(bem)
    assert time.process_time() - begin < 5.0


def test_the_added_mass_at_infinity_is_corrected_to_fit_the_rest() -> None:
    """i omega times the error of A_inf is no memory: the fit finds 2 % that were added to it."""
    bem = mode_plants.cylinder("Heave")
    plain = fit(bem)
    wrong = fit(bem._replace(added_mass_infinite=1.02 * bem.added_mass_infinite))
    found = wrong.added_mass - plain.added_mass
    assert found[0, 0] == pytest.approx(-0.02 * bem.added_mass_infinite[0, 0], rel=0.05)
    assert wrong.error.max() <= 0.01


def test_noise_is_refused() -> None:
    bem = mode_plants.cylinder("Heave")
    noise = np.random.default_rng(1).standard_normal(bem.damping.shape)
    noisy: BemModes = bem._replace(damping=np.abs(noise) * bem.damping.max())
    with pytest.raises(ValueError, match=r"radiation of Heave is fitted with an error of"):
        fit(noisy)
