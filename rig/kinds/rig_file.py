"""Loading of a rig file as the model of its kind."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.config.problems import ConfigError, format_value
from rig.config.pydantic_errors import validate
from rig.config.rig_file import BaseRigFile
from rig.config.yaml_source import SourceMap, load_mapping
from rig.kinds import KindError, RigKind, find, known


class LoadedRig(NamedTuple):
    """A rig file, the file and line of each value, and the rig's kind."""

    file: BaseRigFile
    locate: SourceMap
    kind: RigKind


def load_rig(path: Path) -> LoadedRig:
    """Return a rig file as the model of its kind; raises `ConfigError` with every problem found."""
    mapping, locate = load_mapping(path)
    kind = kind_of(mapping, locate)
    return LoadedRig(validate(mapping, locate, kind.room("config").RigFile), locate, kind)


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
