"""The pages of YAML keys: each key of each kind of file, from the models that check the files."""

import inspect
import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from docs.generate.markdown import cell, code, sentence, table
from docs.generate.meanings import meanings, type_meanings
from rig.config import ranges
from rig.config.calibration_file import CalibrationFile
from rig.config.matrix import MatrixColumns
from rig.config.problems import format_number
from rig.config.uncertainty import UncertaintyBudget
from rig.config.wiring import Wiring
from rig.execution.fault_table import FaultTableFile
from rig.kinds import registry
from rig.kinds.wavebot.config import columns
from sim_plant.modes.parameters import Plant

Model = type[BaseModel]


class FileKind(NamedTuple):
    """A kind of file, the models that check it, and a sentence about it."""

    title: str
    models: dict[str, Model]  # by kind of rig; one without a name for a file of all kinds
    text: str


def _by_kind(room: str, name: str, kinds: tuple[str, ...]) -> dict[str, Model]:
    return {kind: getattr(registry.find(kind).room(room), name) for kind in kinds}


def _models_in(annotation: Any) -> Iterator[Model]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for each in get_args(annotation):
        yield from _models_in(each)


def _wirings(kinds: tuple[str, ...]) -> dict[str, Model]:
    """Return the model of the section `wiring` in the rig files of each kind."""
    rigs = _by_kind("config", "RigFile", kinds)
    return {
        kind: next(_models_in(rig.model_fields["wiring"].annotation)) for kind, rig in rigs.items()
    }


def _is_wiring(model: type) -> bool:
    return issubclass(model, Wiring)


KINDS = tuple(registry.OWN_PACKAGES)
CAMPAIGNS = ("wavebot", "modular")
FILES = {
    "campaign": FileKind(
        "Campaign files",
        _by_kind("tasks", "TaskFile", CAMPAIGNS),
        "A campaign is a gain matrix, a sea and a rig. `rig check FILE` checks it.",
    ),
    "session": FileKind(
        "Session files",
        _by_kind("tasks", "TaskFile", ("oswec bench",)),
        "A session of the OSWEC bench: its kind, its set points and its analysis.",
    ),
    "rig": FileKind(
        "Rig files",
        _by_kind("config", "RigFile", KINDS),
        "A rig: its axes and sensors, its loop, and the files of its limits and its plant.",
    ),
    "wiring": FileKind(
        "Wiring",
        _wirings(KINDS),
        "The section `wiring` of a rig file: buses, drives, sensors and terminals. A rig without "
        "it can be rehearsed only.",
    ),
    "limits": FileKind(
        "Limits files",
        _by_kind("config", "LimitsFile", KINDS),
        "The limits of a rig. No limit has a default: `rig check` refuses a file without one.",
    ),
    "faults": FileKind(
        "Fault tables",
        {"": FaultTableFile},
        "Faults of a rig's emulated devices, with the required reactions; `rig faults` rehearses "
        "them.",
    ),
    "plant": FileKind(
        "Plant files",
        {"": Plant},
        "The simulated plant of a rig of kind `modular`. A number may have unit and source: "
        "`{value: 253.36, unit: N/m, source: free decay}`.",
    ),
    "calibration": FileKind(
        "Calibration files",
        {"": CalibrationFile},
        "A versioned correction of recorded values; `rig calibration` lists and compares them.",
    ),
    "uncertainty": FileKind(
        "Uncertainty budgets",
        {"": UncertaintyBudget},
        "Sources of systematic uncertainty, which the intervals of the results include.",
    ),
}


def page(name: str) -> str:
    """Return the page of a kind of file."""
    kind = FILES[name]
    parts = [f"# {kind.title}\n\n{kind.text}\n"]
    parts.append("\nKeys without a default are required. Unknown keys are errors.\n")
    seen: set[Model] = set()
    for rig_kind, model in kind.models.items():
        title = f"Kind `{rig_kind}`" if rig_kind else "Keys"
        for each in _reached(model):
            if each in seen or (_is_wiring(each) and name != "wiring"):
                continue
            seen.add(each)
            heading = f"## {title}" if each is model else f"### {_label(each)}"
            parts.append(_section(heading, each, name))
    return "".join(parts)


def index() -> str:
    """Return the page that lists the kinds of files."""
    rows = ([f"[{each.title}]({name}.md)", each.text] for name, each in FILES.items())
    return (
        "# YAML files\n\nThe keys below are those of the models that check the files, with unit, "
        "allowed range and default.\n\n" + table(["file", "content"], rows)
    )


def keys_without_meaning() -> dict[str, list[str]]:
    """Return the keys that have no meaning in their model, by the model's name."""
    found: dict[str, list[str]] = {}
    for kind in FILES.values():
        for model in kind.models.values():
            for each in _reached(model):
                if missing := keys_without_meaning_of(each):
                    found[f"{each.__module__}.{each.__qualname__}"] = missing
    return found


def keys_without_meaning_of(model: Model) -> list[str]:
    """Return the keys of a mapping that have no meaning in its model."""
    texts = meanings(model)
    return [
        name for name, info in model.model_fields.items() if not _meaning(info, texts.get(name, ""))
    ]


def _meaning(info: FieldInfo, text: str) -> str:
    """Return the meaning of a key: its own text, or that of the mapping below it."""
    if text or info.description:
        return sentence(text or info.description)
    if _selects(info):
        return "Selects this mapping."
    below = list(dict.fromkeys(_models_in(info.annotation)))
    if len(below) != 1:
        return ""
    return sentence(inspect.cleandoc(below[0].__doc__ or "").partition("\n\n")[0])


def _section(heading: str, model: Model, file: str) -> str:
    texts = meanings(model)
    if issubclass(model, MatrixColumns):
        texts = type_meanings(columns.__name__, columns.COLUMNS.types) | texts
    rows = [
        _row(info.alias or name, info, texts.get(name, ""), model, file)
        for name, info in model.model_fields.items()
    ]
    about = inspect.cleandoc(model.__doc__ or "").replace("\n\n", " ").replace("\n", " ")
    body = table(["key", "type", "unit", "allowed", "default", "meaning"], rows)
    return f"\n{heading} {{#{model.__name__}}}\n\n{sentence(about)}\n\n{body}"


def _row(key: str, info: FieldInfo, text: str, model: Model, file: str) -> list[object]:
    values = ranges.allowed_values(model, (key,))
    range_text = values.description("") if values else ""
    reason = values.reason() if values else ""
    meaning = _meaning(info, text) + (f" Reason for the range: {reason}." if reason else "")
    return [
        code(key),
        _type(info.annotation, file),
        ranges.unit_of_key(key),
        range_text,
        _default(info),
        meaning,
    ]


def _selects(info: FieldInfo) -> bool:
    """Return whether a key has one allowed value, which selects the mapping among several."""
    return get_origin(info.annotation) is Literal and len(get_args(info.annotation)) == 1


def _default(info: FieldInfo) -> str:
    value = info.get_default(call_default_factory=True) if info.default_factory else info.default
    if value is PydanticUndefined:
        return "" if info.is_required() else "none"
    if isinstance(value, BaseModel):
        return "its defaults"
    if value is None or value in ((), {}, ""):
        return "none"
    if isinstance(value, bool):
        return code(str(value).lower())
    return code(format_number(value) if isinstance(value, int | float) else value)


_PLAIN = {float: "number", int: "whole number", str: "text", bool: "true or false"}


def _type(annotation: Any, file: str) -> str:
    """Return the type of a key as Markdown, with links to the sections of mappings."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _type(arguments[0], file)
    if origin is Literal:
        return "choice"
    if origin in (Union, types.UnionType):
        members = [_type(each, file) for each in arguments if each is not type(None)]
        return " or ".join(dict.fromkeys(members))
    if origin in (tuple, list):
        inner = dict.fromkeys(_type(each, file) for each in arguments if each is not Ellipsis)
        return f"list of {' and '.join(inner)}"
    if origin in (dict, types.MappingProxyType) or getattr(origin, "__name__", "") == "Mapping":
        return f"mapping of {_type(arguments[1], file)} by name"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        where = "wiring.md" if _is_wiring(annotation) and file != "wiring" else ""
        return f"[{cell(_short(annotation))}]({where}#{annotation.__name__})"
    return _PLAIN.get(annotation, getattr(annotation, "__name__", "value").lower())


def _kind(model: Model) -> str:
    """Return the value of the key `kind` that selects a mapping; empty if none does."""
    info = model.model_fields.get("kind")
    return str(get_args(info.annotation)[0]) if info and _selects(info) else ""


def _short(model: Model) -> str:
    """Return the name of a mapping in a table: its `kind`, or its class in small letters."""
    name = "".join(f" {c.lower()}" if c.isupper() else c for c in model.__name__).strip()
    return _kind(model) or name.removeprefix("_")


def _label(model: Model) -> str:
    """Return the name of a mapping in a heading."""
    return f"`kind: {_kind(model)}`" if _kind(model) else _short(model).capitalize()


def _reached(model: Model) -> list[Model]:
    """Return a model and all models below it, each once, in the order of their keys."""
    found: dict[Model, None] = {}

    def visit(one: Model) -> None:
        if one in found:
            return
        one.model_rebuild()
        found[one] = None
        if _is_wiring(one) and not _is_wiring(model):
            return
        for info in one.model_fields.values():
            for below in _models_in(info.annotation):
                visit(below)

    visit(model)
    return list(found)
