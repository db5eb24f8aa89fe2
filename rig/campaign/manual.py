"""Set points that people choose while a campaign runs, or in a run in manual mode.

A set point is checked as a row of a campaign file: it is written as the only row of a file that
extends the campaign, and goes through all that `rig check` does, predicted stability included.
"""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, get_args

from rig.campaign.check import CheckReport
from rig.campaign.derived_file import derived_name, derived_text, row_text
from rig.campaign.kind import AnyCampaign, AnyPlan, CampaignKind
from rig.config.campaign_file import BaseCampaignFile
from rig.config.matrix import law_column_type
from rig.config.problems import ConfigError, Problem, display_path
from rig.config.yaml_source import load_mapping
from rig.people import set_points
from rig.people.set_points import Amplitude, Checked, Kept, KeptRows, LiveSet, Row, field_range
from rig.planning.input_files import ConfigSource, load_named_source
from rig.processes.run_types import Task
from rig.realtime import axis
from rig.realtime.live_setpoints import numbers_at
from rig.realtime.sequence import MEASURE
from rig.row_contents import Column

Examine = Callable[[Path], CheckReport]
_SIGNAL_KEYS = {
    "sine": ("amplitude", "frequency_hz"),
    "step": ("amplitude",),
    "chirp": ("amplitude", "frequency_hz", "end_frequency_hz", "sweep_s"),
}


def write_task(
    kinds: CampaignKind, file: Path, path: Path, drive: str = "", *, clamped: bool = False
) -> None:
    """Write the campaign for manual mode of a rig or of a campaign: one row, all gains zero.

    ``drive``, ``clamped``: as of `rig.kinds.interface.Manual`. Raises ConfigError.
    """
    if drive:
        message = "the drives of this kind of rig have one loop; leave --drive out"
        raise ConfigError([Problem(display_path(file), 1, "", drive, message)])
    if clamped:
        message = "this kind of rig has no shaft to clamp; leave --clamped out"
        raise ConfigError([Problem(display_path(file), 1, "", "clamped", message)])
    mapping, _ = load_mapping(file, inline=("sea", "tank"))
    name = derived_name(str(mapping.get("name", "") if "rig" in mapping else file.stem), "-manual")
    path.write_text(text_of_rows(file, path, name, [({}, "")]))
    campaign = ConfigSource(*load_mapping(path, inline=("sea", "tank")))
    rig = load_named_source(campaign, ("rig",))
    assert rig is not None, "the kind of rig was found by it"
    model = kinds.model(kinds.find_laws(campaign, rig), rig.mapping)
    columns = model.kind_columns.required(model.law_columns())
    row = ({column.key: 0.0 for column in columns}, "all gains zero")
    path.write_text(text_of_rows(file, path, name, [row]))


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


def live_columns(
    task: Task, campaign: AnyCampaign, plan: AnyPlan, file: Path, examine: Examine, kept: Path
) -> "ManualSetPoints | None":
    """Return the set points of a run of a campaign; as of `rig.kinds.interface.Manual`."""
    if not plan.rows:
        return None
    return ManualSetPoints(file, campaign, plan, examine, kept, _largest_force(task.params.rig))


def _largest_force(params: Any) -> float:
    """Return the largest force of the axis that references and signals excite, N or N m."""
    axes = [each for each in params if isinstance(each, axis.Params)]
    limits = axes[params.reference_axis].limits
    return float(limits.current_peak * limits.newtons_per_ampere)


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
        self._file, self._campaign, self._plan, self._examine = file, campaign, plan, examine
        self._columns = tuple(_given_columns(campaign))
        amplitudes = [Amplitude("amplitude", "amplitude", "N", largest_force)]
        self._signal = set_points.describe_signal(amplitudes, campaign.rig.rate_hz)
        self._kept = KeptRows(kept, self._text)

    def describe(self) -> list[dict[str, Any]]:
        file = self._campaign.file
        values = [
            set_points.describe_choice(each.key, each.key.replace("_", " "), each.choices)
            if each.choices
            else set_points.describe(each.key, each.label, each.unit, *_range(file, each))
            for each in self._columns
        ]
        return values + self._signal

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
        return LiveSet(values, set_points.no_signal())

    @property
    def moving_s(self) -> float:
        """The time (s) for which a part may still move after a change of set points."""
        file, rig, setting = self._campaign.file, self._campaign.rig, self._plan.rows[0].setting
        return self._campaign.kind.prepare(file, rig, setting).timeout

    def left_behind(self, before: Sequence[LiveSet], row: int) -> str:
        """Return why a row cannot go on after these set points: a part is not at its place."""
        first = self._campaign.file.kind_columns.first
        if first is None or first.actuator is None:
            return ""
        own = self.of_row(row).values[first.key]
        if all(each.values[first.key] == own for each in before):
            return ""
        return (
            f"{first.actuator.label} was moved: set {first.key}={own:g} first, and wait "
            f"{self.moving_s:g} s, the longest time that it takes"
        )

    def check(self, chosen: LiveSet, before: Sequence[LiveSet] = ()) -> Checked:
        """Return the numbers for the loop, or every reason why they are refused.

        ``before``: set points from which parts may still be moving.
        """
        problems = [
            *self._unknown(chosen),
            *set_points.unknown("signal", chosen.signal, (each["key"] for each in self._signal)),
            *set_points.outside(self._signal, chosen.signal),
        ]
        if problems:
            return Checked((), tuple(problems))
        with TemporaryDirectory(prefix="wec-rig-") as folder:
            path = Path(folder) / "set_point.yaml"
            path.write_text(self._text(path, [(chosen.values, "")]))
            report = self._examine(path)
            if report.plan is None or report.problems:
                return Checked((), tuple(_reason(each) for each in report.problems))
            plan = report.plan
        if problems := [*self._while_moving(plan.rows[0].setting, before)]:
            return Checked((), tuple(problems))
        at = plan.segments.setpoint[plan.segments.phase.index(MEASURE)]
        numbers = set_points.signal_numbers(chosen.signal, float(chosen.signal["amplitude"]))
        table = plan.setpoints._replace(signal=tuple((number,) * (at + 1) for number in numbers))
        return Checked(numbers_at(table, at))

    def _while_moving(self, after: Any, before: Sequence[LiveSet]) -> Iterator[str]:
        """Yield a problem for each value that must wait until a part has moved."""
        kind, file, rig = self._campaign.kind, self._campaign.file, self._campaign.rig
        named = {column.key: column for column in self._columns if not column.choices}
        for each in before:
            values = {named[key].name: value for key, value in each.values.items() if key in named}
            wait = kind.move(file, rig, after._replace(**values), after, 0.0)
            if wait is None:
                continue
            for key, column in named.items():
                value, allowed = getattr(after, column.name), getattr(wait.setting, column.name)
                if value != allowed:
                    yield (
                        f"{key}: {value:g} is allowed up to {allowed:g} until a part that moves "
                        f"from the set point before is at its place, at most {self.moving_s:g} s"
                    )

    def keep(self, chosen: LiveSet, comment: str) -> Kept:
        """Append a set point to the file of kept rows, a campaign, without its signal."""
        signal = chosen.signal
        if signal["kind"] == "none" or signal["amplitude"] == 0.0:
            return Kept(self._kept.add(chosen.values, comment))
        shown = [each for each in self._signal if each["key"] in _SIGNAL_KEYS[signal["kind"]]]
        numbers = (f"{each['label']} {signal[each['key']]:g} {each['unit']}" for each in shown)
        without = f"its signal ({', '.join([signal['kind'], *numbers])})"
        path = self._kept.add(chosen.values, f"{comment}, without {without}".removeprefix(", "))
        return Kept(path, f"{without}: the rows of a campaign have one `reference` for all")

    def _text(self, path: Path, rows: Sequence[Row]) -> str:
        name = derived_name(self._campaign.file.name, "-kept")
        return text_of_rows(self._file, path, name, rows)

    def _unknown(self, chosen: LiveSet) -> Iterator[str]:
        known = {column.key: column.choices for column in self._columns}
        yield from set_points.unknown("values", chosen.values, known)
        for key, value in chosen.values.items():
            choices = known.get(key)
            if choices and value not in choices:
                yield f"{key}: {value!r}; allowed {', '.join(choices)}"
            elif choices == () and not set_points.is_number(value):
                yield f"{key}: {value!r} is not a finite number"


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
    return field_range(get_args(kind)[1:])


def _reason(problem: Problem) -> str:
    """Return the text of a problem, without the place in the file that people never see."""
    key = problem.key.removeprefix("matrix.list[0].")
    return f"{key}: {problem.message}" if key else problem.message
