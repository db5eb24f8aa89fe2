"""Text for the allowed values of a key, generated from the constraints of its model."""

import types
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel, Tag
from pydantic.fields import FieldInfo

from rig.config.model import Reason
from rig.config.problems import format_number
from rig.config.yaml_source import KeyPath

_UNITS = {
    "a": "A", "c": "C", "counts": "counts", "deg": "deg", "f": "F", "h": "H", "hz": "Hz",
    "kg": "kg", "khz": "kHz", "m": "m", "n": "N", "ohm": "ohm", "percent": "%", "rad": "rad",
    "s": "s", "v": "V", "w": "W",
    "hz2": "Hz^2", "kg2": "kg^2", "m2": "m^2", "m3": "m^3", "rad2": "rad^2", "s2": "s^2",
    "s3": "s^3", "s5": "s^5", "a2": "A^2", "v2": "V^2",
}  # fmt: skip


class AllowedValues(NamedTuple):
    """The values that a key allows, by its annotation and constraints."""

    annotation: Any
    metadata: tuple[object, ...]

    def description(self, key: str) -> str:
        """Return the range with its unit, or the list of choices; empty without constraints."""
        choices = _literals(self.annotation)
        if choices:
            return ", ".join(choices)
        return _format_range(self.metadata, unit_of_key(key))

    def contains(self, value: float) -> bool:
        """Return whether a number lies in the range."""
        return all(
            value >= item.ge  # type: ignore[operator]
            if isinstance(item, Ge)
            else value <= item.le  # type: ignore[operator]
            for item in self.metadata
            if isinstance(item, (Ge, Le))
        )

    def reason(self) -> str:
        """Return the reason for the limits of the range; empty if the model has none."""
        return next((m.text for m in self.metadata if isinstance(m, Reason)), "")


def allowed_values(model: type[BaseModel], key: Sequence[str | int]) -> AllowedValues | None:
    """Return the allowed values of a key, which may contain union tags; None if unknown."""
    candidates = [AllowedValues(model, ())]
    for part in key:
        candidates = list(_descend(candidates, part))
    members = [
        AllowedValues(a, m) for c in candidates for a, m in _members(c.annotation, c.metadata)
    ]
    # the range of a list is the range of its entries
    entries = [
        get_args(c.annotation)[0] for c in members if get_origin(c.annotation) in (tuple, list)
    ]
    members += [AllowedValues(a, m) for entry in entries for a, m in _members(entry, ())]
    for member in members:
        if _format_range(member.metadata, "") or _literals(member.annotation):
            return member
    return members[0] if members else None


def models_at(model: type[BaseModel], key: Sequence[str | int]) -> tuple[type[BaseModel], ...]:
    """Return the models that a key allows."""
    candidates = [AllowedValues(model, ())]
    for part in key:
        candidates = list(_descend(candidates, part))
    return tuple(a for c in candidates for a, _ in _members(c.annotation, ()) if _is_model(a))


def unit_of_key(key: str) -> str:
    """Return the unit in the suffix of a key: N*s/m for kp_n_s_per_m; empty without a unit."""
    parts = key.split("_")
    start = len(parts)
    while start > 1 and (parts[start - 1] in _UNITS or parts[start - 1] == "per"):
        start -= 1
    above, _, below = " ".join(parts[start:]).partition(" per ")
    if not above or above.split()[0] == "per":
        return ""
    text = "*".join(_UNITS[part] for part in above.split())
    for part in below.replace(" per ", " ").split():
        text += f"/{_UNITS[part]}"
    return text


def _descend(candidates: Iterable[AllowedValues], part: str | int) -> Iterable[AllowedValues]:
    """Yield the allowed values one level down a key path, for each candidate."""
    for candidate in candidates:
        members = list(_members(candidate.annotation, candidate.metadata))
        fields = [_field(m, part) for m, _ in members if _is_model(m)]
        matches = [field for field in fields if field is not None]
        if matches:
            yield from (AllowedValues(f.annotation, tuple(f.metadata)) for f in matches)
            continue
        tagged = [
            AllowedValues(m, meta)
            for m, meta in members
            if part in (*(_tags(m) if _is_model(m) else ()), *_given(meta))
        ]
        if tagged:
            yield from tagged
            continue
        for member, _ in members:
            arguments = get_args(member)
            if get_origin(member) in (tuple, list) and isinstance(part, int):
                # A tuple of fixed length has a type for each place, others one for all entries.
                fixed = len(arguments) > part and Ellipsis not in arguments
                yield AllowedValues(arguments[part if fixed else 0], ())
            elif get_origin(member) is dict and isinstance(part, str):
                yield AllowedValues(arguments[1], ())


def _field(model: Any, part: str | int) -> FieldInfo | None:
    fields: dict[str, FieldInfo] = model.model_fields
    for name, info in fields.items():
        if part == (info.alias or name):
            return info
    return None


def _members(
    annotation: Any, metadata: tuple[object, ...]
) -> Iterable[tuple[Any, tuple[object, ...]]]:
    """Yield the members of a union, each with its constraints and without `Annotated`."""
    origin = get_origin(annotation)
    if origin is Annotated:
        inner, *more = get_args(annotation)
        yield from _members(inner, (*metadata, *_flatten(more)))
    elif origin in (Union, types.UnionType):
        for member in get_args(annotation):
            yield from _members(member, metadata)
    else:
        yield annotation, metadata


def _flatten(metadata: Iterable[object]) -> Iterable[object]:
    for item in metadata:
        if isinstance(item, FieldInfo):
            yield from item.metadata
        else:
            yield item


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _tags(model: Any) -> tuple[object, ...]:
    """Return the tags that identify a model in a union: its literals with a single choice."""
    fields: dict[str, FieldInfo] = model.model_fields
    return tuple(
        tag
        for info in fields.values()
        if get_origin(info.annotation) is Literal and len(get_args(info.annotation)) == 1
        for tag in get_args(info.annotation)
    )


def _given(metadata: Iterable[object]) -> tuple[object, ...]:
    """Return the tags that a union gives to one of its members."""
    return tuple(item.tag for item in metadata if isinstance(item, Tag))


def _literals(annotation: Any) -> tuple[str, ...]:
    return tuple(
        str(choice)
        for member, _ in _members(annotation, ())
        if get_origin(member) is Literal
        for choice in get_args(member)
    )


def _format_range(metadata: Iterable[object], unit: str) -> str:
    low = high = ""
    for item in metadata:
        if isinstance(item, Ge):
            low = format_number(float(item.ge))  # type: ignore[arg-type]
        elif isinstance(item, Gt):
            low = f"above {format_number(float(item.gt))}"  # type: ignore[arg-type]
        elif isinstance(item, Le):
            high = format_number(float(item.le))  # type: ignore[arg-type]
        elif isinstance(item, Lt):
            high = f"below {format_number(float(item.lt))}"  # type: ignore[arg-type]
    if low and high:
        text = f"{low} .. {high}"
    elif low:
        text = low if low.startswith("above") else f"at least {low}"
    elif high:
        text = high if high.startswith("below") else f"at most {high}"
    else:
        return ""
    return f"{text} {unit}".rstrip()


def last_named_part(key: KeyPath) -> str:
    """Return the last part of a key path that is not an index; its suffix holds the unit."""
    return next((part for part in reversed(key) if isinstance(part, str)), "")
