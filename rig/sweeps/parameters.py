"""Sweep parameters, `--over KEY=V1,V2,...`: parse, set and check them.

A key is a key of the campaign or session file (`sea.frequency_hz`) or, below `rig.`, `limits.`,
`plant.`, a key of one of those files. Values replace those of the file before validation, so a
sweep accepts exactly the values that the file accepts.
"""

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from rig.config import ranges
from rig.config.law_settings import value_at
from rig.config.problems import ConfigError, Problem, display_path, format_value
from rig.config.yaml_source import KeyPath, SourceLocation, SourceMap, load_mapping
from rig.sweeps.simulator import simulation_of_rig
from rig.sweeps.task import SweepParameter, SweepTask, TaskType

OPTION = "--over"
_FILES = ("rig", "limits", "plant")

ParameterValues = tuple[tuple[SweepParameter, Any], ...]
"""A value for each of some or all parameters of a sweep."""


class ParsedParameters(NamedTuple):
    """The parameters of the command line, and the problems of the others."""

    parameters: tuple[SweepParameter, ...]
    problems: tuple[Problem, ...]


def parse_parameters(options: Sequence[str], tasks: TaskType) -> ParsedParameters:
    """Parse the options into parameters; keys and values are not yet checked against the files."""
    parameters: list[SweepParameter] = []
    problems_found: list[Problem] = []
    for number, text in enumerate(options, 1):
        key, _, rest = text.partition("=")
        key = key.strip()
        try:
            values = _values(rest)
        except YAMLError:
            values = ()
        message = _key_problem(key, values, tasks, {one.key for one in parameters})
        if message:
            problems_found.append(Problem(OPTION, number, key, rest or None, message))
            continue
        head, _, below = key.partition(".")
        file = head if head in _FILES else tasks.noun
        path = tuple((below if file == head else key).split("."))
        parameters.append(SweepParameter(number, key, file, path, values))
    return ParsedParameters(tuple(parameters), tuple(problems_found))


def _values(text: str) -> tuple[Any, ...]:
    """Return numbers and text; nothing if one of the values is a mapping or a list."""
    values = tuple(YAML(typ="safe", pure=True).load(part) for part in text.split(","))
    return () if any(isinstance(value, dict | list) for value in values) else values


def _key_problem(key: str, values: tuple[Any, ...], tasks: TaskType, known: set[str]) -> str:
    head, _, below = key.partition(".")
    if head not in (*_FILES, *tasks.keys) or (head in _FILES and not below):
        allowed = ", ".join([*tasks.keys, *(f"{name}.*" for name in _FILES)])
        unknown = f"not a parameter of a {tasks.noun}; allowed {allowed}"
        return tasks.fixed_keys.get(head, unknown)
    if key in known:
        return "given twice"
    write = f"write {key}=V1,V2,..."
    if not values:
        return f"a value is a number or text, not a mapping or a list; {write}"
    if None in values:
        place = f"value {values.index(None) + 1} of {len(values)}" if len(values) > 1 else "value"
        return f"{place} is missing; {write}"
    same = [v for i, v in enumerate(values) if v in values[:i]]
    return f"{format_value(same[0])} occurs twice" if same else ""


class TaskFiles:
    """The files of a task, which can be opened repeatedly with different values.

    Text files are read once. Data files are read each time and must not change in between.
    """

    def __init__(self, path: Path, tasks: TaskType) -> None:
        self.path, self.tasks = path, tasks
        self._read: dict[tuple[Path, str], tuple[dict[str, Any], SourceMap]] = {}
        self._data: dict[Path, str] = {}  # sha256

    def mapping(self, key: str) -> dict[str, Any]:
        """Return the content of a file that was read, by its key; the task's own key is empty."""
        found = (mapping for (_, each), (mapping, _) in self._read.items() if each == key)
        return next(found, {})

    def open(self, values: ParameterValues = ()) -> SweepTask:
        """Return the task with these values; raise `ConfigError` with every problem.

        Raises ValueError if a data file has changed since it was first read.
        """

        def load(
            path: Path,
            place: SourceLocation | None = None,
            key: str = "",
            inline: tuple[str, ...] = (),
            kinds: tuple[str, ...] = (),
        ) -> tuple[dict[str, Any], SourceMap]:
            if (path, key) not in self._read:
                self._read[path, key] = load_mapping(path, place, key, inline, kinds)
            mapping, locate = copy.deepcopy(self._read[path, key])
            for parameter, value in values:
                if parameter.file == (key or self.tasks.noun):
                    _set_value(mapping, locate, parameter, parameter.path, value)
                if key == "rig" and parameter.file == "plant":
                    _set_rig_twin(mapping, locate, parameter, value, values)
            return mapping, locate

        task: SweepTask = self.tasks.open(self.path, load)
        for file in task.data:
            if self._data.setdefault(file.path.resolve(), file.sha256) != file.sha256:
                raise ValueError(f"{display_path(file.path)} was changed since the sweep began")
        return task


def _set_rig_twin(
    mapping: dict[str, Any],
    locate: SourceMap,
    parameter: SweepParameter,
    value: Any,
    values: ParameterValues,
) -> None:
    """Set the rig's own value of a plant parameter too, unless the sweep sets it separately."""
    simulation = simulation_of_rig(mapping)
    for twin, theirs in simulation.matching_keys(mapping).items() if simulation else ():
        is_set = any(other.file == "rig" and other.path == twin for other, _ in values)
        if theirs == parameter.path and not is_set:
            _set_value(mapping, locate, parameter, twin, value)


def _set_value(
    mapping: dict[str, Any], locate: SourceMap, parameter: SweepParameter, path: KeyPath, value: Any
) -> None:
    """Set a value; its location, and that of mappings created for it, is the command line."""
    place = SourceLocation(Path(OPTION), parameter.number)
    inside: Any = mapping
    at: KeyPath = ()  # entries of lists by number
    for depth, part in enumerate(path, 1):
        index = int(part) if isinstance(inside, list) and str(part).isdigit() else part
        at, last = (*at, index), depth == len(path)
        exists = isinstance(inside, dict) or (
            isinstance(inside, list) and isinstance(index, int) and index < len(inside)
        )
        if not exists:
            message = f"{format_value(inside)} is not a mapping, so it has no key {part}"
            raise ConfigError([Problem(OPTION, parameter.number, parameter.key, value, message)])
        if last:
            inside[index] = value
            for below in [key for key in locate.locations if key[:depth] == at]:
                del locate.locations[below]
        elif isinstance(inside, dict) and inside.get(str(index)) is None:
            inside[index] = {}
        if last or at not in locate.locations:
            locate.locations[at] = place
        inside = inside[index]


def check_values(
    files: TaskFiles, parsed: ParsedParameters
) -> tuple[SweepTask, tuple[tuple[SweepTask, ...], ...]]:
    """Return the task of the files, and one task for each single value of each parameter.

    Conflicts between values of different parameters appear when their case runs. Raises
    `ConfigError` with every problem of every value.
    """
    try:
        base = files.open()
    except ConfigError as error:
        raise ConfigError([*parsed.problems, *error.problems], error.unchecked) from None
    swept: list[tuple[SweepTask, ...]] = []
    problems_found, unchecked = list(parsed.problems), list[str]()
    for parameter in parsed.parameters:
        if rig_key := _key_of_rig_law(parameter, files):
            message = f"the law is that of the rig file: write {rig_key}=V1,V2,..."
            problems_found.append(Problem(OPTION, parameter.number, parameter.key, None, message))
            continue
        variants: list[SweepTask] = []
        for value in parameter.values:
            try:
                variants.append(files.open(((parameter, value),)))
            except ConfigError as error:
                unchecked += error.unchecked
                problems_found += [
                    _with_option_key(problem, parameter, files.tasks.noun)
                    for problem in error.problems
                ]
        swept.append(tuple(variants))
    if problems_found:
        raise ConfigError(problems_found, unchecked)
    return base, tuple(swept)


def _key_of_rig_law(parameter: SweepParameter, files: TaskFiles) -> str:
    """Return the parameter's key in the rig file, if the campaign has its law from there.

    Such a campaign has no key `law` of the parameter's axis.
    """
    path, campaign, rig = parameter.path, files.mapping(""), files.mapping("rig")
    if parameter.file != files.tasks.noun or path[0] != "law":
        return ""
    axes = rig.get("axes")
    names = list(axes) if isinstance(axes, dict) else []
    pairs: list[tuple[KeyPath, KeyPath]] = [
        (("law", name) if len(names) > 1 else ("law",), ("axes", name, "law")) for name in names
    ]
    for own, theirs in pairs or [(("law",), ("law",))]:
        inherited = value_at(campaign, own) is None and value_at(rig, theirs) is not None
        if inherited and path[: len(own)] == own:
            return ".".join(map(str, ("rig", *theirs, *path[len(own) :])))
    return ""


def _with_option_key(problem: Problem, parameter: SweepParameter, noun: str) -> Problem:
    """Return a problem of a value with its key as on the command line; ``noun``: of the task."""
    if problem.file != OPTION:
        return problem
    key, message = problem.key, problem.message
    if parameter.file != noun:
        is_rig_twin = not key.startswith(str(parameter.path[0]))  # see `_set_rig_twin`
        key = f"{'rig' if is_rig_twin else parameter.file}.{key}"
    if parameter.file == "plant" and message.endswith("is not a mapping"):
        message += f"; its number is {key}.value"
    if message.endswith("is not a list"):
        message += f"; its first entry is {key}.0"
    return problem._replace(key=key, message=message)


def parameter_unit(parameter: SweepParameter, task: SweepTask) -> str:
    """Return the unit of a parameter; empty for text and dimensionless numbers."""
    # The path of a plant value ends with `value`, or with `value` and the index in a list.
    if parameter.file == "plant" and "value" in parameter.path:
        entry: Any = task.plant
        for part in parameter.path[: parameter.path.index("value")]:
            entry = entry[part]
        return str(entry.get("unit", ""))
    unit = unit_of_path(parameter.path)
    return unit or (task.plant_unit(parameter.path) if parameter.file == "plant" else "")


def unit_of_path(path: Sequence[str | int]) -> str:
    """Return the unit in the last name of a path whose other parts may be numbers of entries."""
    names = [part for part in map(str, path) if not part.isdigit()]
    return ranges.unit_of_key(names[-1])
