"""Any file content gives a model or a list of problems, never another exception."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel
from random_examples import examples

from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load
from rig.config.yaml_source import load_mapping
from rig.kinds.wavebot.config import LimitsFile, RigFile
from rig.kinds.wavebot.config.campaign_file import CampaignFile

CONFIGS = Path(__file__).parents[2] / "configs"
SHIPPED: tuple[tuple[type[BaseModel], str], ...] = (
    (CampaignFile, "campaigns/default.yaml"),
    (CampaignFile, "campaigns/irregular.yaml"),
    (CampaignFile, "campaigns/recorded.yaml"),
    (CampaignFile, "campaigns/quick.yaml"),
    (RigFile, "rigs/wavebot.yaml"),
    (LimitsFile, "limits/wavebot.yaml"),
)
JUNK_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.just(10**400) | st.floats() | st.text(max_size=5)
    | st.sampled_from(["kind", "from", "regular", "mask4", -999, 1e308]),
    lambda inner: st.lists(inner, max_size=3)
    | st.dictionaries(st.sampled_from(["kind", "from", "to", "step", "x"]), inner, max_size=3),
    max_leaves=5,
)  # fmt: skip


@cache
def shipped(name: str) -> str:
    """Return the mapping of a shipped file as JSON."""
    return json.dumps(load_mapping(CONFIGS / name)[0])


def key_paths(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of all keys and list entries of nested mappings and lists."""
    parts = value.items() if isinstance(value, dict) else enumerate(value)
    paths = []
    for key, inner in parts:
        paths.append((*at, key))
        if isinstance(inner, (dict, list)):
            paths += key_paths(inner, (*at, key))
    return paths


def config_error(attempt: Callable[[], object]) -> ConfigError | None:
    try:
        attempt()
    except ConfigError as error:
        return error
    return None


@settings(max_examples=examples(300))
@given(st.data())
def test_invalid_values_are_reported_on_a_line_of_the_file(
    tmp_path_factory: Any, data: st.DataObject
) -> None:
    model, name = data.draw(st.sampled_from(SHIPPED))
    mapping = json.loads(shipped(name))
    for _ in range(data.draw(st.integers(1, 3))):
        *outer, last = data.draw(st.sampled_from(key_paths(mapping)))
        inner = mapping
        for part in outer:
            inner = inner[part]
        inner[last] = data.draw(JUNK_VALUES)
    path = tmp_path_factory.getbasetemp() / "junk.yaml"
    text = json.dumps(mapping, indent=1).replace("NaN", ".nan").replace("Infinity", ".inf")
    path.write_text(text)
    error = config_error(lambda: load(path, model))
    assert error is None or error.problems
    for problem in error.problems if error is not None else ():
        assert 1 <= problem.line <= text.count("\n") + 1
        assert json.loads(json.dumps(problem.as_dict(), allow_nan=False))


@settings(max_examples=examples(300))
@given(st.binary(max_size=40) | st.text(max_size=40).map(str.encode))
def test_any_bytes_give_a_mapping_or_problems(tmp_path_factory: Any, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "bytes.yaml"
    path.write_bytes(content)
    error = config_error(lambda: load_mapping(path))
    assert error is None or error.problems
