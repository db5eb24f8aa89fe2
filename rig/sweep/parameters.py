"""Parameters that a sweep runs over: `--over KEY=V1,V2,...`, read, set, checked, all at once.

A key is one of the campaign file (`sea.frequency_hz`) or, below `rig.`, `limits.`, `plant.`, one of
those files. Values stand in the place of the file's own before anything is checked, so that what a
file may not say a sweep may not either.
"""

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from rig.config import ranges
from rig.config.problems import ConfigError, Problem, display_path, format_value
from rig.config.yaml_source import KeyPath, SourceLocation, SourceMap, load_mapping
from rig.execution.rehearsal.job import MATCHING_KEYS, problems
from rig.planning.campaign import Campaign, open_campaign
from rig.sweep.inputs import DATA, inputs

OPTION = "--over"
_FILES = ("rig", "limits", "plant")
OWN = ("sea", "law", "reference", "surge", "drive", "seed", "start", "timing", "tare")
"""Keys of the campaign file itself that may be swept."""
_ALLOWED = ", ".join([*OWN, *(f"{name}.*" for name in _FILES)])


class Over(NamedTuple):
    """One parameter and the values it takes."""

    number: int  # of the option on the command line, from 1
    key: str  # as given
    file: str  # campaign, rig, limits, plant
    path: KeyPath  # in that file
    values: tuple[Any, ...]  # numbers or words


Chosen = tuple[tuple[Over, Any], ...]
"""A value for each parameter of a sweep, or for some."""


class Read(NamedTuple):
    """What the command line asks for: parameters that can be looked at, and what is wrong."""

    parameters: tuple[Over, ...]
    problems: tuple[Problem, ...]


def sweep_parameters(words: Sequence[str]) -> Read:
    """The parameters asked for, as they stand."""
    found: list[Over] = []
    bad: list[Problem] = []
    for number, text in enumerate(words, 1):
        key, _, rest = text.partition("=")
        key = key.strip()
        try:
            values = _values(rest)
        except YAMLError:
            values = ()
        message = _refusal(key, values, {one.key for one in found})
        if message:
            bad.append(Problem(OPTION, number, key, rest or None, message))
            continue
        head, _, below = key.partition(".")
        file = head if head in _FILES else "campaign"
        path = tuple((below if file == head else key).split("."))
        found.append(Over(number, key, file, path, values))
    return Read(tuple(found), tuple(bad))


def _values(text: str) -> tuple[Any, ...]:
    """Numbers and words; nothing where one of them is a mapping or a list."""
    values = tuple(YAML(typ="safe", pure=True).load(part) for part in text.split(","))
    return () if any(isinstance(value, dict | list) for value in values) else values


def _refusal(key: str, values: tuple[Any, ...], known: set[str]) -> str:
    head, _, below = key.partition(".")
    if head not in (*_FILES, *OWN) or (head in _FILES and not below):
        if head == "matrix":
            return "the rows of a sweep are the campaign's own; change its matrix"
        return f"no parameter of a campaign; allowed {_ALLOWED}"
    if key in known:
        return "asked for twice"
    write = f"write {key}=V1,V2,..."
    if not values:
        return f"a value is a number or a word, no mapping and no list; {write}"
    if None in values:
        place = f"value {values.index(None) + 1} of {len(values)}" if len(values) > 1 else "value"
        return f"{place} is missing; {write}"
    same = [v for i, v in enumerate(values) if v in values[:i]]
    return f"{format_value(same[0])} stands twice" if same else ""


class Files:
    """The files of a campaign, the same ones however often it is opened with other values.

    Texts are read once; data, which are read each time, must not change meanwhile.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._read: dict[tuple[Path, str], tuple[dict[str, Any], SourceMap]] = {}
        self._data: dict[Path, str] = {}  # sha256

    def opened(self, chosen: Chosen = ()) -> Campaign:
        """The campaign with these values; raises `ConfigError` with every problem.

        Raises ValueError where data are no longer those that it was opened with before.
        """

        def load(
            path: Path,
            asked: SourceLocation | None = None,
            key: str = "",
            inline: tuple[str, ...] = (),
        ) -> tuple[dict[str, Any], SourceMap]:
            if (path, key) not in self._read:
                self._read[path, key] = load_mapping(path, asked, key, inline)
            mapping, locate = copy.deepcopy(self._read[path, key])
            for over, value in chosen:
                if over.file == (key or "campaign"):
                    _put(mapping, locate, over, over.path, value)
                if key == "rig" and over.file == "plant" and over.path in MATCHING_KEYS.values():
                    _tell_the_rig(mapping, locate, over, value, chosen)
            return mapping, locate

        campaign = open_campaign(self.path, problems, load=load)
        for role, path, sha256 in inputs(campaign):
            if role in DATA and self._data.setdefault(path.resolve(), sha256) != sha256:
                raise ValueError(f"{display_path(path)} was changed since the sweep began")
        return campaign


def _tell_the_rig(
    mapping: dict[str, Any], locate: SourceMap, over: Over, value: Any, chosen: Chosen
) -> None:
    """What the rig must know of its plant it is told, unless it is asked to believe otherwise."""
    name = next(ours for ours, theirs in MATCHING_KEYS.items() if theirs == over.path)
    twin: KeyPath = ("heave", name)
    if not any(other.file == "rig" and other.path == twin for other, _ in chosen):
        _put(mapping, locate, over, twin, value)


def _put(mapping: dict[str, Any], locate: SourceMap, over: Over, path: KeyPath, value: Any) -> None:
    """Set a value; its place, and that of mappings made for it, is the command line's."""
    at = SourceLocation(Path(OPTION), over.number)
    inside: Any = mapping
    for depth, part in enumerate(path, 1):
        where = int(part) if isinstance(inside, list) and str(part).isdigit() else part
        last = depth == len(path)
        known = isinstance(inside, dict) or (
            isinstance(inside, list) and isinstance(where, int) and where < len(inside)
        )
        if not known:
            message = f"{format_value(inside)} stands where a mapping would have to"
            raise ConfigError([Problem(OPTION, over.number, over.key, value, message)])
        if last:
            inside[where] = value
        elif isinstance(inside, dict) and inside.get(str(where)) is None:
            inside[where] = {}
        if last or (*path[: depth - 1], where) not in locate.locations:
            locate.locations[(*path[: depth - 1], where)] = at
        inside = inside[where]


def checked(files: Files, read: Read) -> tuple[Campaign, tuple[tuple[Campaign, ...], ...]]:
    """The campaign as it is, and for each parameter with each of its values alone.

    What two values make of each other is seen when their case is run. Raises `ConfigError` with
    every problem of every value.
    """
    try:
        base = files.opened()
    except ConfigError as error:
        raise ConfigError([*read.problems, *error.problems]) from None
    swept: list[tuple[Campaign, ...]] = []
    bad = list(read.problems)
    for over in read.parameters:
        each: list[Campaign] = []
        for value in over.values:
            try:
                each.append(files.opened(((over, value),)))
            except ConfigError as error:
                bad += [_as_typed(problem, over) for problem in error.problems]
        swept.append(tuple(each))
    if bad:
        raise ConfigError(bad)
    return base, tuple(swept)


def _as_typed(problem: Problem, over: Over) -> Problem:
    """A problem of a value with its key as it stands on the command line."""
    if problem.file != OPTION:
        return problem
    key, message = problem.key, problem.message
    if over.file != "campaign":
        told = over.path in MATCHING_KEYS.values() and not key.startswith(str(over.path[0]))
        key = f"{'rig' if told else over.file}.{key}"
    if over.file == "plant" and message.endswith("is not a mapping"):
        message += f"; its number is {key}.value"
    if message.endswith("is not a list"):
        message += f"; its first entry is {key}.0"
    return problem._replace(key=key, message=message)


def unit(over: Over, campaign: Campaign) -> str:
    """What a parameter is measured in; empty for words and bare numbers."""
    if over.file == "plant" and "value" in over.path:  # the number itself, or one of its list
        entry: Any = campaign.plant
        for part in over.path[: over.path.index("value")]:
            entry = entry[part]
        return str(entry.get("unit", ""))
    return ranges.unit_of_key(ranges.last_named_part(over.path))
