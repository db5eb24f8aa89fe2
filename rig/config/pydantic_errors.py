"""Pydantic's errors turned into problems a test engineer can act on."""

import difflib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from rig.config import ranges
from rig.config.model import RULE, Broken, FileModel
from rig.config.problems import ConfigError, Problem, value_text
from rig.config.yaml_source import KeyPath, Locate, Place, load_mapping

M = TypeVar("M", bound=BaseModel)

_WHAT_IT_IS_NOT = {
    "float_type": "is not a number",
    "float_parsing": "is not a number",
    "int_type": "is not a whole number",
    "int_parsing": "is not a whole number",
    "int_from_float": "is not a whole number",
    "string_type": "is not text",
    "bool_type": "is not true or false",
    "bool_parsing": "is not true or false",
    "finite_number": "is not a finite number",
    "greater_than": "is out of range",
    "greater_than_equal": "is out of range",
    "less_than": "is out of range",
    "less_than_equal": "is out of range",
    "literal_error": "is not known",
    "model_type": "is not a mapping",
    "model_attributes_type": "is not a mapping",
    "dict_type": "is not a mapping",
    "tuple_type": "is not a list",
    "list_type": "is not a list",
    "string_pattern_mismatch": "has a character that is not allowed",
}
_LENGTHS = ("too_short", "too_long", "string_too_short", "string_too_long")


def load(path: Path, model: type[M], asked: Place | None = None) -> tuple[M, Locate]:
    """A file as a frozen model, and where each value stands.

    ``asked`` is the place that names the file. Raises `ConfigError` with every problem found.
    """
    mapping, locate = load_mapping(path, asked, inline=getattr(model, "inline", ()))
    return validate(mapping, locate, model), locate


def validate(mapping: dict[str, Any], locate: Locate, model: type[M]) -> M:
    """A merged mapping as a frozen model; raises `ConfigError` with every problem found."""
    try:
        return model.model_validate(mapping)
    except ValidationError as error:
        raise ConfigError(problems_from(error, locate, model)) from None


_ALIKE = 0.73  # of two words, for one to be a slip of the other: not 'start' for 'stator'


def problems_from(
    error: ValidationError, locate: Locate, model: type[BaseModel] | None = None
) -> tuple[Problem, ...]:
    """Pydantic's errors as problems; with the ``model`` they also tell the allowed range."""
    raw = error.errors(include_url=False)
    deeper = {e["loc"][:n] for e in raw for n in range(len(e["loc"]))}
    problems: dict[tuple[Place, str, str], Problem] = {}
    for item in raw:
        if item["type"] in _LENGTHS and item["loc"] in deeper:
            continue  # the list is only short because its broken entries were left out
        place_and_problem = _translated(dict(item), locate, model)
        for place, problem in place_and_problem:
            # one range or list that breaks a rule many times is one mistake
            problems.setdefault((place, problem.key, item["type"] + _again(problem)), problem)
    order = {file: i for i, file in enumerate(locate.files)}
    ranked = sorted(problems.items(), key=lambda p: (order.get(p[0][0].path, 0), p[0][0].line))
    return tuple(problem for _, problem in ranked)


def _again(problem: Problem) -> str:
    return problem.message if problem.value is None else ""


def _translated(
    item: dict[str, Any], locate: Locate, model: type[BaseModel] | None
) -> Iterator[tuple[Place, Problem]]:
    kind, loc, value = item["type"], item["loc"], item.get("input")
    key = _key_in_file(loc, locate, kind)
    if kind == RULE:
        rules: tuple[Broken, ...] = item["ctx"]["rules"]
        for rule in rules:
            at = (*key, *rule.key)
            yield locate(at), locate.problem(at, rule.value, rule.message)
        return
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        tag = item["ctx"]["discriminator"].strip("'")
        words = _tag_words(item["ctx"].get("expected_tags"), model, loc)
        key, value = (*key, tag), item["ctx"].get("tag")
        said = "missing" if value is None else f"{value_text(value)} is not known"
        message = f"{said}; allowed {words}{_nearest(value, words.split(', '))}"
    elif kind == "missing":
        value = None
        message = "missing" + _allowed_words(model, loc)
    elif kind == "extra_forbidden":
        message = _unknown_key(model, loc)
    elif kind in _LENGTHS:
        message = _length(item)
    else:
        said = _WHAT_IT_IS_NOT.get(kind, "")
        if kind.startswith(("value_error", "assertion_error")):
            message = str(item["ctx"]["error"])
        elif not said:
            message = f"{value_text(value)}: {item['msg']}"
        else:
            message = f"{value_text(value)} {said}{_allowed_words(model, loc)}"
            if kind.startswith(("greater", "less")):
                message += _reason(model, loc)
            if kind == "string_type" and not isinstance(value, (dict, list)):
                message += "; put it in quotes if it is meant as text"
    yield locate(key), locate.problem(key, value, message)


def _key_in_file(loc: Iterable[str | int], locate: Locate, kind: str) -> KeyPath:
    """The key path as it stands in the file: without union tags and made-up indices."""
    key: KeyPath = ()
    parts = tuple(loc)
    for i, part in enumerate(parts):
        named = (*key, part)
        if named in locate.places or (kind == "missing" and i == len(parts) - 1):
            key = named
    return key


def _allowed_words(model: type[BaseModel] | None, loc: KeyPath) -> str:
    found = ranges.allowed(model, loc) if model is not None else None
    if found is None:
        return ""
    words = found.description(ranges.last_name(loc))
    return f"; allowed {words}" if words else ""


def _reason(model: type[BaseModel] | None, loc: KeyPath) -> str:
    found = ranges.allowed(model, loc) if model is not None else None
    return f" ({found.reason()})" if found is not None and found.reason() else ""


def _tag_words(expected: str | None, model: type[BaseModel] | None, loc: KeyPath) -> str:
    if expected is not None:
        return expected.replace("'", "")
    tags = []
    for member in ranges.models_at(model, loc) if model is not None else ():
        found = ranges.allowed(member, ("kind",))
        tags.append(found.description("kind") if found is not None else "")
    return ", ".join(tag for tag in tags if tag)


def _unknown_key(model: type[BaseModel] | None, loc: KeyPath) -> str:
    key = str(loc[-1])
    if model is None:
        return "unknown key"
    known: list[str] = []
    for owner in ranges.models_at(model, loc[:-1]):
        if issubclass(owner, FileModel) and key in owner.foreign_keys:
            return f"unknown key; {owner.foreign_keys[key]}"
        known += ranges.known_keys(owner)
    nearest = _nearest(key, known)
    if nearest or not known:
        return f"unknown key{nearest}"
    return f"unknown key; known are {', '.join(dict.fromkeys(known))}"


def _nearest(word: object, known: Iterable[str]) -> str:
    names = list(known)
    near = [name for name in names if name.startswith(f"{word}_")]  # its unit was forgotten
    near = near or difflib.get_close_matches(str(word), names, n=1, cutoff=_ALIKE)
    return f"; did you mean {near[0]}?" if near and word is not None else ""


def _length(item: dict[str, Any]) -> str:
    ctx = item["ctx"]
    unit = "characters" if item["type"].startswith("string") else "entries"
    if "min_length" in ctx:
        return f"too few {unit}; allowed at least {ctx['min_length']}"
    return f"too many {unit}; allowed at most {ctx['max_length']}"
