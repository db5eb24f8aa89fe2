"""Reports of errors in the input files of a command."""

import json

from rig import cli
from rig.cli.command_error import fail
from rig.config.problems import ConfigError

INPUT_ERRORS = (ConfigError, KeyError, ValueError, OSError)
"""Errors in a person's input, as against errors of the program."""


def refuse(command: str, error: Exception, *, as_json: bool) -> int:
    """Report an error as `fail` does; JSON lists each problem's file, line, key and value, too."""
    if not (as_json and isinstance(error, ConfigError)):
        return fail(command, error, as_json=as_json)
    problems = [problem.as_dict() for problem in error.problems]
    report = {"status": "bad input", "message": error.text(), "problems": problems}
    print(json.dumps(report, ensure_ascii=False))
    return cli.BAD_INPUT
