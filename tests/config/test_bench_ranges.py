"""Every number in the bench's files has a range, and a file beyond it is refused at its place.

`bench_ranges.yaml` holds the ranges as a person reads them, one line a number; that it names every
number of the models is tested too, so none can be added without its range.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from bench_bases import BASES
from ruamel.yaml import YAML

from rig.config import ConfigError, load

TABLE = YAML(typ="safe", pure=True).load(Path(__file__).with_name("bench_ranges.yaml"))
CASES = [
    pytest.param(base, key, bad, allowed, id=f"{base} {key} {bad:g}")
    for base, keys in TABLE.items()
    for key, (allowed, *values) in keys.items()
    for bad in values
]
UNBOUNDED = {
    "constants: brake_map.falling.current_a[]",
    "constants: brake_map.falling.torque_n_m[]",
    "constants: brake_map.falling.uncertainty_n_m[]",
    "constants: brake_map.rising.current_a[]",
    "constants: brake_map.rising.torque_n_m[]",
    "constants: brake_map.rising.uncertainty_n_m[]",
    "constants: deflection_map.deflection_deg[]",
    "constants: deflection_map.torque_n_m[]",
}
"""Lists of measured values, which are checked for their order only."""

FREE = ((r"^constants[.]stiffness", "constants.*"), (r"^wiring[.]lines[.]\w+", "wiring.lines.*"))
"""Keys that a file names itself, and how a schema calls them."""


@pytest.mark.parametrize("base", BASES)
def test_the_base(base: str, tmp_path: Path) -> None:
    model, mapping = BASES[base]
    (tmp_path / "x.yaml").write_text(json.dumps(mapping))
    load(tmp_path / "x.yaml", model)


@pytest.mark.parametrize(("base", "key", "bad", "allowed"), CASES)
def test_a_number_out_of_its_range(
    base: str, key: str, bad: float, allowed: str, tmp_path: Path
) -> None:
    model, mapping = BASES[base]
    broken = deepcopy(mapping)
    *way, last = (int(part) if part.isdigit() else part for part in re.findall(r"\w+", key))
    inner: Any = broken
    for part in way:
        inner = inner[part]
    inner[last] = bad
    (tmp_path / "x.yaml").write_text(json.dumps(broken))
    with pytest.raises(ConfigError) as caught:
        load(tmp_path / "x.yaml", model)
    told = {problem.key: problem.message for problem in caught.value.problems}
    assert key in told, told
    assert told[key].endswith(f"is out of range; allowed {allowed}"), told[key]


def numbers(schema: dict[str, Any], at: dict[str, Any], path: str) -> Iterator[str]:
    """Places of all numbers in a schema: lists end in [], free keys are *; no choice of numbers."""
    if "$ref" in at:
        at = schema["$defs"][at["$ref"].rsplit("/", 1)[-1]]
    for one in (*at.get("anyOf", ()), *at.get("oneOf", ())):
        yield from numbers(schema, one, path)
    for key, inner in at.get("properties", {}).items():
        yield from numbers(schema, inner, f"{path}.{key}" if path else key)
    if isinstance(at.get("additionalProperties"), dict):
        yield from numbers(schema, at["additionalProperties"], f"{path}.*")
    if at.get("type") == "array":
        yield from numbers(schema, at["items"], f"{path}[]")
    if at.get("type") in ("number", "integer") and not {"enum", "const"} & at.keys():
        yield path


def named(key: str) -> str:
    """A key of the table as a schema has it."""
    key = re.sub(r"\[\d+\]", "[]", key)
    for free, schema in FREE:
        key = re.sub(free, schema, key)
    return key


def test_the_table_names_every_number() -> None:
    wanted, told = set(), set()
    for base, (model, _) in BASES.items():
        kind = model.__name__
        schema = model.model_json_schema()
        group = "constants" if base == "constants" else kind
        wanted |= {f"{group}: {path}" for path in numbers(schema, schema, "")}
        told |= {f"{group}: {named(key)}" for key in TABLE[base]}
    assert {path for path in wanted if "from" not in path} - told == UNBOUNDED
    assert told <= wanted
