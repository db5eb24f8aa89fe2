"""Compiled plant and law give the same energies to the bit as hand-written C."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from benchmarks.arithmetic import build_model, c_simulation, compiled_simulation
from benchmarks.support.scipy_reference import solve_continuous_law, solve_sampled_law


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_c_and_the_lifted_functions_agree_to_the_bit(tmp_path: Path) -> None:
    models = build_model(tmp_path)
    compiled_energies, reference_energies = (
        compiled_simulation(models),
        c_simulation(models, tmp_path),
    )
    assert reference_energies is not None
    for ticks in (1, 700, 20_000):
        assert compiled_energies(ticks) == reference_energies(ticks)
    _, ac, *_ = compiled_energies(4000)
    # The law is sampled at 1 kHz here and continuous in scipy: half a tick of delay is 1e-3.
    assert ac == pytest.approx(solve_continuous_law(models, 4.0, 1e-6)[1], rel=5e-3)


def test_scipy_integrates_the_same_model(tmp_path: Path) -> None:
    """The law acts once per tick in both, so the difference is the integrator's error."""
    models = build_model(tmp_path)
    compiled_energies, reference_energies = (
        compiled_simulation(models)(1500),
        solve_sampled_law(models, 1.5, 1e-3),
    )
    # Midpoint rule at 1 ms; the stator moves once per tick here and continuously in scipy.
    assert compiled_energies[:3] == pytest.approx(reference_energies, rel=1e-4)
