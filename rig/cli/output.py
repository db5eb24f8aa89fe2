"""The end of a command: output for people or as JSON for programs, errors, exit code."""

import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from rich.console import Console

from rig.config.problems import ConfigError, error_text

OK = 0
FAILED = 1
BAD_INPUT = 2
STOPPED = 3  # by the operator
FAULT = 4  # the rig tripped
LOST = 5  # a process died, or rows were lost

INPUT_ERRORS = (ConfigError, KeyError, ValueError, OSError)
"""Errors in a person's input, as against errors of the program."""


@contextmanager
def input_errors(command: str, *, as_json: bool) -> Iterator[None]:
    """Report an error in a person's input as `refuse` does, and end the command."""
    try:
        yield
    except INPUT_ERRORS as error:
        sys.exit(refuse(command, error, as_json=as_json))


def refuse(command: str, error: Exception, *, as_json: bool) -> int:
    """Report an error as `fail` does; JSON lists each problem's file, line, key and value, too."""
    if not (as_json and isinstance(error, ConfigError)):
        return fail(command, error, as_json=as_json)
    problems = [problem.as_dict() for problem in error.problems]
    report = {"status": "bad input", "ok": False, "message": error.text(), "problems": problems}
    report["unchecked"] = list(error.unchecked)
    print_json(report)
    return BAD_INPUT


def fail(command: str, error: Exception, *, as_json: bool, code: int = BAD_INPUT) -> int:
    """Print an error on standard error, or as JSON on standard output; return ``code``."""
    message = error_text(error) or type(error).__name__
    if as_json:
        status = "bad input" if code == BAD_INPUT else "failed"
        print(json.dumps({"status": status, "message": message}))
    else:
        print(f"rig {command}: {message}", file=sys.stderr)
    return code


def waiting(console: Console, text: str, *, quiet: bool) -> AbstractContextManager[object]:
    """Return a context that shows what a person waits for, on a terminal unless ``quiet``."""
    return console.status(text) if console.is_terminal and not quiet else nullcontext()


def print_json(values: Any) -> int:
    """Print JSON values in one line, and return the exit code of success."""
    print(json.dumps(values, ensure_ascii=False))
    return OK


def print_result(
    values: dict[str, Any], text: str, written: Iterable[Path], *, as_json: bool
) -> int:
    """Print a result and its files; JSON has them as ``written``. Return the code of success."""
    names = [str(path) for path in written]
    if as_json:
        return print_json({**values, "written": names})
    print(text)
    print("\n" + "\n".join(names))
    return OK
