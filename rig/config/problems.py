"""What is wrong in a configuration file, said so that a person can go and mend it."""

import json
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple


class Problem(NamedTuple):
    """One mistake: where it stands, which key, what was found and what is allowed."""

    file: str
    line: int  # from 1
    key: str  # key path, as in matrix.grid[0].kp_n_s_per_m; empty for the whole file
    value: object  # as read from the file; None where something is missing
    message: str  # with the value and, where there is one, the allowed range
    column: int = 0  # from 1; 0 where only the line is known

    def text(self) -> str:
        """One line: file, line, key path, message."""
        place = f"{self.file}:{self.line}" + (f":{self.column}" if self.column else "")
        return f"{place}: {self.key}: {self.message}" if self.key else f"{place}: {self.message}"

    def as_dict(self) -> dict[str, Any]:
        """The same by names, with the value in a form JSON knows."""
        plain = self._asdict()
        if not _json_knows(self.value):
            plain["value"] = str(self.value)
        return plain


class ConfigError(Exception):
    """Configuration that cannot be used; holds every problem found, in every file."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple({problem.text(): problem for problem in problems}.values())
        super().__init__(self.text())

    def text(self) -> str:
        """All problems, one a line."""
        return "\n".join(problem.text() for problem in self.problems)

    def to_json(self) -> str:
        """All problems as a JSON list of objects."""
        return json.dumps([problem.as_dict() for problem in self.problems], ensure_ascii=False)


def shown(path: Path) -> str:
    """A path as problems name it: relative where it lies below the working directory."""
    normal = os.path.normpath(path)
    here = os.path.join(os.getcwd(), "")
    return normal.removeprefix(here)


def key_text(key: Iterable[str | int]) -> str:
    """A key path in words: ('matrix', 'grid', 0) is matrix.grid[0]."""
    text = ""
    for part in key:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f".{part}" if text else part
    return text


def value_text(value: object) -> str:
    """A value as it would stand in the file, shortened to a line."""
    if isinstance(value, str):
        return repr(value if len(value) <= 60 else value[:57] + "...")
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return number_text(value)
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return "a list"
    return str(value)


def number_text(value: float) -> str:
    """A number without trailing zeros: -50000, 0.3, nan."""
    if not math.isfinite(value):
        return str(value)
    short = f"{value:.10g}"
    return short if "e" not in short or abs(value) >= 1e10 or abs(value) < 1e-4 else f"{value:.0f}"


def _json_knows(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return value is None or isinstance(value, (str, int))


def lines_text(numbers: Sequence[int]) -> str:
    """Rising numbers of lines in words: `line 7`, `lines 7, 9-12`."""
    found: list[list[int]] = []
    for number in numbers:
        if found and number == found[-1][1] + 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    words = ", ".join(str(low) if low == high else f"{low}-{high}" for low, high in found)
    return f"line{'s' if len(numbers) > 1 else ''} {words}"
