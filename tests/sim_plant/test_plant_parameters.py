"""Plant files: the three shipped ones are valid, and one bad file per rule is refused by name."""

from __future__ import annotations

import copy
import math
from typing import Any

import pytest
from plant_files import PLANTS, mapping, plant
from pydantic import ValidationError

from sim_plant.parameters import Plant

SHIPPED = sorted(path.stem for path in PLANTS.glob("wavebot*.yaml"))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_files_are_valid_and_build_floats(name: str) -> None:
    params = plant(name).build()
    for part in (params.body, params.pto, params.surge.body, params.electrics.drive):
        assert all(type(number) is float for number in part)
    assert all(type(rate) is float for rate in params.spring.rates)
    assert (PLANTS / plant(name).bem).exists()


def test_integers_are_accepted_as_numbers() -> None:
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
    locations = [tuple(part for part in e["loc"] if part != "cots") for e in refusal.value.errors()]
    assert locations == [loc]


@pytest.mark.parametrize("name", ["wavebot", "wavebot_custom"])
def test_nothing_has_a_default(name: str) -> None:
    complete = mapping(f"{name}.yaml")
    for section in (s for s in complete if isinstance(complete[s], dict)):
        for field in complete[section]:
            text = copy.deepcopy(complete)
            del text[section][field]
            with pytest.raises(ValidationError, match=r"Field required|Unable to extract tag"):
                Plant.model_validate(text)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("drive.kind", "amc", "kind"),
        ("drive.scheme.value", "six_step", "scheme"),
        ("drive.bus_voltage.value", 300.0, "bus_voltage"),
        ("drive.switching_period.value", 1.0, "switching_period"),
        ("drive.discharge_level.value", 16, "discharge_level"),
        ("drive.scheme_ripple.value", [1.0, 1.0, 1.0], "scheme_ripple"),
        ("drive.scheme_modulation.value", [0.7, 0.6, 0.7, 1.2], "scheme_modulation must be above"),
        ("drive.scheme_switching.value", [1.0, -1.0, 1.0, 1.0], "must be 0 to 100"),
        ("drive.supply_resistance.value", 0.01, "supply_resistance times capacitance"),
        ("surge.carriage_mass.value", 1420.0, "carriage_mass is a part of mass"),
        ("surge.drive.watchdog.value", 0.0, "watchdog"),
        ("surge.radiation.numerator.value", [1.0, 75223.0, 1.0, 1.0], "not passive"),
        ("spring.stator_share_a.value", 1.5, "stator_share_a"),
        ("basin.probe_1.x.value", 1000.0, "probe_1"),
    ],
)
def test_bad_values_of_the_custom_plant(path: str, value: Any, message: str) -> None:
    text = copy.deepcopy(mapping("wavebot_custom.yaml"))
    *sections, field = path.split(".")
    inner = text
    for section in sections:
        inner = inner[section]
    inner[field] = value
    with pytest.raises(ValidationError, match=message) as refusal:
        Plant.model_validate(text)
    assert len(refusal.value.errors()) == 1
