"""Texts of a running campaign: the row in progress, its power, its duration."""

from collections.abc import Iterable, Sequence
from typing import Any

from rig.presentation.phrases import plan_end_text
from rig.realtime.sequence import NO_ROW, Phase
from rig.row_contents import Column
from rig.stations import Station

LogRow = dict[str, float | int]


def row_text(plan: Any, log_row: LogRow, columns: Iterable[Column]) -> str:
    """Return number, phase and set point of the row in progress; ``columns``: those shown."""
    row = int(log_row["plan.row"])
    phase = Phase(int(log_row["plan.phase"])).name.lower().replace("_", "-")
    count = len(plan.rows)
    if phase == Phase.DONE.name.lower():
        return plan_end_text(log_row, count)
    if phase == Phase.MANUAL.name.lower():
        return f"{phase}   set point {int(log_row['plan.live'])}"
    if row == NO_ROW:
        return f"- of {count}   {phase}"
    setting = plan.rows[row].setting
    values = "   ".join(
        f"{each.heading or each.label} {getattr(setting, each.name):g} "
        f"{each.unit.replace('*', ' ')}"
        for each in columns
    )
    return f"{row} ({row + 1} of {count})   {phase}   {values}"


def total_duration(plan: Any, row: LogRow) -> float:
    """Return the duration of the run (s): as planned, plus the wait before the waves."""
    waves = float(row.get("plan.wave_clock", -1.0))
    if waves < 0.0:
        return float(plan.duration)
    wait_before_waves = float(row["time"]) - waves
    return float(plan.duration + max(0.0, wait_before_waves - (plan.duration - plan.wave_seconds)))


def power_text(row: LogRow, measured: LogRow, stations: Sequence[Station]) -> str:
    """Return the mean powers of the measured part of a row so far, or of the last row."""
    if row["power.samples"] > 0:
        return f"so far {_mean_power_text(row, stations)}"
    if not measured:
        return "not measuring"
    return f"row {int(measured['plan.row'])} when last seen {_mean_power_text(measured, stations)}"


def _mean_power_text(row: LogRow, stations: Sequence[Station]) -> str:
    return "   ".join(
        f"{row[f'power.mean_{station.name}']:+8.2f} W {station.name_in_text}"
        for station in stations
        if station.running_mean
    )
