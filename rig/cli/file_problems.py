"""How a command says what is wrong in the files it was given."""

import json

from rig import cli
from rig.cli.command_error import fail
from rig.config.problems import ConfigError

REFUSED = (ConfigError, KeyError, ValueError, OSError)
"""Errors that are about what a person gave, not about the program."""


def refuse(command: str, error: Exception, *, as_json: bool) -> int:
    """Say it as `fail` does; JSON also lists every problem with file, line, key and value."""
    if not (as_json and isinstance(error, ConfigError)):
        return fail(command, error, as_json=as_json)
    problems = [problem.as_dict() for problem in error.problems]
    told = {"status": "bad input", "message": error.text(), "problems": problems}
    print(json.dumps(told, ensure_ascii=False))
    return cli.BAD_INPUT
