"""Quadratic drag of calm water is not that of waves: taken out, the excitation is BEM's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from known_device import experiment, impedances
from rehearsing import CONFIGS

from rig.identification import bem
from rig.identification.drag import drag_of, lines_of_drag
from rig.identification.excitation import Sea, excitation
from rig.identification.experiments import Experiment
from rig.identification.impedances import models

PERIOD, LINES = 20.0, 25
CYCLES = np.arange(4, 21)
BEM = bem.read_bem(CONFIGS / "plants" / "wavebot_bem.npz")
COEFFICIENT = 1216.0  # N s^2/m^2, of the nonlinear plant
SIZE = 0.02 * (CYCLES / 4.0) ** -0.5


def moving(one: Experiment, pushed: Any, excited: Any) -> Experiment:
    """The same with drag: the motion that forces (N, by line) on drivetrain and hull give."""
    number = np.arange(1, LINES + 1)
    intrinsic, series = impedances(number / PERIOD, -5715.0)
    velocity = (pushed + excited) / series
    for _ in range(300):  # a motion that fits its own drag
        drag = COEFFICIENT * lines_of_drag(velocity)
        velocity = 0.7 * velocity + 0.3 * (pushed + excited - drag) / series
    lcb = intrinsic * velocity + COEFFICIENT * lines_of_drag(velocity) - excited
    twice = {"velocity": velocity, "lcb": lcb, "trs": pushed}
    told = {name: np.repeat(each[None, :], 2, axis=0) for name, each in twice.items()}
    return one._replace(channels=one.channels | told, reference=pushed)


def device(seed: int, amplitude: float, waves: bool) -> tuple[Experiment, Sea]:
    """A multisine of some amplitude (N a line), in calm water or in a sea of its own."""
    one = experiment(seed, lines=LINES - 5, period=PERIOD, peak=15.0 * amplitude)
    phase = np.random.default_rng(seed + 50).uniform(0.0, 2.0 * np.pi, CYCLES.size)
    asked = {"repeat_s": PERIOD, "cycles": CYCLES.tolist(), "amplitude_m": SIZE.tolist(),
             "phase_rad": phase.tolist()}  # fmt: skip
    eta = SIZE * np.exp(1j * phase)
    sea = Sea("calm", "truth", PERIOD, tuple(CYCLES.tolist()), eta, np.zeros(CYCLES.size, bool),
              (tuple(SIZE.tolist()), tuple(phase.tolist())))  # fmt: skip
    force = np.zeros(LINES, complex)
    if waves:
        one = one._replace(sea=asked)
        force[CYCLES - 1] = bem.at(BEM, CYCLES / PERIOD) * eta
    return moving(one, one.reference * (amplitude / 100.0), force), sea


def test_what_calm_water_tells_of_drag_is_taken_out_in_waves() -> None:
    """Without it the weakly excited lines are far off, as in the rehearsal of the docs."""
    calm = [device(seed, size, waves=False)[0] for seed, size in ((1, 60.0), (2, 60.0), (3, 150.0))]
    drag = drag_of(calm)
    assert drag is not None
    assert drag.coefficient == pytest.approx(COEFFICIENT, rel=1e-6)
    intrinsic, _ = impedances(drag.frequency, -5715.0)
    assert np.abs(drag.impedance / intrinsic - 1.0).max() < 1e-6
    pairs = [device(seed, 60.0, waves=True) for seed in (4, 5)]
    runs, seas = [p[0] for p in pairs], [p[1] for p in pairs]
    model = models(calm)[0]
    expected = bem.at(BEM, CYCLES / PERIOD)
    left_in = excitation(runs, seas, model)
    taken = excitation(runs, seas, model, drag)
    assert (left_in.drag, taken.drag) == (0.0, drag.coefficient)
    assert np.abs(taken.value / expected - 1.0).max() < 1e-6
    assert np.abs(left_in.value / expected - 1.0).max() > 0.05


def test_a_linear_hull_shows_no_drag_and_one_row_cannot_tell() -> None:
    linear = [experiment(seed, 2, 0.002) for seed in (1, 2, 3)]
    assert drag_of(linear) is None
    assert drag_of([device(1, 60.0, waves=False)[0]]) is None
    assert drag_of([]) is None
