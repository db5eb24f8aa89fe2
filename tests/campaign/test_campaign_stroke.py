"""The rig's stroke limits compared with the stator force of the simulated spring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rig.config.pydantic_errors import load
from rig.config.yaml_source import load_mapping
from rig.kinds.wavebot.config import RigFile
from sim_plant.parameters import Plant
from sim_plant.stator_force import force_reversal

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
RIG, _ = load(CONFIGS / "rigs" / "wavebot.yaml", RigFile)
PLANT = Plant.model_validate(load_mapping(CONFIGS / "plants" / "wavebot.yaml")[0]).build()


def reversal_stroke(stator: float) -> float:
    """Return the heave (m) at which the simulated stator force changes sign; inf if never."""
    return force_reversal(PLANT.stator, PLANT.spring, stator).stroke


def test_every_stroke_ends_before_the_stator_force_reverses() -> None:
    rates, positions = RIG.spring.by_rate()
    for rate in np.linspace(rates[0], rates[-1], 400):
        stator = float(np.interp(rate, rates, positions))
        assert RIG.spring.stroke(float(rate)) < reversal_stroke(stator), (rate, stator)


def test_the_stroke_is_limited_only_where_the_force_reverses() -> None:
    """The force never reverses at large rates; there the stop of heave is the limit."""
    for point in RIG.spring.map:
        never_reverses = reversal_stroke(point.stator_percent) > 0.35
        assert point.stroke_m == pytest.approx(0.35 if never_reverses else 0.25)


@pytest.mark.parametrize(
    ("rate", "stroke"),
    [(490.9, 0.25), (491.0, 0.25), (3379.0, 0.35), (0.0, 0.25), (-2763.0, 0.35), (9e9, 0.35)],
)
def test_between_stations_the_smaller_stroke_applies(rate: float, stroke: float) -> None:
    assert RIG.spring.stroke(rate) == stroke
