"""A rig file of whichever kind it says it is."""

from pathlib import Path

from rig.config.bench_rig_file import BenchRigFile
from rig.config.pydantic_errors import validate
from rig.config.rig_file import RigFile
from rig.config.yaml_source import Locate, load_mapping

AnyRigFile = RigFile | BenchRigFile


def load_rig(path: Path) -> tuple[AnyRigFile, Locate]:
    """A rig file as its kind's model, and where each value stands.

    What names no kind is read as a WaveBot. Raises `ConfigError` with every problem found.
    """
    mapping, locate = load_mapping(path)
    if mapping.get("kind") == "oswec bench":
        return validate(mapping, locate, BenchRigFile), locate
    return validate(mapping, locate, RigFile), locate
