"""Texts of a running campaign: the row in progress, its power, its duration."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from rig.config.law_settings import AxisLaw, value_text
from rig.log_fields import label_of
from rig.presentation.phrases import phase_text, plan_end_text, unit_text
from rig.realtime.sequence import NO_ROW, Phase
from rig.row_contents import Column
from rig.stations import Station

LogRow = dict[str, float | int]


class ShownField(NamedTuple):
    """A log field in a line of a panel."""

    field: str
    form: str  # of its number, as of `format`
    unit: str  # in which it is shown
    scale: float = 1.0  # size of the field's unit in the one shown


def fields_text(
    row: LogRow, fields: Iterable[ShownField], labels: Mapping[str, str], group: str = ""
) -> str:
    """Return log fields with their labels, which leave out the name of the ``group`` in front."""
    return "   ".join(
        f"{label_of(each.field, labels).removeprefix(group).strip()} "
        f"{each.scale * row[each.field]:{each.form}} {each.unit}".strip()
        for each in fields
    )


def row_text(
    plan: Any, log_row: LogRow, columns: Iterable[Column], axis_laws: Iterable[AxisLaw] = ()
) -> str:
    """Return number, phase and set point of the row in progress.

    ``columns``: those shown, without those that the row's ``axis_laws`` do not have.
    """
    row = int(log_row["plan.row"])
    phase = Phase(int(log_row["plan.phase"]))
    count = len(plan.rows)
    if phase is Phase.DONE:
        return plan_end_text(log_row, count)
    if phase is Phase.MANUAL:
        return f"{phase_text(phase)}   set point {int(log_row['plan.live'])}"
    if row == NO_ROW:
        return f"- of {count}   {phase_text(phase)}"
    values = plan.rows[row].setting._asdict()
    text = set_point_text(columns, values, axis_laws)
    return f"{row} ({row + 1} of {count})   {phase_text(phase)}   {text}"


def set_point_text(
    columns: Iterable[Column], values: Mapping[str, float], axis_laws: Iterable[AxisLaw] = ()
) -> str:
    """Return labels, values and units of a set point; ``values``: by name of the column.

    Columns that the ``axis_laws`` that act do not have are left out.
    """
    texts = ((each, value_text(axis_laws, each, values)) for each in columns)
    return "   ".join(
        f"{each.label} {text} {unit_text(each.unit)}".strip() for each, text in texts if text != "-"
    )


def total_duration(plan: Any, row: LogRow) -> float:
    """Return the duration of the run (s): as planned, plus the wait before the waves."""
    waves = float(row.get("plan.wave_clock", -1.0))
    if waves < 0.0:
        return float(plan.duration)
    wait_before_waves = float(row["time"]) - waves
    return float(plan.duration + max(0.0, wait_before_waves - (plan.duration - plan.wave_seconds)))


def power_text(plan: Any, row: LogRow, measured: LogRow, stations: Sequence[Station]) -> str:
    """Return the mean powers of the measured part of a row so far, or of the last row.

    A mean over a part of a wave period says nothing about the power, so there is none of it.
    """
    if row["power.samples"] > 0:
        if row["power.samples"] < _period_ticks(plan, int(row["plan.row"])):
            return "measuring the first period"
        return f"so far {_mean_power_text(row, stations)}"
    if not measured:
        return "not measuring"
    return f"row {int(measured['plan.row'])} when last seen {_mean_power_text(measured, stations)}"


def _period_ticks(plan: Any, row: int) -> float:
    """Return the ticks of a period of a planned row, less rounding; 0 with less than two periods.

    A row of one period, as in an irregular sea, has no power before its end; its mean so far is
    over many waves.
    """
    periods = getattr(plan.rows[row], "periods", 0) if 0 <= row < len(plan.rows) else 0
    return plan.rows[row].measure / periods / plan.dt - 0.5 if periods > 1 else 0.0


def _mean_power_text(row: LogRow, stations: Sequence[Station]) -> str:
    return "   ".join(
        f"{row[f'power.mean_{station.name}']:+8.2f} W {station.short_label}"
        for station in stations
        if station.running_mean
    )
