"""Every number in the bench's files has a range; a value outside it is reported at its key.

`bench_ranges.yaml` holds the ranges in the form of the messages, one line per number. A test checks
that the table contains every number of the models, so that no number can be added without a range.
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

from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load

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
"""Lists of measured values; only their order is checked."""

FREE_KEYS = (
    (r"^constants[.]stiffness", "constants.*"),
    (r"^wiring[.]lines[.]\w+", "wiring.lines.*"),
)
"""Patterns of keys that a file chooses freely, and their names in a JSON schema."""


@pytest.mark.parametrize("base", BASES)
def test_base_files_are_valid(base: str, tmp_path: Path) -> None:
    model, mapping = BASES[base]
    (tmp_path / "x.yaml").write_text(json.dumps(mapping))
    load(tmp_path / "x.yaml", model)


@pytest.mark.parametrize(("base", "key", "bad", "allowed"), CASES)
def test_a_number_out_of_range_is_reported(
    base: str, key: str, bad: float, allowed: str, tmp_path: Path
) -> None:
    model, mapping = BASES[base]
    broken = deepcopy(mapping)
    *parents, last = (int(part) if part.isdigit() else part for part in re.findall(r"\w+", key))
    inner: Any = broken
    for part in parents:
        if isinstance(part, str):
            inner.setdefault(part, {})  # of a section that the file may leave out
        inner = inner[part]
    inner[last] = bad
    (tmp_path / "x.yaml").write_text(json.dumps(broken))
    with pytest.raises(ConfigError) as error_info:
        load(tmp_path / "x.yaml", model)
    reported = {problem.key: problem.message for problem in error_info.value.problems}
    assert key in reported, reported
    assert reported[key].endswith(f"is out of range; allowed {allowed}"), reported[key]


def numbers(schema: dict[str, Any], at: dict[str, Any], path: str) -> Iterator[str]:
    """Yield the key paths of all numbers in a schema; list entries are [], free keys are *.

    Choices of numbers (enum, const) are left out.
    """
    if "$ref" in at:
        at = schema["$defs"][at["$ref"].rsplit("/", 1)[-1]]
    for option in (*at.get("anyOf", ()), *at.get("oneOf", ())):
        yield from numbers(schema, option, path)
    for key, inner in at.get("properties", {}).items():
        yield from numbers(schema, inner, f"{path}.{key}" if path else key)
    if isinstance(at.get("additionalProperties"), dict):
        yield from numbers(schema, at["additionalProperties"], f"{path}.*")
    if at.get("type") == "array":
        yield from numbers(schema, at["items"], f"{path}[]")
    if at.get("type") in ("number", "integer") and not {"enum", "const"} & at.keys():
        yield path


def schema_key(key: str) -> str:
    """Return a key of the table in the form of a schema."""
    key = re.sub(r"\[\d+\]", "[]", key)
    for pattern, schema in FREE_KEYS:
        key = re.sub(pattern, schema, key)
    return key


def test_the_table_contains_every_number() -> None:
    expected, listed = set(), set()
    for base, (model, _) in BASES.items():
        model_name = model.__name__
        schema = model.model_json_schema()
        group = "constants" if base == "constants" else model_name
        expected |= {f"{group}: {path}" for path in numbers(schema, schema, "")}
        listed |= {f"{group}: {schema_key(key)}" for key in TABLE[base]}
    assert {path for path in expected if "from" not in path} - listed == UNBOUNDED
    assert listed <= expected
