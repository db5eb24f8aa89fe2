"""Wave excitation from synthetic experiments and seas."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from known_device import impedances, make_experiment
from rehearsing import CONFIGS

from rig.identification import bem
from rig.identification.excitation import Excitation, Sea, excitation, is_same_sea
from rig.identification.experiments import Experiment
from rig.identification.impedances import models

PERIOD = 20.0
CYCLES = np.arange(4, 21)
BEM = bem.read_bem(CONFIGS / "plants" / "wavebot_bem.npz")


def planned_sea(number: int) -> dict[str, Any]:
    """Return the lines of one realisation of a sea, in the format of a plan."""
    rng = np.random.default_rng(100 + number)
    amplitude = 0.02 * (CYCLES / 4.0) ** -0.5
    amplitude[7] = 1e-4  # a line with almost no energy
    return {
        "repeat_s": PERIOD,
        "cycles": CYCLES.tolist(),
        "amplitude_m": amplitude.tolist(),
        "phase_rad": rng.uniform(0, 2 * np.pi, CYCLES.size).tolist(),
    }


def sea(number: int) -> Sea:
    """Return the wave calibration of the sea."""
    sea_plan = planned_sea(number)
    amplitude, phase = np.array(sea_plan["amplitude_m"]), np.array(sea_plan["phase_rad"])
    return Sea(
        f"calibration {number}", "probe_2", PERIOD, tuple(CYCLES.tolist()),
        amplitude * np.exp(1j * phase), np.zeros(CYCLES.size, bool),
        (tuple(amplitude.tolist()), tuple(phase.tolist())),
    )  # fmt: skip


def in_waves(number: int, multisine: int, noise: float = 0.0) -> Experiment:
    """Return a multisine experiment in a sea; the device's excitation is that of BEM."""
    calm_experiment = make_experiment(multisine, 2)
    force = np.zeros(len(calm_experiment.lines), complex)
    expected = bem.excitation_at(BEM, CYCLES / PERIOD)
    force[CYCLES - 1] = expected * sea(number).elevation
    return make_experiment(
        multisine, 2, noise, row=number, sea=planned_sea(number), excitation=force
    )


def identify_excitation(noise: float = 0.0) -> tuple[Excitation, Any]:
    calm = models([make_experiment(1, 2, noise, row=90), make_experiment(2, 2, noise, row=91)])
    pairs = [(in_waves(s, m, noise), sea(s)) for s in (1, 2, 3) for m in (1, 2)]
    result = excitation([e for e, _ in pairs], [s for _, s in pairs], calm[0])
    return result, bem.excitation_at(BEM, result.frequency)


def test_three_seas_and_two_multisines_give_the_excitation_with_its_phase() -> None:
    result, expected = identify_excitation()
    assert (result.seas, result.experiments, result.probe) == (3, 6, "probe_2")
    assert np.abs(result.value / expected - 1.0).max() < 1e-6
    # 60 degrees at 0.65 Hz: a phase with the wrong sign would differ by far.
    assert np.abs(result.value.conj() / expected - 1.0).max() > 1.5


def test_a_weak_line_of_the_sea_is_marked() -> None:
    result, expected = identify_excitation(0.005)
    assert np.flatnonzero(~result.good).tolist() == [7]
    relative_error = np.abs(result.value / expected - 1.0)
    assert relative_error[result.good].max() < 0.03
    assert relative_error[7] > relative_error[result.good].max()
    covered = np.abs(result.value - expected)[result.good] <= result.band[result.good]
    assert covered.mean() > 0.7  # 16 lines; the band does not include the noise of Z_i


def test_only_the_same_lines_are_the_same_sea() -> None:
    wave_experiment = in_waves(1, 1)
    assert is_same_sea(wave_experiment, sea(1))
    assert not is_same_sea(wave_experiment, sea(2))
    assert not is_same_sea(make_experiment(1), sea(1))
    assert not is_same_sea(wave_experiment, sea(1)._replace(repeat=10.0))


def test_seas_with_different_lines_are_refused() -> None:
    other = sea(2)._replace(cycles=tuple(range(5, 22)))
    calm = models([make_experiment(1)])[0]
    with pytest.raises(ValueError, match="do not have the same lines"):
        excitation([in_waves(1, 1), in_waves(2, 1)], [sea(1), other], calm)


def test_lines_between_those_of_the_impedance() -> None:
    """Z_i every 0.05 Hz, the sea's lines between: Re Z and omega Im Z are interpolated linearly."""
    model = models([make_experiment(1)])[0]
    offset_sea = sea(1)._replace(
        repeat=40.0, cycles=tuple(range(9, 40, 2)), weak=np.zeros(16, bool)
    )
    offset_sea = offset_sea._replace(elevation=np.ones(16, complex))
    long_experiment = make_experiment(3, period=40.0, lines=40, sea={"repeat_s": 40.0})
    result = excitation([long_experiment], [offset_sea], model)
    expected, _ = impedances(result.frequency, -5715.0)
    velocity = long_experiment.channels["velocity"].mean(axis=0)[np.array(offset_sea.cycles) - 1]
    interpolation_error = np.abs(result.value) / np.abs(expected * velocity)
    assert np.median(interpolation_error) < 0.01
    assert result.good.all()


@pytest.mark.parametrize("name", ["wavebot_bem.npz", "wavebot_bem.nc"])
def test_both_types_of_bem_files_agree(name: str) -> None:
    read = bem.read_bem(CONFIGS / "plants" / name)
    assert read.frequency == pytest.approx(BEM.frequency, rel=1e-6)
    assert read.excitation == pytest.approx(BEM.excitation, rel=1e-6)
    # capytaine's own phase at 0.65 Hz is -60.7 degrees, of e^{-i omega t}.
    assert np.degrees(np.angle(bem.excitation_at(read, np.array([0.65])))) == pytest.approx(
        60.7, abs=0.3
    )
    assert np.isnan(bem.excitation_at(read, np.array([9.0]))).all()


def test_other_files_are_refused_as_bem(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", x=1.0)
    with pytest.raises(ValueError, match="no field"):
        bem.read_bem(tmp_path / "other.npz")
    with pytest.raises(ValueError, match=r"npz or \.nc"):
        bem.read_bem(tmp_path / "bem.csv")
