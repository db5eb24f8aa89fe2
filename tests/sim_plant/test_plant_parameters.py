"""Plant files: the three that ship are valid, and one bad file per rule is refused by name."""

from __future__ import annotations

import copy
import math
from typing import Any

import pytest
from plant_files import PLANTS, mapping, plant
from pydantic import ValidationError

from sim_plant.parameters import Plant

SHIPPED = sorted(path.stem for path in PLANTS.glob("*.yaml"))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_files_are_valid_and_build_floats(name: str) -> None:
    params = plant(name).build()
    for part in (params.body, params.pto, params.drive):
        assert all(type(number) is float for number in part)
    assert all(type(rate) is float for rate in params.spring.rates)
    assert (PLANTS / plant(name).bem).exists()


def test_integers_are_numbers_too() -> None:
    text = mapping("wavebot.yaml")
    text["body"]["mass"]["value"] = 860
    assert type(Plant.model_validate(text).build().body.inertia) is float


def test_derived_constants() -> None:
    params = plant().build()
    assert params.pto.force_per_current == pytest.approx(76.98, abs=0.01)
    assert params.pto.copper == pytest.approx(5.626e-5, rel=1e-4)
    assert params.body[4:] == (
        *(922.0699, 1316.647, 660.4136, 155.3015, 18.185),
        *(543002.2, 668098.5, 75223.29, 4594.69),
    )


BAD: list[tuple[str, Any, tuple[str, ...]]] = [
    ("body.mass.value", -1.0, ("body", "mass", "value")),
    ("body.mass.value", "860", ("body", "mass", "value")),
    ("body.mass.value", True, ("body", "mass", "value")),
    ("body.mass.value", math.inf, ("body", "mass", "value")),
    ("body.mass.value", math.nan, ("body", "mass", "value")),
    ("body.mass.unit", "t", ("body", "mass", "unit")),
    ("body.mass.source", "", ("body", "mass", "source")),
    ("body.mass.source", "  ", ("body", "mass", "source")),
    ("body.mass.remark", "x", ("body", "mass", "remark")),
    ("body.colour", {}, ("body", "colour")),
    ("weather", {}, ("weather",)),
    ("name", "", ("name",)),
    ("body.radiation.numerator.value", [1.0, 2.0], ("body", "radiation")),
    ("body.radiation.numerator.value", [1.0, 75223.0, 1.0, 1.0], ("body", "radiation")),
    ("spring.law.value", "cubic", ("spring", "law", "value")),
    ("spring.spring_effect.value", 2.0, ("spring", "spring_effect", "value")),
    ("spring.spring_rates.value", [1.0, 2.0], ("spring",)),
    ("spring.stator_positions.value", [5.0] * 9, ("spring",)),
    ("stator.start.value", 99.0, ()),
    ("drive.watchdog.value", 0.0, ("drive", "watchdog", "value")),
    ("drive.current_time_constant.value", 0, ("drive", "current_time_constant", "value")),
    ("sensors.delay_ticks.value", 21, ("sensors", "delay_ticks", "value")),
    ("sensors.delay_ticks.value", 1.5, ("sensors", "delay_ticks", "value")),
    ("pto.coulomb_velocity.value", 0.0, ("pto", "coulomb_velocity", "value")),
    ("waves.onset.value", -1.0, ("waves", "onset", "value")),
]


@pytest.mark.parametrize(("path", "value", "loc"), BAD)
def test_one_bad_file_per_rule(path: str, value: Any, loc: tuple[str, ...]) -> None:
    text = copy.deepcopy(mapping("wavebot.yaml"))
    *sections, field = path.split(".")
    inner = text
    for section in sections:
        inner = inner[section]
    inner[field] = value
    with pytest.raises(ValidationError) as refusal:
        Plant.model_validate(text)
    assert [error["loc"] for error in refusal.value.errors()] == [loc]


@pytest.mark.parametrize("section", ["body", "pto", "spring", "stator", "drive", "sensors"])
def test_nothing_has_a_default(section: str) -> None:
    for field in mapping("wavebot.yaml")[section]:
        text = copy.deepcopy(mapping("wavebot.yaml"))
        del text[section][field]
        with pytest.raises(ValidationError, match="Field required"):
            Plant.model_validate(text)
