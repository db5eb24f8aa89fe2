"""The kind of rig of a file: a rig file, or a campaign or session that names one."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.campaign.files import CAMPAIGN_KEYS, common_problems
from rig.config.campaign_file import BaseCampaignFile
from rig.config.problems import ConfigError, Problem, format_value
from rig.config.pydantic_errors import validate
from rig.config.rig_file import BaseRigFile
from rig.config.shipped_files import RIGS
from rig.config.yaml_source import SourceMap, load_mapping
from rig.kinds.registry import KindError, RigKind, find, known, registered
from rig.planning.input_files import EVERYTHING_ELSE, ConfigSource, load_named_source

_OF_A_KIND = "the rig, its limits and plant, and all keys that depend on the kind of rig"


class LoadedRig(NamedTuple):
    """A rig file, the file and line of each value, and the rig's kind."""

    file: BaseRigFile
    locate: SourceMap
    kind: RigKind


def load_rig(path: Path) -> LoadedRig:
    """Return a rig file as the model of its kind; raises `ConfigError` with every problem found."""
    kind = kind_of(*load_mapping(path, kinds=(RIGS,)))
    model = kind.room("config").RigFile
    mapping, locate = load_mapping(path, inline=model.inline, kinds=(RIGS,))
    return LoadedRig(validate(mapping, locate, model), locate, kind)


def kind_of(mapping: dict[str, Any], locate: SourceMap) -> RigKind:
    """Return the kind that a rig file names; `ConfigError` if it names none that can be used."""
    name = mapping.get("kind")
    if not isinstance(name, str) or name not in known():
        fault = "missing" if name is None else f"{format_value(name)} is not known"
        message = f"{fault}; allowed {', '.join(known())}"
        raise ConfigError([locate.problem(("kind",), name, message)])
    try:
        return find(name)
    except KindError as error:
        raise ConfigError([locate.problem(("kind",), name, str(error))]) from None


def kind_of_task(path: Path, rig: Path | None = None) -> RigKind:
    """Return the kind of rig of a campaign or session; ``rig`` replaces the rig that it names.

    A file that names no rig gets the kind whose files share most keys with it: the check of that
    kind lists what is wrong. Raises `ConfigError` if the file or its rig file cannot be read, or if
    the rig file names no usable kind: the kind decides which keys the file may have. Raises
    KindError if no kind can be used.
    """
    try:
        source = ConfigSource(*load_mapping(path))
    except ConfigError as error:
        raise ConfigError(error.problems, [EVERYTHING_ELSE]) from None
    try:
        named = (
            ConfigSource(*load_mapping(rig, kinds=(RIGS,)))
            if rig
            else load_named_source(source, ("rig",))
        )
        if named is not None:
            return kind_of(*named)
    except ConfigError as error:
        problems = [*error.problems, *_common_problems(path)]
        raise ConfigError(problems, [_OF_A_KIND, *error.unchecked]) from None
    usable = _usable_kinds()
    if not usable:
        raise KindError("no kind of rig can be used; `rig kinds` lists the reasons")
    return max(usable, key=lambda kind: _shared_keys(kind, source))


def _usable_kinds() -> list[RigKind]:
    return [each.kind for each in registered() if not each.problem]


def _shared_keys(kind: RigKind, source: ConfigSource) -> int:
    return len(source.mapping.keys() & kind.room("tasks").TaskFile.model_fields.keys())


def _common_problems(path: Path) -> list[Problem]:
    """Return the problems of a campaign whose kind is unknown that every kind of rig reports."""
    models = [kind.room("tasks").TaskFile for kind in _usable_kinds()]
    campaigns = [model for model in models if issubclass(model, BaseCampaignFile)]
    inline = dict.fromkeys(key for model in campaigns for key in model.inline)
    try:
        source = ConfigSource(*load_mapping(path, inline=tuple(inline)))
    except ConfigError as error:
        return list(error.problems)
    is_campaign = any(key in source.mapping for key in CAMPAIGN_KEYS if key != "rig")
    return common_problems(source, campaigns) if is_campaign else []
