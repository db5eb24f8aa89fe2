"""The set points that people choose, for every kind of rig.

`LiveColumns` is what a kind provides. Its parts: the signal generator's keys, checks of values
against described ranges, and the file of kept rows.
"""

import itertools
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from controllers import signal_generator

Row = tuple[Mapping[str, float | str], str]  # values by key of the column, and a comment
Description = dict[str, Any]
"""Key, label, unit, range and part of a column, as of `LiveColumns.describe`."""

_MAX_FREQUENCY_SHARE = 0.1  # of the tick rate: ten samples a period
_MAX_SWEEP_S = 3600.0
_TIMES: dict[str, float] = {"frequency_hz": 0.5, "end_frequency_hz": 1.0, "sweep_s": 60.0}


class RefusedError(ValueError):
    """The request cannot be carried out; the message says why."""


class LiveSet(NamedTuple):
    """A whole set point that people chose."""

    values: dict[str, Any]  # by key of the column: a number, or a name where it has names
    signal: dict[str, Any]  # of the signal generator


class Checked(NamedTuple):
    """The numbers of a set point, or the reasons why it was refused."""

    numbers: tuple[float, ...]
    problems: tuple[str, ...] = ()


class Kept(NamedTuple):
    """A set point that became a row of a file."""

    path: str
    left_out: str = ""  # what a row cannot have, and why; empty: nothing is left out


class LiveColumns(Protocol):
    """The set points that people may choose, of a kind of rig."""

    def describe(self) -> list[dict[str, Any]]:
        """Return key, label, unit and allowed range of each column."""

    def first(self) -> LiveSet:
        """Return the set point to begin with."""

    def of_row(self, row: int) -> LiveSet:
        """Return the set point of a row of the plan."""

    @property
    def moving_s(self) -> float:
        """The time (s) for which a part may still move after a change of set points."""

    def check(self, chosen: LiveSet, before: Sequence[LiveSet] = ()) -> Checked:
        """Return the numbers for the loop, after all checks of ranges, limits and stability.

        ``before``: set points from which parts may still be moving.
        """

    def left_behind(self, before: Sequence[LiveSet], row: int) -> str:
        """Return why a row cannot go on after these set points; empty if it can."""

    def keep(self, chosen: LiveSet, comment: str) -> Kept:
        """Append a set point to the campaign file of kept rows."""


class Amplitude(NamedTuple):
    """An amplitude of the signal generator."""

    key: str
    label: str
    unit: str
    largest: float


def no_signal(amplitudes: Iterable[str] = ("amplitude",)) -> dict[str, Any]:
    """Return the signal generator at rest, with these keys of amplitudes."""
    return {"kind": "none", **dict.fromkeys(amplitudes, 0.0), **_TIMES}


def signal_numbers(signal: Mapping[str, Any], amplitude: float) -> signal_generator.SetPoint:
    """Return a signal as the loop uses it, with an amplitude in the loop's unit."""
    kind = float(signal_generator.KINDS.index(signal["kind"]))
    return signal_generator.SetPoint(kind, amplitude, *(float(signal[key]) for key in _TIMES))


def describe_signal(amplitudes: Iterable[Amplitude], rate_hz: float) -> list[Description]:
    """Return the columns of the signal generator."""
    frequency = _MAX_FREQUENCY_SHARE * rate_hz
    kinds = describe_choice("kind", "signal", signal_generator.KINDS, "signal")
    entries = [
        *amplitudes,
        Amplitude("frequency_hz", "frequency", "Hz", frequency),
        Amplitude("end_frequency_hz", "end frequency", "Hz", frequency),
    ]
    columns = [describe(*each[:3], 0.0, each.largest, "signal") for each in entries]
    sweep = describe("sweep_s", "sweep", "s", 1.0, _MAX_SWEEP_S, "signal")
    return [kinds, *columns, sweep]


def describe(
    key: str, label: str, unit: str, low: float | None, high: float | None, part: str = "values"
) -> Description:
    """Return the description of a column; a bound that is None is none."""
    return {"key": key, "label": label, "unit": unit, "low": low, "high": high, "part": part}


def describe_choice(
    key: str, label: str, choices: Iterable[str], part: str = "values"
) -> Description:
    """Return the description of a column with names in place of numbers."""
    return {"key": key, "label": label, "choices": list(choices), "part": part}


def field_range(constraints: Iterable[Any]) -> tuple[float | None, float | None]:
    """Return the bounds among the constraints of a file's value; None for one that is missing."""
    bounds: dict[str, float] = {}
    for constraint in constraints:
        for each in getattr(constraint, "metadata", ()):
            for name in ("ge", "gt", "le", "lt"):
                if hasattr(each, name):
                    bounds[name] = float(getattr(each, name))
    return bounds.get("ge", bounds.get("gt")), bounds.get("le", bounds.get("lt"))


def unknown(part: str, given: Mapping[str, Any], known: Iterable[str]) -> Iterator[str]:
    """Yield a problem for each key that a part of a set point does not have."""
    names = sorted(known) if part == "values" else list(known)
    for key in given:
        if key not in names:
            kind = "column" if part == "values" else "key"
            yield f"{_name(part, key)}: no such {kind}; known are {', '.join(names)}"


def outside(columns: Iterable[Description], given: Mapping[str, Any]) -> Iterator[str]:
    """Yield a problem for each value of a part that is no number of its range, or no choice."""
    for column in columns:
        value, name = given.get(column["key"]), _name(column["part"], column["key"])
        if "choices" in column:
            if value not in column["choices"]:
                yield f"{name}: {value!r}; allowed {', '.join(column['choices'])}"
        elif not is_number(value) or not column["low"] <= float(value or 0.0) <= column["high"]:
            allowed = f"{column['low']:g} .. {column['high']:g} {column['unit']}"
            yield f"{name}: {value!r}; allowed {allowed}"


def is_number(value: Any) -> bool:
    """Return whether a value is a finite number."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= sys.float_info.max  # of any integer


def _name(part: str, key: str) -> str:
    return key if part == "values" else f"{part}.{key}"


class KeptRows:
    """The file of the rows that people keep; it replaces no file that was there before."""

    def __init__(
        self,
        path: Path,
        text: Callable[[Path, Sequence[Row]], str],
        problems: Callable[[Path], Iterable[str]] = lambda path: (),
    ) -> None:
        """``text`` returns that of a file with rows; ``problems``: of a file that was written."""
        self._path, self._text, self._problems = path, text, problems
        self._rows: list[Row] = []

    def add(self, values: Mapping[str, float | str], comment: str) -> str:
        """Add a row and return the path; RefusedError if the file would have problems."""
        printable = "".join(each if each.isprintable() else " " for each in comment)
        text = " ".join(printable.split()) or f"kept as row {len(self._rows)}"
        rows = [*self._rows, (values, text)]
        path = self._path if self._rows else _unused(self._path)
        new = path.with_name(f".{path.name}.new")
        new.write_text(self._text(path, rows))
        if found := list(self._problems(new)):
            new.unlink()
            raise RefusedError("; ".join(found))
        new.replace(path)
        self._path, self._rows = path, rows
        return str(path)


def _unused(path: Path) -> Path:
    """Return the path, or with a number in its name if there is a file already."""
    names = (f"{path.stem}_{number}{path.suffix}" for number in itertools.count(2))
    paths = itertools.chain([path], map(path.with_name, names))
    return next(each for each in paths if not each.exists())
