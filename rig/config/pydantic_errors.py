"""Translation of pydantic's validation errors into problems with file, line and allowed range."""

import difflib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from rig.config import ranges
from rig.config.model import RULE, FileModel, RuleViolation
from rig.config.problems import ConfigError, Problem, display_path, format_value
from rig.config.unit_factors import factor_note, key_note
from rig.config.yaml_source import KeyPath, SourceLocation, SourceMap, load_mapping

M = TypeVar("M", bound=BaseModel)

_ERROR_TEXTS = {
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
_LENGTH_ERRORS = ("too_short", "too_long", "string_too_short", "string_too_long")


def load(path: Path, model: type[M], named_at: SourceLocation | None = None) -> tuple[M, SourceMap]:
    """Return a file as a frozen model, and the file and line of each value.

    ``named_at`` is the location that names the file. Raises `ConfigError` with every problem found.
    """
    mapping, locate = load_mapping(path, named_at, inline=getattr(model, "inline", ()))
    return validate(mapping, locate, model), locate


def validate(mapping: dict[str, Any], locate: SourceMap, model: type[M]) -> M:
    """Return a merged mapping as a frozen model; raises `ConfigError` with every problem found."""
    try:
        return model.model_validate(mapping)
    except ValidationError as error:
        places = [(item["type"], item["loc"]) for item in error.errors(include_url=False)]
        hidden = any(kind != RULE or place for kind, place in places)
        rules = [f"the rules between keys of {display_path(locate.path)}"] if hidden else []
        raise ConfigError(problems_from(error, locate, model), rules) from None


_MIN_SIMILARITY = 0.73  # difflib ratio above which a key is suggested; 'start'/'static' is below


def problems_from(
    error: ValidationError, locate: SourceMap, model: type[BaseModel] | None = None
) -> tuple[Problem, ...]:
    """Return pydantic's errors as problems; with ``model`` they include the allowed ranges."""
    items = error.errors(include_url=False)
    nested = {e["loc"][:n] for e in items for n in range(len(e["loc"]))}
    problems: dict[tuple[SourceLocation, str, str], Problem] = {}
    for item in items:
        if item["type"] in _LENGTH_ERRORS and item["loc"] in nested:
            continue  # the list is only too short because its invalid entries were left out
        for location, problem in _translate(dict(item), locate, model):
            # A range or list that violates one rule many times counts as one mistake.
            rule = item["type"] + (problem.message if problem.value is None else "")
            problems.setdefault((location, problem.key, rule), problem)
    order = {file: i for i, file in enumerate(locate.files)}
    ranked = sorted(problems.items(), key=lambda p: (order.get(p[0][0].path, 0), p[0][0].line))
    return tuple(problem for _, problem in ranked)


def _translate(
    item: dict[str, Any], locate: SourceMap, model: type[BaseModel] | None
) -> Iterator[tuple[SourceLocation, Problem]]:
    """Yield the problems of one pydantic error, each with its location."""
    kind, loc, value = item["type"], item["loc"], item.get("input")
    key = _key_in_file(loc, locate, kind)
    if kind == RULE:
        violations: tuple[RuleViolation, ...] = item["ctx"]["rules"]
        for violation in violations:
            at = (*key, *violation.key)
            yield locate(at), locate.problem(at, violation.value, violation.message)
        return
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        tag = item["ctx"]["discriminator"].strip("'")
        tags = _expected_tags(item["ctx"].get("expected_tags"), model, loc)
        key, value = (*key, tag), item["ctx"].get("tag")
        fault = "missing" if value is None else f"{format_value(value)} is not known"
        message = f"{fault}; allowed {tags}{_suggestion(value, tags.split(', '))}"
    elif kind == "missing":
        value = None
        message = "missing" + _allowed_text(model, loc)
    elif kind == "extra_forbidden":
        message = _unknown_key_message(model, loc)
    elif kind in _LENGTH_ERRORS:
        message = _length_message(item)
    else:
        fault = _ERROR_TEXTS.get(kind, "")
        if kind.startswith(("value_error", "assertion_error")):
            key, value, message = _named_key(key, value, str(item["ctx"]["error"]), locate)
        elif kind == "unit":  # of the plant of coupled modes
            message = item["msg"] + _unit_note(item["ctx"]["given"], item["ctx"]["allowed"])
        elif not fault:
            message = f"{format_value(value)}: {item['msg']}"
        else:
            with_reason = kind.startswith(("greater", "less"))
            message = f"{format_value(value)} {fault}{_allowed_text(model, loc, with_reason)}"
            if kind == "literal_error":
                message += _unit_note(value, item["ctx"]["expected"])
            if kind == "string_type" and not isinstance(value, (dict, list)):
                message += "; put it in quotes if it is meant as text"
    yield locate(key), locate.problem(key, value, message)


def _named_key(
    key: KeyPath, value: Any, message: str, locate: SourceMap
) -> tuple[KeyPath, Any, str]:
    """Return key, value and message of a rule of a mapping that names one of its keys first."""
    name, colon, rest = message.partition(": ")
    below = tuple(name.split("."))
    if not colon or (*key, *below) not in locate.locations:
        return key, value, message
    for part in below:
        value = value.get(part) if isinstance(value, dict) else None
    return (*key, *below), value, rest


def _key_in_file(loc: Iterable[str | int], locate: SourceMap, kind: str) -> KeyPath:
    """Return the key path as it is in the file: without union tags and generated indices."""
    key: KeyPath = ()
    parts = tuple(loc)
    for i, part in enumerate(parts):
        candidate = (*key, part)
        if candidate in locate.locations or (kind == "missing" and i == len(parts) - 1):
            key = candidate
    return key


def _allowed_text(model: type[BaseModel] | None, loc: KeyPath, with_reason: bool = False) -> str:
    allowed = ranges.allowed_values(model, loc) if model is not None else None
    if allowed is None:
        return ""
    text = allowed.description(ranges.last_named_part(loc))
    reason = f" ({allowed.reason()})" if with_reason and allowed.reason() else ""
    return (f"; allowed {text}" if text else "") + reason


def _expected_tags(expected: str | None, model: type[BaseModel] | None, loc: KeyPath) -> str:
    """Return the tags of a discriminated union as text; ``expected`` are those of pydantic."""
    if expected is not None:
        return expected.replace("'", "")
    tags = []
    for member in ranges.models_at(model, loc) if model is not None else ():
        allowed = ranges.allowed_values(member, ("kind",))
        tags.append(allowed.description("kind") if allowed is not None else "")
    return ", ".join(tag for tag in tags if tag)


def _unknown_key_message(model: type[BaseModel] | None, loc: KeyPath) -> str:
    key = str(loc[-1])
    if model is None:
        return "unknown key"
    known: list[str] = []
    for owner in ranges.models_at(model, loc[:-1]):
        if issubclass(owner, FileModel) and key in owner.foreign_keys:
            return f"unknown key; {owner.foreign_keys[key]}"
        known += [info.alias or name for name, info in owner.model_fields.items()]
    if note := key_note(key, known):
        return f"unknown key; {note}"
    suggestion = _suggestion(key, known)
    if suggestion or not known:
        return f"unknown key{suggestion}"
    return f"unknown key; known are {', '.join(dict.fromkeys(known))}"


def _unit_note(value: Any, expected: str) -> str:
    """Return the factor to an allowed unit; empty for a value that is no unit of that quantity."""
    units = expected.replace(" or ", ", ").replace("'", "").split(", ")
    note = factor_note(value, units) if isinstance(value, str) else ""
    return f": {note}" if note else ""


def _suggestion(key: object, known: Iterable[str]) -> str:
    """Return a hint at the most similar known word; empty if none is similar."""
    names = list(known)
    matches = [name for name in names if name.startswith(f"{key}_")]  # the unit is missing
    matches = matches or difflib.get_close_matches(str(key), names, n=1, cutoff=_MIN_SIMILARITY)
    return f"; did you mean {matches[0]}?" if matches and key is not None else ""


def _length_message(item: dict[str, Any]) -> str:
    ctx = item["ctx"]
    unit = "characters" if item["type"].startswith("string") else "entries"
    if "min_length" in ctx:
        return f"too few {unit}; allowed at least {ctx['min_length']}"
    return f"too many {unit}; allowed at most {ctx['max_length']}"
