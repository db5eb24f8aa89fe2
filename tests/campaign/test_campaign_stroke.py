"""The rig's stroke limits against the stator force of the simulated spring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rig.config import RigFile, load, load_mapping
from sim_plant.parameters import Plant
from sim_plant.stator_force import reversal

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
RIG, _ = load(CONFIGS / "rigs" / "wavebot.yaml", RigFile)
PLANT = Plant.model_validate(load_mapping(CONFIGS / "plants" / "wavebot.yaml")[0]).build()


def reverses_at(stator: float) -> float:
    """Heave (m) at which the simulated stator force changes its sign; inf: nowhere."""
    return reversal(PLANT.stator, PLANT.spring, stator).stroke


def test_no_spring_rate_lets_the_body_go_where_the_stator_force_reverses() -> None:
    rates, positions = RIG.spring.by_rate()
    for rate in np.linspace(rates[0], rates[-1], 400):
        stator = float(np.interp(rate, rates, positions))
        assert RIG.spring.stroke(float(rate)) < reverses_at(stator), (rate, stator)


def test_the_limit_costs_stroke_only_where_it_has_to() -> None:
    """Large rates never reverse: there the stop of heave alone counts."""
    for point in RIG.spring.map:
        free = reverses_at(point.stator_percent) > 0.35
        assert point.stroke_m == pytest.approx(0.35 if free else 0.25)


@pytest.mark.parametrize(
    ("rate", "stroke"),
    [(490.9, 0.25), (491.0, 0.25), (3379.0, 0.35), (0.0, 0.25), (-2763.0, 0.35), (9e9, 0.35)],
)
def test_between_stations_the_lesser_stroke_counts(rate: float, stroke: float) -> None:
    assert RIG.spring.stroke(rate) == stroke
