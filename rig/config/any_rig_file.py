"""Loading of a rig file as the model of its kind."""

from pathlib import Path

from rig.config.pydantic_errors import validate
from rig.config.yaml_source import SourceMap, load_mapping
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.wavebot.config.rig_file import RigFile

AnyRigFile = RigFile | BenchRigFile


def load_rig(path: Path) -> tuple[AnyRigFile, SourceMap]:
    """Return a rig file as the model of its kind, and the file and line of each value.

    A file without a known `kind` is read as a WaveBot, so that the message lists the kinds.
    Raises `ConfigError` with every problem found.
    """
    mapping, locate = load_mapping(path)
    if mapping.get("kind") == "oswec bench":
        return validate(mapping, locate, BenchRigFile), locate
    return validate(mapping, locate, RigFile), locate
