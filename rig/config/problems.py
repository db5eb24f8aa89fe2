"""Problems of configuration files, with file, line, key, value and allowed range."""

import json
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple


class Problem(NamedTuple):
    """One mistake in a file: its line, its key, the value found and the values allowed."""

    file: str
    line: int  # from 1
    key: str  # key path, as in matrix.grid[0].kp_n_s_per_m; empty for the whole file
    value: object  # as read from the file; None where something is missing
    message: str  # with the value and, where there is one, the allowed range
    column: int = 0  # from 1; 0 where only the line is known

    def text(self) -> str:
        """Return one line of text: file, line, key path, message."""
        location = f"{self.file}:{self.line}" + (f":{self.column}" if self.column else "")
        key = f"{self.key}: " if self.key else ""
        return f"{location}: {key}{self.message}"

    def as_dict(self) -> dict[str, Any]:
        """Return the fields by name; a value that JSON cannot represent becomes text."""
        fields = self._asdict()
        if not _is_json_value(self.value):
            fields["value"] = str(self.value)
        return fields


class ConfigError(Exception):
    """Invalid configuration; holds every problem found in all files.

    ``unchecked`` names the checks that these problems prevented: they may find more.
    """

    def __init__(self, problems: Iterable[Problem], unchecked: Iterable[str] = ()) -> None:
        self.problems = tuple({problem.text(): problem for problem in problems}.values())
        self.unchecked = tuple(dict.fromkeys(unchecked))
        super().__init__(self.text())

    def text(self) -> str:
        """Return all problems, one per line, and the checks that did not run."""
        lines = [problem.text() for problem in self.problems]
        return "\n".join([*lines, *unchecked_lines(self.unchecked)])

    def to_json(self) -> str:
        """Return all problems as a JSON list of objects."""
        return json.dumps([problem.as_dict() for problem in self.problems], ensure_ascii=False)


def display_path(path: Path) -> str:
    """Return a path for messages: relative if the file is below the working directory."""
    working_directory = os.path.join(os.getcwd(), "")
    return os.path.normpath(path).removeprefix(working_directory)


def format_key(key: Iterable[str | int]) -> str:
    """Return a key path as text: ('matrix', 'grid', 0) becomes matrix.grid[0]."""
    text = ""
    for part in key:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f".{part}" if text else part
    return text


def format_value(value: object) -> str:
    """Return a value as YAML would write it, shortened to one line."""
    if isinstance(value, str):
        return repr(value if len(value) <= 60 else value[:57] + "...")
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return format_number(value)
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return "a list"
    return str(value)


def format_number(value: float) -> str:
    """Return a number without trailing zeros: -50000, 0.3, nan."""
    if not math.isfinite(value):
        return str(value)
    short = f"{value:.10g}"
    return short if "e" not in short or abs(value) >= 1e10 or abs(value) < 1e-4 else f"{value:.0f}"


def _is_json_value(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return value is None or isinstance(value, (str, int))


def parse_number(text: str) -> float | None:
    """Return the finite number in a text; None if it holds none."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def number_ranges(numbers: Iterable[int]) -> list[str]:
    """Return increasing numbers as texts, consecutive ones as one: `7`, `9-12`."""
    ranges: list[list[int]] = []
    for number in numbers:
        if ranges and number == ranges[-1][1] + 1:
            ranges[-1][1] = number
        else:
            ranges.append([number, number])
    return [str(low) if low == high else f"{low}-{high}" for low, high in ranges]


def format_line_numbers(numbers: Sequence[int]) -> str:
    """Return increasing line numbers as text: `line 7`, `lines 7, 9-12`."""
    return f"line{'s' if len(numbers) > 1 else ''} {', '.join(number_ranges(numbers))}"


def format_rows(rows: Iterable[int]) -> str:
    """Return row ids as short text: ``rows 1-5, 9``."""
    numbers = sorted(map(int, rows))
    texts = number_ranges(numbers)
    if len(texts) > 12:
        texts = [*texts[:12], f"and {len(texts) - 12} more"]
    return ("row " if len(numbers) == 1 else "rows ") + ", ".join(texts)


def problems_text(problems: Sequence[Problem], unchecked: Sequence[str] = ()) -> str:
    """Return one problem a line, their number, and the checks that these problems prevented."""
    count = len(problems)
    lines = [problem.text() for problem in problems]
    total = f"{count} problem{'s' if count != 1 else ''}"
    return "\n".join([*lines, total, *unchecked_lines(unchecked)])


def unchecked_lines(unchecked: Sequence[str]) -> list[str]:
    """Return the line about checks that did not run; no line if all did."""
    return (
        [f"more checks follow once this is corrected: {'; '.join(unchecked)}"] if unchecked else []
    )


def error_text(error: Exception) -> str:
    """Return an error's text, without the quotes of a KeyError or the number of an OSError."""
    if isinstance(error, KeyError) and error.args:
        return str(error.args[0])
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)
