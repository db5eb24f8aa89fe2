"""Parameters from the supervisor to the loop: the same to the bit, or an error that says where."""

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

from rig.kinds import wavebot
from rig.processes import handover
from rig.processes.handover import HandoverError
from rig.processes.loop_process import Job
from rig.realtime import cycle

FLOATS = st.floats(allow_nan=False) | st.sampled_from([-0.0, 5e-324, -2.2e-308, 1e308, 0.1])


def values(hint: Any, rig: Any) -> st.SearchStrategy[Any]:
    """Any value of a parameter type."""
    if hint is Any:
        hint = rig
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    if hint is float:
        return FLOATS
    if hint is int:
        return st.integers(-(2**63), 2**63)
    if hint is str:
        return st.text()
    if get_origin(hint) is tuple:
        return st.lists(values(get_args(hint)[0], rig), max_size=4).map(tuple)
    hints = get_type_hints(hint, include_extras=True)
    return st.tuples(*(values(hints[name], rig) for name in hint._fields)).map(lambda v: hint(*v))


def bits(value: Any) -> Any:
    """A value with every float as its bytes and every type named."""
    if isinstance(value, float):
        return "float", struct.pack("<d", value)
    if isinstance(value, tuple):
        return type(value).__name__, [bits(part) for part in value]
    return type(value).__name__, value


@pytest.mark.parametrize("rig", [wavebot.Params, BenchParams, PairParams])
@settings(max_examples=20, deadline=None)
@given(data=st.data())
def test_any_parameters_come_back_to_the_bit(rig: Any, data: Any) -> None:
    value = data.draw(values(cycle.Params, rig))
    assert bits(handover.loads(cycle.Params, handover.dumps(value), rig=rig)) == bits(value)


def test_the_shipped_parameters_and_a_job_come_back() -> None:
    made = params()
    again = handover.loads(cycle.Params, handover.dumps(made), rig=wavebot.Params)
    assert bits(again) == bits(made)
    job = Job(1, 0, 0.001, 3, 4, 5, made, json.dumps({"seed": 1}), 1.0)
    assert bits(handover.loads(Job, handover.dumps(job), rig=wavebot.Params)) == bits(job)


def whole(value: Any) -> Any:
    """The same with every float that is a whole number written as an int."""
    if isinstance(value, tuple):
        return [whole(part) for part in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def test_a_float_written_as_an_int_comes_back_as_a_float() -> None:
    made = bench_params()
    text = json.dumps(whole(made))
    assert text != handover.dumps(made)
    assert bits(handover.loads(cycle.Params, text, rig=BenchParams)) == bits(made)


@pytest.mark.parametrize("odd", [math.inf, -math.inf, math.nan])
def test_no_number_passes_unchanged(odd: float) -> None:
    """It is the configuration's task to refuse it; here nothing may turn it into a number."""
    back = handover.loads(Word, handover.dumps(Word(odd, 1, ())))
    assert struct.pack("d", back.a) == struct.pack("d", odd)


class Word(NamedTuple):
    a: float
    b: int
    c: tuple[float, ...]


class Outer(NamedTuple):
    word: Word
    name: str


class Union(NamedTuple):
    a: float | None


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ('[["x", 1, []], "n"]', "Outer.word.a"),
        ("[[true, 1, []], 2]", "Outer.word.a"),
        ("[[null, 1, []], 2]", "Outer.word.a"),
        ('[[1.0, 1.0, []], "n"]', "Outer.word.b"),
        ('[[1.0, true, []], "n"]', "Outer.word.b"),
        ('[[1.0, 1, 5], "n"]', "Outer.word.c"),
        ('[[1.0, 1, [0.5, "x"]], "n"]', r"Outer.word.c\[1\]"),
        ('[[1.0, 1], "n"]', "Outer.word"),
        ('[[1.0, 1, [], 4], "n"]', "Outer.word"),
        ('[{"a": 1}, "n"]', "Outer.word"),
        ("[[1.0, 1, []], 7]", "Outer.name"),
        ("[]", "Outer"),
        ("3", "Outer"),
    ],
)
def test_what_does_not_fit_is_named(text: str, where: str) -> None:
    with pytest.raises(HandoverError, match=rf"^{where}: "):
        handover.loads(Outer, text)


def test_a_union_is_refused() -> None:
    with pytest.raises(HandoverError, match=r"^Union.a: unions"):
        handover.loads(Union, "[1.0]")


def test_a_truncated_text_is_refused() -> None:
    text = handover.dumps(bench_params())
    with pytest.raises(ValueError, match="Expecting"):
        handover.loads(cycle.Params, text[:-20], rig=BenchParams)
