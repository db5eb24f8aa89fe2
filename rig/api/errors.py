"""The exception of the Python API."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from rig.config.problems import ConfigError, Problem, error_text
from rig.recording.runs import RunError
from rig.recording.runs.create import BusyError


class RigError(Exception):
    """An input that cannot be used: a file, a run, a row, a field, a value.

    The message names the path, the value and what is allowed, as the message of the command does.

    Attributes:
        problems: The problems of files, each with file, line, key, value and message; empty for
            other errors.
    """

    def __init__(self, message: str, problems: Iterable[Problem] = ()) -> None:
        super().__init__(message)
        self.problems = tuple(problems)


@contextmanager
def public_errors() -> Iterator[None]:
    """Raise the errors of a person's input as `RigError`."""
    try:
        yield
    except ConfigError as error:
        raise RigError(error.text(), error.problems) from error
    except (RunError, BusyError, KeyError, ValueError, OSError) as error:
        raise RigError(error_text(error) or type(error).__name__) from error
