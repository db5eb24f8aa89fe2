"""Layouts of a log row from its one declaration: struct format, packed bytes, ros2msg schema.

A row type is a NamedTuple of NamedTuples whose leaves are float or int with a unit
(``Annotated[float, "m"]``). Every leaf is stored as float64 or int64, little-endian: then the
packed bytes, the CDR of a ROS 2 message and a numpy record are the same bytes at any nesting. A
narrower leaf would need alignment that some readers get wrong silently, so it is refused.
"""

import re
import struct
import sys
from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from rig.realtime import tick_memory
from rig.stations import FIELD_NAME

CDR_HEADER = b"\x00\x01\x00\x00"  # little-endian CDR, no options
PACKAGE = "wec_rig"
# Numbers of 8 bytes need no padding, so on a little-endian machine the native form is the same
# bytes; it copies a float, where "<" goes through it byte by byte.
_ORDER = "@" if sys.byteorder == "little" else "<"


class Leaf(NamedTuple):
    """One number of a row."""

    path: tuple[str, ...]
    code: str  # struct code: "d" float64, "q" int64
    unit: str

    @property
    def name(self) -> str:
        """Dotted path, e.g. ``power.mechanical``."""
        return ".".join(self.path)


class RowError(TypeError):
    """A row type without a valid layout; the message names the field."""


def _fields(row_type: type, where: str = "") -> dict[str, Any]:
    names = getattr(row_type, "_fields", None)
    if not (issubclass(row_type, tuple) and names):
        at = f"{where}: " if where else ""
        raise RowError(f"{at}{row_type.__name__} is not a NamedTuple with at least one field")
    hints = get_type_hints(row_type, include_extras=True)
    return {name: hints[name] for name in names}


@lru_cache
def leaves(row_type: type) -> tuple[Leaf, ...]:
    """Return all numbers of a row type in storage order; raise RowError naming an invalid field."""
    return schema(row_type).leaves


def layout(row_type: type) -> struct.Struct:
    """Return the packed little-endian layout of a row."""
    return struct.Struct(_ORDER + "".join(leaf.code for leaf in leaves(row_type)))


def packer(row_type: type) -> Callable[[Any, int, Any], None]:
    """Return ``pack(buffer, at, row)``, which stores a row's numbers at byte ``at``."""
    leaves(row_type)  # raise for an invalid type before generating code from it
    return tick_memory.packer(tick_memory.example(row_type))


class RowSchema(NamedTuple):
    """A row as a ROS 2 message: its whole layout, for processes and files without its type."""

    name: str
    text: str  # ros2msg, with units in the comments

    @property
    def leaves(self) -> tuple[Leaf, ...]:
        """The numbers of a row in storage order; RowError or KeyError for an invalid text."""
        return _leaves_of_text(self.text)


def schema(row_type: type) -> RowSchema:
    """Return the schema of a row type; raise RowError naming a field that cannot be stored."""
    types: dict[str, type] = {}
    bodies: dict[str, str] = {}

    def define(kind: type, path: tuple[str, ...]) -> str:
        where, lines = ".".join(path), []
        fields = _fields(kind, where)
        if types.setdefault(kind.__name__, kind) is not kind:
            raise RowError(f"{where}: a second type named {kind.__name__}; a schema has one")
        for name, hint in fields.items():
            here = (*path, name)
            if not FIELD_NAME.fullmatch(name):
                raise RowError(f"{'.'.join(here)}: not a ROS field name ([a-z][a-z0-9_]*)")
            if _is_nested(hint):
                body = define(hint, here)
                bodies.setdefault(hint.__name__, body)
                lines.append(f"{PACKAGE}/{hint.__name__} {name}")
            else:
                number, unit = _number(hint, ".".join(here))
                lines.append(f"{number} {name}  # [{unit}]")
        return "\n".join(lines) + "\n"

    text = define(row_type, ())
    for name, body in bodies.items():
        text += f"{'=' * 80}\nMSG: {PACKAGE}/{name}\n{body}"
    return RowSchema(f"{PACKAGE}/msg/{row_type.__name__}", text)


def _is_nested(hint: Any) -> bool:
    return isinstance(hint, type) and issubclass(hint, tuple)


def _number(hint: Any, where: str) -> tuple[str, str]:
    """Return the ROS type and the unit of a leaf."""
    if get_origin(hint) is not Annotated:
        raise RowError(f"{where}: {hint} has no unit; write Annotated[float, unit]")
    kind, unit = get_args(hint)[:2]
    if kind not in (float, int) or not isinstance(unit, str) or not unit:
        raise RowError(f"{where}: only float and int leaves with a unit text, not {hint}")
    return ("float64" if kind is float else "int64"), unit


_SCHEMA_FIELD = re.compile(r"(?P<type>\S+) (?P<name>\S+)(?:\s+# \[(?P<unit>.*)\])?")


def _leaves_of_text(text: str) -> tuple[Leaf, ...]:
    sections = re.split(r"=+\nMSG: ", text)
    bodies = {"": sections[0]}
    for section in sections[1:]:
        name, body = section.split("\n", 1)
        bodies[name] = body

    def collect(body: str, path: tuple[str, ...]) -> list[Leaf]:
        found: list[Leaf] = []
        for line in filter(None, body.splitlines()):
            match = _SCHEMA_FIELD.fullmatch(line)
            if match is None:
                raise RowError(f"schema line not understood: {line!r}")
            here = (*path, match["name"])
            if match["type"] in ("float64", "int64"):
                code = "d" if match["type"] == "float64" else "q"
                found.append(Leaf(here, code, match["unit"] or ""))
            else:
                found += collect(bodies[match["type"]], here)
        return found

    return tuple(collect(bodies[""], ()))
