"""Configuration files: reading, validation and frozen models.

All problems of all files are reported at once, each with file, line, key and allowed range.
"""

from rig.config.problems import ConfigError, Problem
from rig.config.pydantic_errors import load, problems_from, validate
from rig.config.yaml_source import SourceLocation, SourceMap, load_mapping

__all__ = [
    "ConfigError",
    "Problem",
    "SourceLocation",
    "SourceMap",
    "load",
    "load_mapping",
    "problems_from",
    "validate",
]
