"""Bench plant files: the shipped ones are valid, and one bad file per rule is refused by name."""

from __future__ import annotations

import copy
import math
from typing import Any

import pytest
from bench_files import changed
from plant_files import PLANTS, mapping
from pydantic import ValidationError

from sim_plant.bench.parameters import BenchPlant

SHIPPED = sorted(path.stem for path in PLANTS.glob("oswec_bench*.yaml"))


def numbers(tree: Any) -> list[Any]:
    if isinstance(tree, tuple):
        return [leaf for item in tree for leaf in numbers(item)]
    return [tree]


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_files_are_valid_and_build_numbers(name: str) -> None:
    leaves = numbers(changed(name).build())
    assert len(leaves) > 100
    assert all(type(leaf) in (float, int) for leaf in leaves)


def test_derived_constants() -> None:
    """Stiffness as eq. 2.4 and 2.5 of the OSWEC thesis give it: 264 987 and 28 483 N m/rad."""
    params = changed().build()
    assert params.transmission.stiffness == pytest.approx(28483.0, abs=1.0)
    assert params.motor.torque_per_current == pytest.approx(18.0)
    assert params.motor.inertia == pytest.approx(0.0675)
    assert params.sensors.shaft_counts == pytest.approx(2**19 / (2 * math.pi))
    assert params.sensors.motor_counts == pytest.approx(15 * 65536 / (2 * math.pi))


BAD: list[tuple[str, Any, str]] = [
    ("drive.watchdog.value", 0.0, "watchdog"),
    ("drive.current_time_constant.value", 0.01, "current_time_constant"),
    ("velocity_loop.gain.value", -1.0, "gain"),
    ("velocity_loop.gain.unit", "rad/s", "unit"),
    ("velocity_loop.range.value", 12.0, "range"),
    ("motor.inertia.source", " ", "source"),
    ("motor.inertia.value", math.nan, "inertia"),
    ("gearbox.share_back.value", 1.5, "share_back"),
    ("transmission.half_gap.value", -0.1, "half_gap"),
    ("transmission.colour", {}, "colour"),
    ("brake.fitted.value", 2, "fitted"),
    ("brake.currents.value", [0.0, 1.0], "2 brake currents but 8 torques"),
    ("brake.currents.value", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8], "must ascend from 0"),
    ("brake.torques.value", [2.0, 1.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0], "must not fall"),
    ("load_cell.cross_talk.value", [[1.0] * 6] * 5, "cross_talk"),
    ("load_cell.bias.value", [0.0] * 5, "bias"),
    ("sensors.delay_ticks.value", 21, "delay_ticks"),
    ("weather", {}, "weather"),
]


@pytest.mark.parametrize(("path", "value", "message"), BAD)
def test_one_bad_file_per_rule(path: str, value: Any, message: str) -> None:
    text = copy.deepcopy(mapping("oswec_bench.yaml"))
    *sections, field = path.split(".")
    inner = text
    for section in sections:
        inner = inner[section]
    inner[field] = value
    with pytest.raises(ValidationError, match=message) as refusal:
        BenchPlant.model_validate(text)
    assert len(refusal.value.errors()) == 1


def test_nothing_has_a_default() -> None:
    tree = mapping("oswec_bench.yaml")
    for section in (s for s in tree if isinstance(tree[s], dict)):
        for field in tree[section]:
            text = copy.deepcopy(tree)
            del text[section][field]
            with pytest.raises(ValidationError, match="Field required"):
                BenchPlant.model_validate(text)
