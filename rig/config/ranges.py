"""The allowed range of a key in words, read from the model's own constraints."""

import types
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from rig.config.model import Reason
from rig.config.problems import number_text
from rig.config.yaml_source import KeyPath

_UNITS = {
    "a": "A", "c": "C", "counts": "counts", "deg": "deg", "f": "F", "h": "H", "hz": "Hz",
    "kg": "kg", "khz": "kHz", "m": "m", "n": "N", "ohm": "ohm", "percent": "%", "rad": "rad",
    "s": "s", "v": "V", "w": "W",
    "hz2": "Hz^2", "kg2": "kg^2", "m2": "m^2", "m3": "m^3", "rad2": "rad^2", "s2": "s^2",
    "s3": "s^3", "s5": "s^5", "a2": "A^2", "v2": "V^2",
}  # fmt: skip


class Allowed(NamedTuple):
    """What a key takes."""

    annotation: Any
    metadata: tuple[object, ...]

    def description(self, key: str) -> str:
        """Range with its unit, or the list of words; empty where anything goes."""
        words = _literals(self.annotation)
        if words:
            return ", ".join(words)
        return _range(self.metadata, unit(key))

    def holds(self, value: float) -> bool:
        """Whether a number lies in the range."""
        return all(
            value >= item.ge  # type: ignore[operator]
            if isinstance(item, Ge)
            else value <= item.le  # type: ignore[operator]
            for item in self.metadata
            if isinstance(item, (Ge, Le))
        )

    def reason(self) -> str:
        """Why the range ends where it ends, if the model says so."""
        return next((m.text for m in self.metadata if isinstance(m, Reason)), "")


def allowed(model: type[BaseModel], key: Sequence[str | int]) -> Allowed | None:
    """What the model takes at ``key`` (union tags may stand in it); None for an unknown key."""
    found = [Allowed(model, ())]
    for part in key:
        found = list(_inside(found, part))
    bare = [Allowed(a, m) for c in found for a, m in _members(c.annotation, c.metadata)]
    # a list is said by the range of its entries
    entries = [get_args(c.annotation)[0] for c in bare if get_origin(c.annotation) in (tuple, list)]
    bare += [Allowed(a, m) for entry in entries for a, m in _members(entry, ())]
    for candidate in bare:
        if _range(candidate.metadata, "") or _literals(candidate.annotation):
            return candidate
    return bare[0] if bare else None


def models_at(model: type[BaseModel], key: Sequence[str | int]) -> tuple[type[BaseModel], ...]:
    """Models that may stand at ``key``."""
    found = [Allowed(model, ())]
    for part in key:
        found = list(_inside(found, part))
    return tuple(a for c in found for a, _ in _members(c.annotation, ()) if _is_model(a))


def known_keys(model: type[BaseModel]) -> tuple[str, ...]:
    """Keys of a mapping, as the file spells them."""
    return tuple(info.alias or name for name, info in model.model_fields.items())


def unit(key: str) -> str:
    """Unit said by the end of a key: kp_n_s_per_m is in N*s/m; empty if it says none."""
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


def _inside(found: Iterable[Allowed], part: str | int) -> Iterable[Allowed]:
    for candidate in found:
        members = list(_members(candidate.annotation, candidate.metadata))
        fields = [_field(m, part) for m, _ in members if _is_model(m)]
        hits = [field for field in fields if field is not None]
        if hits:
            yield from (Allowed(f.annotation, tuple(f.metadata)) for f in hits)
            continue
        tagged = [m for m, _ in members if _is_model(m) and part in _tags(m)]
        if tagged:
            yield from (Allowed(m, ()) for m in tagged)
            continue
        for member, _ in members:
            arguments = get_args(member)
            if get_origin(member) in (tuple, list) and isinstance(part, int):
                yield Allowed(arguments[0], ())
            elif get_origin(member) is dict and isinstance(part, str):
                yield Allowed(arguments[1], ())


def _field(model: Any, part: str | int) -> FieldInfo | None:
    fields: dict[str, FieldInfo] = model.model_fields
    for name, info in fields.items():
        if part == (info.alias or name):
            return info
    return None


def _members(
    annotation: Any, metadata: tuple[object, ...]
) -> Iterable[tuple[Any, tuple[object, ...]]]:
    """The annotation's alternatives, each with its constraints, wrappers taken off."""
    origin = get_origin(annotation)
    if origin is Annotated:
        inner, *more = get_args(annotation)
        yield from _members(inner, (*metadata, *_flat(more)))
    elif origin in (Union, types.UnionType):
        for member in get_args(annotation):
            yield from _members(member, metadata)
    else:
        yield annotation, metadata


def _flat(metadata: Iterable[object]) -> Iterable[object]:
    for item in metadata:
        if isinstance(item, FieldInfo):
            yield from item.metadata
        else:
            yield item


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _tags(model: Any) -> tuple[object, ...]:
    """Words that tell this model from others of a union: those of a key that takes one word."""
    fields: dict[str, FieldInfo] = model.model_fields
    return tuple(
        tag
        for info in fields.values()
        if get_origin(info.annotation) is Literal and len(get_args(info.annotation)) == 1
        for tag in get_args(info.annotation)
    )


def _literals(annotation: Any) -> tuple[str, ...]:
    return tuple(
        str(word)
        for member, _ in _members(annotation, ())
        if get_origin(member) is Literal
        for word in get_args(member)
    )


def _range(metadata: Iterable[object], in_unit: str) -> str:
    low = high = ""
    for item in metadata:
        if isinstance(item, Ge):
            low = number_text(float(item.ge))  # type: ignore[arg-type]
        elif isinstance(item, Gt):
            low = f"above {number_text(float(item.gt))}"  # type: ignore[arg-type]
        elif isinstance(item, Le):
            high = number_text(float(item.le))  # type: ignore[arg-type]
        elif isinstance(item, Lt):
            high = f"below {number_text(float(item.lt))}"  # type: ignore[arg-type]
    if low and high:
        text = f"{low} .. {high}"
    elif low:
        text = low if low.startswith("above") else f"at least {low}"
    elif high:
        text = high if high.startswith("below") else f"at most {high}"
    else:
        return ""
    return f"{text} {in_unit}".rstrip()


def last_name(key: KeyPath) -> str:
    """The last named part of a key path: whose unit counts."""
    return next((part for part in reversed(key) if isinstance(part, str)), "")
