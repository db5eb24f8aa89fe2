"""One declaration, many layouts: leaves, struct bytes and schema agree."""

from __future__ import annotations

import inspect
import itertools
import keyword
import math
import struct
from typing import Annotated, Any, NamedTuple, get_type_hints

import pytest
from core_kinds import BenchRow, PairRow
from core_runs import unflatten
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from controllers import signals
from rig.kinds.wavebot import tick as wavebot
from rig.kinds.wavebot.tick import WaveBotRow
from rig.recording.row_layout import (
    RowError,
    RowSchema,
    layout,
    leaves,
    packer,
    schema,
)

ROWS = (WaveBotRow, BenchRow, PairRow)
_number = itertools.count()

Metre = Annotated[float, "m"]


def flatten(value: Any) -> list[float | int]:
    """Return the numbers of a row by recursion."""
    if isinstance(value, tuple):
        return [number for part in value for number in flatten(part)]
    return [value]


def named_tuple(fields: list[tuple[str, Any]]) -> Any:
    row_type: Any = NamedTuple(f"Word{next(_number)}", fields)
    return row_type


FIELD = st.from_regex(r"[a-z](_?[a-z0-9]){0,6}", fullmatch=True).filter(
    lambda n: not keyword.iskeyword(n)
)
UNIT = st.sampled_from(["m", "N*s/m", "%", "1", "m/s^2", "a [b] c"])
LEAF = st.builds(lambda kind, unit: Annotated[kind, unit], st.sampled_from([float, int]), UNIT)


def tuples(below: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    fields = st.lists(st.tuples(FIELD, below), min_size=1, max_size=4, unique_by=lambda f: f[0])
    return fields.map(named_tuple)


ROW_TYPES = tuples(st.recursive(LEAF, tuples, max_leaves=12))


def packed_row(row_type: Any, row: Any) -> bytes:
    """Return the row's bytes, stored between bytes that must not change."""
    size = layout(row_type).size
    buffer = bytearray(b"\xaa" * (size + 16))
    packer(row_type)(buffer, 8, row)
    assert buffer[:8] == buffer[-8:] == b"\xaa" * 8
    return bytes(buffer[8:-8])


@settings(max_examples=examples(80))
@given(ROW_TYPES, st.data())
def test_any_nested_type_is_laid_out_the_same_everywhere(row_type: Any, data: Any) -> None:
    found = leaves(row_type)
    number = {
        "d": st.floats(allow_nan=False),
        "q": st.integers(-(2**63), 2**63 - 1),
    }
    values = [data.draw(number[leaf.code]) for leaf in found]
    row = unflatten(row_type, values)
    assert values == flatten(row)
    packed = packed_row(row_type, row)
    assert packed == b"".join(
        struct.pack("<" + leaf.code, value) for leaf, value in zip(found, values, strict=True)
    )
    assert layout(row_type).size == 8 * len(found)
    for leaf, value in zip(found, values, strict=True):
        part: Any = row
        for name in leaf.path:
            part = getattr(part, name)
        assert part == value
        assert leaf.name == ".".join(leaf.path)
    assert schema(row_type).leaves == found


@pytest.mark.parametrize("row_type", ROWS)
def test_every_field_of_a_row_has_a_unit_in_the_schema(row_type: Any) -> None:
    found = leaves(row_type)
    assert all(leaf.unit for leaf in found)
    assert len({leaf.name for leaf in found}) == len(found)
    assert schema(row_type).leaves == found
    row = unflatten(row_type, range(len(found)))
    as_read = layout(row_type).unpack(packed_row(row_type, row))
    assert as_read == tuple(range(len(found)))
    assert found[0].name == "tick"
    assert found[-1].name == "tick_end"
    assert found[0].code == found[-1].code == "q"
    assert schema(row_type).name == f"wec_rig/msg/{row_type.__name__}"


def test_the_wavebot_row_has_the_fields_of_the_analysis() -> None:
    units = {leaf.name: leaf.unit for leaf in leaves(WaveBotRow)}
    assert units["heave.estimate.velocity"] == "m/s"
    assert units["heave.demand.force"] == units["heave.command.force"] == "N"
    assert units["heave.sense.counts"] == "count"
    assert units["heave.command.limited"] == "flag"
    assert units["timing.lateness"] == units["timing.work"] == "s"
    assert units["power.mean_mechanical_1"] == units["power_sense.dc"] == "W"
    assert {"plan.row", "plan.phase", "plan.attempt", "safety.mode", "safety.reason"} <= set(units)
    assert {f"{name}.age" for name in ("load", "spring_sense", "power_sense")} <= set(units)


def test_every_signal_of_the_loop_has_a_unit() -> None:
    types = [
        kind
        for kind in vars(signals).values()
        if inspect.isclass(kind) and issubclass(kind, tuple) and hasattr(kind, "_fields")
    ]
    assert {signal_type.__name__ for signal_type in types} >= {
        "AxisSense",
        "Estimate",
        "Demand",
        "AxisCommand",
    }
    for signal_type in (*types, wavebot.Sense, wavebot.Command):
        for name, hint in get_type_hints(signal_type, include_extras=True).items():
            assert hasattr(hint, "_fields") or hint.__metadata__[0], (
                f"{signal_type.__name__}.{name}"
            )
        leaves(signal_type)


@pytest.mark.parametrize(
    ("hint", "message"),
    [
        (float, "has no unit"),
        (int, "has no unit"),
        (Annotated[bool, "flag"], "only float and int"),
        (Annotated[str, "text"], "only float and int"),
        (Annotated[float, ""], "unit text"),
        (Annotated[float, 3], "unit text"),
        (Annotated[tuple[float, float], "m"], "only float and int"),
        (tuple[float, float], "has no unit"),
        (list[float], "has no unit"),
        (float | None, "has no unit"),
        (tuple, "not a NamedTuple"),
        (NamedTuple("Nothing", []), "at least one field"),
    ],
)
def test_an_invalid_leaf_is_refused_by_name(hint: Any, message: str) -> None:
    outer = named_tuple([("tick", Metre), ("inner", named_tuple([("odd", hint)]))])
    for use in (leaves, layout, packer, schema):
        with pytest.raises(RowError, match=message) as caught:
            use(outer)
        assert str(caught.value).startswith("inner.odd: ")


@pytest.mark.parametrize("name", ["Upper", "two__scores", "tail_", "größe", "camelCase"])
def test_a_field_without_a_ros_name_is_refused(name: str) -> None:
    outer = named_tuple([("inner", named_tuple([(name, Metre)]))])
    with pytest.raises(RowError, match=f"^inner.{name}: not a ROS field name"):
        leaves(outer)


def test_a_type_other_than_a_named_tuple_is_refused() -> None:
    with pytest.raises(RowError, match=r"^int is not a NamedTuple"):
        leaves(int)


def test_two_types_of_one_name_are_refused() -> None:
    """A schema defines a type name once: the second type would be read with the first layout."""
    one, two = NamedTuple("Same", [("a", Metre)]), NamedTuple("Same", [("b", Metre)])
    with pytest.raises(RowError, match=r"^y: a second type named Same"):
        leaves(named_tuple([("x", one), ("y", two)]))
    assert len(leaves(named_tuple([("x", one), ("y", one)]))) == 2


def test_a_foreign_schema_line_is_refused() -> None:
    with pytest.raises(RowError, match="not understood"):
        _ = RowSchema("", "float64\n").leaves


def test_floats_are_stored_bit_by_bit() -> None:
    odd = (math.nan, -0.0, 5e-324, math.inf, -math.inf, 1.7976931348623157e308)
    kind = named_tuple([(f"f{i}", Metre) for i in range(len(odd))])
    back = layout(kind).unpack(packed_row(kind, kind(*odd)))
    assert [struct.pack("d", x) for x in back] == [struct.pack("d", x) for x in odd]
