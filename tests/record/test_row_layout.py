"""Any row type has one layout: struct, numpy, CDR and schema agree."""

import keyword
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rig.recording import row_layout
from rig.recording.runs.mcap_file import row_dtype

NAMES = st.from_regex(r"[a-z](_?[a-z0-9]){0,8}", fullmatch=True).filter(
    lambda name: not keyword.iskeyword(name)
)
UNITS = st.sampled_from(["m", "N*s/m", "m/s^2", "%", "tick"])
EMPTY = get_typestore(Stores.EMPTY)


def leaf(kind: type, unit: str) -> Any:
    return Annotated[kind, unit]


@st.composite
def row_types(draw: st.DrawFn, depth: int = 3, serial: list[int] | None = None) -> Any:
    serial = [0] if serial is None else serial
    fields: list[tuple[str, Any]] = []
    for name in draw(st.lists(NAMES, min_size=1, max_size=4, unique=True)):
        nested = depth > 0 and draw(st.integers(0, 2)) == 0
        if nested:
            fields.append((name, draw(row_types(depth=depth - 1, serial=serial))))
        else:
            fields.append((name, leaf(draw(st.sampled_from([float, int])), draw(UNITS))))
    serial[0] += 1
    return NamedTuple(f"Word{serial[0]}", fields)  # type: ignore[misc]


def number(code: str) -> st.SearchStrategy[Any]:
    if code == "d":
        return st.floats(width=64, allow_nan=True)
    return st.integers(-(2**63), 2**63 - 1)


def built(row_type: Any, numbers: list[Any]) -> Any:
    hints = row_layout._fields(row_type)
    parts = [
        built(hint, numbers) if isinstance(hint, type) else numbers.pop(0)
        for hint in hints.values()
    ]
    return row_type(*parts)


def as_message(store: Any, row: Any, hint: type) -> Any:
    """Return the row as an object of the ROS type that its own schema declares."""
    hints = row_layout._fields(hint)
    values = [
        as_message(store, value, inner) if isinstance(inner, type) else value
        for value, inner in zip(row, hints.values(), strict=True)
    ]
    return store.types[row_layout.schema(hint).name](*values)


@settings(max_examples=examples(50))
@given(st.data())
def test_all_layouts_agree(data: st.DataObject) -> None:
    row_type = data.draw(row_types())
    leaves = row_layout.leaves(row_type)
    numbers = [data.draw(number(each.code)) for each in leaves]
    row = built(row_type, list(numbers))
    packed = bytearray(row_layout.layout(row_type).size)
    row_layout.packer(row_type)(packed, 0, row)

    assert len(packed) == 8 * len(leaves)
    assert np.array([tuple(numbers)], row_dtype(leaves)).tobytes() == packed
    # An independent encoder that gets the schema alone.
    store = get_typestore(Stores.EMPTY)
    name, text = row_layout.schema(row_type)
    store.register(get_types_from_msg(text, name))
    encoded = store.serialize_cdr(as_message(store, row, row_type), name)
    assert bytes(encoded) == row_layout.CDR_HEADER + packed


@settings(max_examples=examples(50))
@given(row_types())
def test_the_schema_gives_the_layout(row_type: Any) -> None:
    assert row_layout.schema(row_type).leaves == row_layout.leaves(row_type)


def refused(hint: Any, name: str = "value") -> str:
    row_type = NamedTuple("Refused", [("tick", Annotated[int, "tick"]), (name, hint)])  # type: ignore[misc]
    with pytest.raises(row_layout.RowError) as caught:
        row_layout.leaves(row_type)
    return str(caught.value)


class Inner(NamedTuple):
    flag: Annotated[bool, "flag"]


@pytest.mark.parametrize(
    "hint",
    [
        Annotated[bool, "flag"],
        Annotated[str, "text"],
        Annotated[tuple[float, ...], "m"],
        Annotated[float, ""],
        float,
        Annotated[np.float32, "m"],
    ],
    ids=str,
)
def test_other_leaves_are_refused_by_name(hint: Any) -> None:
    assert refused(hint).startswith("value: ")


def test_a_nested_leaf_is_named_by_its_path() -> None:
    assert refused(Inner).startswith("value.flag: only float and int leaves")


class Empty(NamedTuple):
    pass


def test_an_empty_tuple_is_refused() -> None:
    with pytest.raises(
        row_layout.RowError, match="Empty is not a NamedTuple with at least one field"
    ):
        row_layout.leaves(Empty)
    assert "at least one field" in refused(Empty)


@pytest.mark.parametrize("name", ["Upper", "two__scores", "trailing_", "dänisch"])
def test_invalid_ros_names_are_refused(name: str) -> None:
    assert refused(Annotated[float, "m"], name) == f"{name}: not a ROS field name ([a-z][a-z0-9_]*)"
