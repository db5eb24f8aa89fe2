"""Wave excitation on paper: what was put in comes out, and only seas without the device count."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from known_device import experiment, impedances
from rehearsing import CONFIGS

from rig.identification import bem
from rig.identification.excitation import Excitation, Sea, excitation, same_sea
from rig.identification.experiments import Experiment
from rig.identification.impedances import models

PERIOD = 20.0
CYCLES = np.arange(4, 21)
BEM = bem.read_bem(CONFIGS / "plants" / "wavebot_bem.npz")


def asked(number: int) -> dict[str, Any]:
    """The lines of one realisation of a sea, as a plan has them."""
    rng = np.random.default_rng(100 + number)
    size = 0.02 * (CYCLES / 4.0) ** -0.5
    size[7] = 1e-4  # a line that the wave maker hardly made
    return {
        "repeat_s": PERIOD,
        "cycles": CYCLES.tolist(),
        "amplitude_m": size.tolist(),
        "phase_rad": rng.uniform(0, 2 * np.pi, CYCLES.size).tolist(),
    }


def sea(number: int) -> Sea:
    """Its calibration."""
    told = asked(number)
    size, phase = np.array(told["amplitude_m"]), np.array(told["phase_rad"])
    return Sea(
        f"calibration {number}", "probe_2", PERIOD, tuple(CYCLES.tolist()),
        size * np.exp(1j * phase), np.zeros(CYCLES.size, bool),
        (tuple(size.tolist()), tuple(phase.tolist())),
    )  # fmt: skip


def in_waves(number: int, multisine: int, noise: float = 0.0) -> Experiment:
    """A multisine in a sea, of a device whose excitation is that of BEM."""
    one = experiment(multisine, 2)
    force = np.zeros(len(one.lines), complex)
    expected = bem.at(BEM, CYCLES / PERIOD)
    force[CYCLES - 1] = expected * sea(number).elevation
    return experiment(multisine, 2, noise, row=number, sea=asked(number), excitation=force)


def identified(noise: float = 0.0) -> tuple[Excitation, Any]:
    calm = models([experiment(1, 2, noise, row=90), experiment(2, 2, noise, row=91)])
    pairs = [(in_waves(s, m, noise), sea(s)) for s in (1, 2, 3) for m in (1, 2)]
    made = excitation([e for e, _ in pairs], [s for _, s in pairs], calm[0])
    return made, bem.at(BEM, made.frequency)


def test_three_seas_and_two_multisines_give_the_excitation_with_its_phase() -> None:
    made, expected = identified()
    assert (made.seas, made.experiments, made.probe) == (3, 6, "probe_2")
    assert np.abs(made.value / expected - 1.0).max() < 1e-6
    # 60 degrees at 0.65 Hz: a phase of the other sign would be far off.
    assert np.abs(made.value.conj() / expected - 1.0).max() > 1.5


def test_a_line_that_the_sea_hardly_has_is_marked() -> None:
    made, expected = identified(0.005)
    assert np.flatnonzero(~made.good).tolist() == [7]
    off = np.abs(made.value / expected - 1.0)
    assert off[made.good].max() < 0.03
    assert off[7] > off[made.good].max()
    covered = np.abs(made.value - expected)[made.good] <= made.band[made.good]
    assert covered.mean() > 0.7  # 16 lines; the noise of Z_i itself is not in the band


def test_only_the_same_lines_are_the_same_sea() -> None:
    one = in_waves(1, 1)
    assert same_sea(one, sea(1))
    assert not same_sea(one, sea(2))
    assert not same_sea(experiment(1), sea(1))
    assert not same_sea(one, sea(1)._replace(repeat=10.0))


def test_seas_of_other_lines_are_told() -> None:
    other = sea(2)._replace(cycles=tuple(range(5, 22)))
    calm = models([experiment(1)])[0]
    with pytest.raises(ValueError, match="not the same lines"):
        excitation([in_waves(1, 1), in_waves(2, 1)], [sea(1), other], calm)


def test_lines_between_those_of_the_impedance() -> None:
    """Z_i on lines 0.05 Hz apart, the sea between them: Re Z and omega Im Z go straight."""
    made = models([experiment(1)])[0]
    between = sea(1)._replace(repeat=40.0, cycles=tuple(range(9, 40, 2)), weak=np.zeros(16, bool))
    between = between._replace(elevation=np.ones(16, complex))
    wide = experiment(3, period=40.0, lines=40, sea={"repeat_s": 40.0})
    found = excitation([wide], [between], made)
    true, _ = impedances(found.frequency, -5715.0)
    velocity = wide.channels["velocity"].mean(axis=0)[np.array(between.cycles) - 1]
    left = np.abs(found.value) / np.abs(true * velocity)  # what interpolation puts in
    assert np.median(left) < 0.01
    assert found.good.all()


@pytest.mark.parametrize("name", ["wavebot_bem.npz", "wavebot_bem.nc"])
def test_bem_files_of_both_kinds_say_the_same(name: str) -> None:
    found = bem.read_bem(CONFIGS / "plants" / name)
    assert found.frequency == pytest.approx(BEM.frequency, rel=1e-6)
    assert found.excitation == pytest.approx(BEM.excitation, rel=1e-6)
    # capytaine's own phase at 0.65 Hz is -60.7 degrees, of e^{-i omega t}.
    assert np.degrees(np.angle(bem.at(found, np.array([0.65])))) == pytest.approx(60.7, abs=0.3)
    assert np.isnan(bem.at(found, np.array([9.0]))).all()


def test_what_is_no_bem_file_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", x=1.0)
    with pytest.raises(ValueError, match="no field"):
        bem.read_bem(tmp_path / "other.npz")
    with pytest.raises(ValueError, match=r"npz or \.nc"):
        bem.read_bem(tmp_path / "bem.csv")
