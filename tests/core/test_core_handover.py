"""Parameters from the supervisor to the loop: equal bit by bit, or an error with the place."""

from __future__ import annotations

import json
import math
import struct
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import pytest
from core_kinds import BenchParams, PairParams
from core_runs import bench_params
from core_wavebot import params
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from rig.kinds.wavebot import tick as wavebot
from rig.processes import handover
from rig.processes.handover import HandoverError
from rig.processes.messages import LoopJob
from rig.realtime import cycle

FLOATS = st.floats(allow_nan=False) | st.sampled_from([-0.0, 5e-324, -2.2e-308, 1e308, 0.1])


WAVEBOT_TYPES = {"rig": wavebot.Params, **dict(wavebot.KIND.any_types)}


def values(hint: Any, types: dict[str, Any], name: str = "") -> st.SearchStrategy[Any]:
    """Return a strategy for any value of a parameter type; ``types`` are those of `Any` fields."""
    if hint is Any:
        hint = types[name]
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    if hint is float:
        return FLOATS
    if hint is int:
        return st.integers(-(2**63), 2**63)
    if hint is str:
        return st.text()
    if get_origin(hint) is tuple:
        return st.lists(values(get_args(hint)[0], types), max_size=4).map(tuple)
    hints = get_type_hints(hint, include_extras=True)
    fields = (values(hints[name], types, name) for name in hint._fields)
    return st.tuples(*fields).map(lambda v: hint(*v))


def bits(value: Any) -> Any:
    """Return a value with every float as its bytes and every type by name."""
    if isinstance(value, float):
        return "float", struct.pack("<d", value)
    if isinstance(value, tuple):
        return type(value).__name__, [bits(part) for part in value]
    return type(value).__name__, value


@pytest.mark.parametrize("rig", [wavebot.Params, BenchParams, PairParams])
@settings(max_examples=examples(20))
@given(data=st.data())
def test_any_parameters_are_restored_bit_by_bit(rig: Any, data: Any) -> None:
    types = WAVEBOT_TYPES | {"rig": rig}
    value = data.draw(values(cycle.Params, types))
    assert bits(handover.loads(cycle.Params, handover.dumps(value), **types)) == bits(value)


def test_the_shipped_parameters_and_a_job_are_restored() -> None:
    restored = params()
    second = handover.loads(cycle.Params, handover.dumps(restored), **WAVEBOT_TYPES)
    assert bits(second) == bits(restored)
    job = LoopJob(True, False, 0.001, 3, 4, 5, restored, {"seed": 1}, 1.0)
    assert bits(handover.loads(LoopJob, handover.dumps(job), **WAVEBOT_TYPES)) == bits(job)


def integers_for_floats(value: Any) -> Any:
    """Return the value with every whole-number float written as an int."""
    if isinstance(value, tuple):
        return [integers_for_floats(part) for part in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def test_a_float_written_as_an_int_is_restored_as_a_float() -> None:
    restored = bench_params()
    text = json.dumps(integers_for_floats(restored))
    assert text != handover.dumps(restored)
    assert bits(handover.loads(cycle.Params, text, rig=BenchParams)) == bits(restored)


@pytest.mark.parametrize("odd", [math.inf, -math.inf, math.nan])
def test_values_that_are_not_finite_pass_unchanged(odd: float) -> None:
    """The configuration must refuse such values; the handover must not turn them into numbers."""
    back = handover.loads(Inner, handover.dumps(Inner(odd, 1, ())))
    assert struct.pack("d", back.a) == struct.pack("d", odd)


class Inner(NamedTuple):
    a: float
    b: int
    c: tuple[float, ...]


class Outer(NamedTuple):
    field: Inner
    name: str


class Union(NamedTuple):
    a: float | None


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ('[["x", 1, []], "n"]', "Outer.field.a"),
        ("[[true, 1, []], 2]", "Outer.field.a"),
        ("[[null, 1, []], 2]", "Outer.field.a"),
        ('[[1.0, 1.0, []], "n"]', "Outer.field.b"),
        ('[[1.0, true, []], "n"]', "Outer.field.b"),
        ('[[1.0, 1, 5], "n"]', "Outer.field.c"),
        ('[[1.0, 1, [0.5, "x"]], "n"]', r"Outer.field.c\[1\]"),
        ('[[1.0, 1], "n"]', "Outer.field"),
        ('[[1.0, 1, [], 4], "n"]', "Outer.field"),
        ('[{"a": 1}, "n"]', "Outer.field"),
        ("[[1.0, 1, []], 7]", "Outer.name"),
        ("[]", "Outer"),
        ("3", "Outer"),
    ],
)
def test_an_invalid_field_is_named(text: str, where: str) -> None:
    with pytest.raises(HandoverError, match=rf"^{where}: "):
        handover.loads(Outer, text)


def test_a_union_is_refused() -> None:
    with pytest.raises(HandoverError, match=r"^Union.a: unions"):
        handover.loads(Union, "[1.0]")


def test_a_truncated_text_is_refused() -> None:
    text = handover.dumps(bench_params())
    with pytest.raises(ValueError, match="Expecting"):
        handover.loads(cycle.Params, text[:-20], rig=BenchParams)
