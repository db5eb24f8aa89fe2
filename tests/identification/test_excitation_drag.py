"""Excitation with the quadratic drag of calm water subtracted agrees with BEM."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from known_device import impedances, make_experiment
from rehearsing import CONFIGS

from rig.identification import bem
from rig.identification.drag import drag_spectrum, identify_drag
from rig.identification.excitation import Sea, excitation
from rig.identification.experiments import BODY, Experiment
from rig.identification.impedances import models

PERIOD, LINES = 20.0, 25
CYCLES = np.arange(4, 21)
BEM = bem.read_bem(CONFIGS / "plants" / "wavebot_bem.npz")
COEFFICIENT = 1216.0  # N s^2/m^2, of the nonlinear plant
SIZE = 0.02 * (CYCLES / 4.0) ** -0.5


def moving(base: Experiment, drive_force: Any, wave_force: Any) -> Experiment:
    """Return the experiment with drag, for forces (N, by line) on drivetrain and hull."""
    number = np.arange(1, LINES + 1)
    intrinsic, series = impedances(number / PERIOD, -5715.0)
    velocity = (drive_force + wave_force) / series
    for _ in range(300):  # fixed-point iteration of motion and drag
        drag = COEFFICIENT * drag_spectrum(velocity)
        velocity = 0.7 * velocity + 0.3 * (drive_force + wave_force - drag) / series
    lcb = intrinsic * velocity + COEFFICIENT * drag_spectrum(velocity) - wave_force
    by_channel = {"velocity": velocity, BODY: lcb, "trs": drive_force}
    channels = {name: np.repeat(each[None, :], 2, axis=0) for name, each in by_channel.items()}
    return base._replace(channels=base.channels | channels, reference=drive_force)


def device(seed: int, amplitude: float, waves: bool) -> tuple[Experiment, Sea]:
    """Return a multisine of an amplitude (N per line), in calm water or in its own sea."""
    base = make_experiment(seed, lines=LINES - 5, period=PERIOD, peak=15.0 * amplitude)
    phase = np.random.default_rng(seed + 50).uniform(0.0, 2.0 * np.pi, CYCLES.size)
    sea_plan = {
        "repeat_s": PERIOD,
        "cycles": CYCLES.tolist(),
        "amplitude_m": SIZE.tolist(),
        "phase_rad": phase.tolist(),
    }
    elevation = SIZE * np.exp(1j * phase)
    commanded = (tuple(SIZE.tolist()), tuple(phase.tolist()))
    not_weak = np.zeros(CYCLES.size, bool)
    sea = Sea("calm", "truth", PERIOD, tuple(CYCLES.tolist()), elevation, not_weak, commanded)
    wave_force = np.zeros(LINES, complex)
    if waves:
        base = base._replace(sea=sea_plan)
        wave_force[CYCLES - 1] = bem.excitation_at(BEM, CYCLES / PERIOD) * elevation
    return moving(base, base.reference * (amplitude / 100.0), wave_force), sea


def test_drag_identified_in_calm_water_is_subtracted_in_waves() -> None:
    """Without the subtraction, weakly excited lines have large errors (see the docs)."""
    calm = [device(seed, size, waves=False)[0] for seed, size in ((1, 60.0), (2, 60.0), (3, 150.0))]
    drag = identify_drag(calm)
    assert drag is not None
    assert drag.coefficient == pytest.approx(COEFFICIENT, rel=1e-6)
    intrinsic, _ = impedances(drag.frequency, -5715.0)
    assert np.abs(drag.impedance / intrinsic - 1.0).max() < 1e-6
    pairs = [device(seed, 60.0, waves=True) for seed in (4, 5)]
    runs, seas = [p[0] for p in pairs], [p[1] for p in pairs]
    model = models(calm)[0]
    expected = bem.excitation_at(BEM, CYCLES / PERIOD)
    with_drag = excitation(runs, seas, model)
    without_drag = excitation(runs, seas, model, drag)
    assert (with_drag.drag, without_drag.drag) == (0.0, drag.coefficient)
    assert np.abs(without_drag.value / expected - 1.0).max() < 1e-6
    assert np.abs(with_drag.value / expected - 1.0).max() > 0.05


def test_a_linear_hull_or_a_single_row_gives_no_drag() -> None:
    linear = [make_experiment(seed, 2, 0.002) for seed in (1, 2, 3)]
    assert identify_drag(linear) is None
    assert identify_drag([device(1, 60.0, waves=False)[0]]) is None
    assert identify_drag([]) is None
