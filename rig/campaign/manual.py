"""Set points that people choose while a campaign runs, or in a run in manual mode.

A set point is checked as a row of a campaign file: it is written as the only row of a file that
extends the campaign, and goes through all that `rig check` does, predicted stability included.
"""

import itertools
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, get_args

from controllers import signal_generator
from rig.campaign.check import CheckReport
from rig.campaign.derived_file import derived_name, derived_text, row_text
from rig.campaign.kind import AnyCampaign, AnyPlan
from rig.config.campaign_file import BaseCampaignFile
from rig.config.matrix import law_column_type
from rig.config.problems import Problem
from rig.config.yaml_source import load_mapping
from rig.people.orders import Checked, LiveSet
from rig.realtime.live_setpoints import numbers_at
from rig.realtime.sequence import MEASURE
from rig.row_contents import Column

Row = tuple[Mapping[str, float | str], str]  # values by key of the column, and a comment
Examine = Callable[[Path], CheckReport]
_MAX_FREQUENCY_SHARE = 0.1  # of the tick rate: ten samples a period
_MAX_SWEEP_S = 3600.0
_SIGNAL = ("kind", "amplitude", "frequency_hz", "end_frequency_hz", "sweep_s")
NO_SIGNAL: dict[str, Any] = {
    "kind": "none",
    "amplitude": 0.0,
    "frequency_hz": 0.5,
    "end_frequency_hz": 1.0,
    "sweep_s": 60.0,
}


def text_of_rows(file: Path, path: Path, name: str, rows: Sequence[Row]) -> str:
    """Return the text of a campaign at ``path`` whose matrix has these rows, for manual mode.

    ``file``: the campaign that it extends; or a rig, which is then in calm water.
    """
    mapping, _ = load_mapping(file, inline=("sea", "tank"))
    header = ("Set points of manual mode",)
    if "rig" in mapping:
        return derived_text(file, path, header, [f"name: {json.dumps(name)}", "repeat: 1"], rows)
    lines = [
        f"# {header[0]}",
        f"name: {json.dumps(name)}",
        f"rig: {json.dumps(os.path.relpath(file.resolve(), path.resolve().parent))}",
        "sea: {kind: calm}",
        "timing: {settle_s: 1, interval_s: 2}",
        "matrix:",
        "  list:",
    ]
    lines += [f"    - {row_text(values)}  # {comment}" for values, comment in rows]
    return "\n".join(lines) + "\n"


class ManualSetPoints:
    """The columns of a campaign, their checks, and the file of kept rows."""

    def __init__(
        self,
        file: Path,
        campaign: AnyCampaign,
        plan: AnyPlan,
        examine: Examine,
        kept: Path,
        largest_force: float,
    ) -> None:
        """``file``: as of `text_of_rows`; ``kept``: file of the rows that people keep.

        ``largest_force``: amplitude of the signal generator, N or N m.
        """
        self._file, self._campaign, self._plan = file, campaign, plan
        self._examine, self._kept, self._force = examine, kept, largest_force
        self._columns = tuple(_given_columns(campaign))
        self._kept_rows: list[Row] = []

    def describe(self) -> list[dict[str, Any]]:
        """Return key, label, unit and allowed range of each column, then of the signal's parts."""
        file = self._campaign.file
        entries: list[dict[str, Any]] = []
        for column in self._columns:
            entry = {"key": column.key, "label": column.label, "unit": column.unit}
            if column.choices:
                entry = {"key": column.key, "label": column.key.replace("_", " ")}
                entries.append(entry | {"choices": list(column.choices), "part": "values"})
                continue
            low, high = _range(file, column)
            entries.append(entry | {"low": low, "high": high, "part": "values"})
        frequency = _MAX_FREQUENCY_SHARE * self._campaign.rig.rate_hz
        ranges: dict[str, tuple[str, float, float]] = {
            "amplitude": ("N", 0.0, self._force),
            "frequency_hz": ("Hz", 0.0, frequency),
            "end_frequency_hz": ("Hz", 0.0, frequency),
            "sweep_s": ("s", 1.0, _MAX_SWEEP_S),
        }
        kinds = {"key": "kind", "label": "signal", "choices": list(signal_generator.KINDS)}
        entries.append(kinds | {"part": "signal"})
        for key, (unit, low, high) in ranges.items():
            label = key.removesuffix("_hz").removesuffix("_s").replace("_", " ")
            entries.append(
                {"key": key, "label": label, "unit": unit, "low": low, "high": high}
                | {"part": "signal"}
            )
        return entries

    def first(self) -> LiveSet:
        """Return the set point of the first row."""
        return self.of_row(0)

    def of_row(self, row: int) -> LiveSet:
        """Return the set point of a row of the plan, without a signal."""
        setting = self._plan.rows[row].setting
        values: dict[str, float | str] = {}
        for column in self._columns:
            value = float(getattr(setting, column.name))
            values[column.key] = column.choices[int(value)] if column.choices else value
        return LiveSet(values, dict(NO_SIGNAL))

    def check(self, chosen: LiveSet) -> Checked:
        """Return the numbers for the loop, or every reason why they are refused."""
        problems = [*self._unknown(chosen), *self._signal_problems(chosen.signal)]
        if problems:
            return Checked((), tuple(problems))
        with TemporaryDirectory(prefix="wec-rig-") as folder:
            path = Path(folder) / "set_point.yaml"
            path.write_text(self._text(path, [(chosen.values, "")]))
            report = self._examine(path)
            if report.plan is None or report.problems:
                return Checked((), tuple(_reason(each) for each in report.problems))
            plan = report.plan
        at = plan.segments.setpoint[plan.segments.phase.index(MEASURE)]
        signal = chosen.signal
        kind = signal_generator.KINDS.index(signal["kind"])
        numbers = [float(kind), *(float(signal[key]) for key in _SIGNAL[1:])]
        table = plan.setpoints._replace(signal=tuple((number,) * (at + 1) for number in numbers))
        return Checked(numbers_at(table, at))

    def keep(self, chosen: LiveSet, comment: str) -> str:
        """Append a set point to the file of kept rows, a campaign; return its path."""
        text = " ".join(comment.split()) or f"kept as row {len(self._kept_rows)}"
        rows = [*self._kept_rows, (chosen.values, text)]
        if not self._kept_rows:
            self._kept = _unused(self._kept)
        path = self._kept
        new = path.with_name(f".{path.name}.new")
        new.write_text(self._text(path, rows))
        new.replace(path)
        self._kept_rows = rows
        return str(path)

    def _text(self, path: Path, rows: Sequence[Row]) -> str:
        name = derived_name(self._campaign.file.name, "-kept")
        return text_of_rows(self._file, path, name, rows)

    def _unknown(self, chosen: LiveSet) -> Iterator[str]:
        known = {column.key: column.choices for column in self._columns}
        for key, value in chosen.values.items():
            if key not in known:
                yield f"{key}: no such column; known are {', '.join(sorted(known))}"
            elif not _is_number(value) and not known[key]:
                yield f"{key}: {value!r} is not a finite number"
        for key in chosen.signal:
            if key not in _SIGNAL:
                yield f"signal.{key}: no such key; known are {', '.join(_SIGNAL)}"

    def _signal_problems(self, signal: dict[str, Any]) -> Iterator[str]:
        for entry in self.describe():
            if entry["part"] != "signal":
                continue
            key, value = entry["key"], signal.get(entry["key"])
            if "choices" in entry:
                if value not in entry["choices"]:
                    yield f"signal.{key}: {value!r}; allowed {', '.join(entry['choices'])}"
            elif not _is_number(value) or not entry["low"] <= float(value or 0.0) <= entry["high"]:
                allowed = f"{entry['low']:g} .. {entry['high']:g} {entry['unit']}"
                yield f"signal.{key}: {value!r}; allowed {allowed}"


def _given_columns(campaign: AnyCampaign) -> Iterator[Column]:
    """Yield the columns that this rig and campaign have."""
    file = campaign.file
    required = {each.key for each in file.kind_columns.required(file.law_columns())}
    required |= {each.key for each in file.law_columns()}
    names = set(campaign.kind.defaults(file, campaign.rig))
    if file.reference is None:
        names -= {"reference_scale", "realisation"}
    else:
        names |= {"reference_scale"}
    for column in file.columns():
        if column.key in required or column.name in names:
            yield column


def _range(file: BaseCampaignFile, column: Column) -> tuple[float | None, float | None]:
    """Return the least and the greatest value allowed of a column; None without a bound."""
    law = next((each for each in file.law_columns() if each.key == column.key), None)
    kind = law_column_type(law) if law is not None else file.kind_columns.types[column.key]
    bounds: dict[str, float] = {}
    for constraint in get_args(kind)[1:]:
        for each in getattr(constraint, "metadata", ()):
            for name in ("ge", "gt", "le", "lt"):
                if hasattr(each, name):
                    bounds[name] = float(getattr(each, name))
    return bounds.get("ge", bounds.get("gt")), bounds.get("le", bounds.get("lt"))


def _unused(path: Path) -> Path:
    """Return the path, or with a number in its name if there is a file already."""
    names = (f"{path.stem}_{number}{path.suffix}" for number in itertools.count(2))
    paths = itertools.chain([path], map(path.with_name, names))
    return next(each for each in paths if not each.exists())


def _reason(problem: Problem) -> str:
    """Return the text of a problem, without the place in the file that people never see."""
    key = problem.key.removeprefix("matrix.list[0].")
    return f"{key}: {problem.message}" if key else problem.message


def _is_number(value: Any) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= sys.float_info.max  # of any integer
