"""Texts of a modular rig's campaign: the report of `rig check`, and a run in progress."""

from typing import Any

from rig.campaign import CheckReport
from rig.kinds.modular.campaign import COLUMNS
from rig.presentation.campaign_text import power_text, row_text, total_duration
from rig.stations import Station

__all__ = ["detail_lines", "plan_position", "short_text", "show_report", "total_duration"]

LogRow = dict[str, float | int]
_ESTIMATE = ".estimate.position"
_MEAN = "power.mean_"


def show_report(report: CheckReport, *, every_row: bool) -> None:
    """Print the report of `rig check`; the command adds the simulated rows."""
    print(report.text())


def plan_position(plan: Any, row: LogRow) -> tuple[str, str]:
    """Return a label and the text of the position in the plan."""
    gains = [column for each in plan.axis_laws.values() for column in each.columns]
    return "row", row_text(plan, row, COLUMNS.required(gains))


def detail_lines(plan: Any, row: LogRow, measured: LogRow) -> list[tuple[str, str]]:
    """Return motion, force and current of each axis, and the power."""
    axes = [name.removesuffix(_ESTIMATE) for name in row if name.endswith(_ESTIMATE)]
    lines = [
        (
            axis,
            f"x {row[f'{axis}.estimate.position']:+8.4f}   "
            f"v {row[f'{axis}.estimate.velocity']:+7.3f}   "
            f"F {row[f'{axis}.command.force']:+9.1f}   "
            f"i {row[f'{axis}.command.current']:+6.2f} A",
        )
        for axis in axes
    ]
    return [*lines, ("power", short_text(plan, row, measured))]


def short_text(plan: Any, row: LogRow, measured: LogRow) -> str:
    """Return the mean powers of the row."""
    names = [name.removeprefix(_MEAN) for name in row if name.startswith(_MEAN)]
    stations = [Station(name, "", name, name, name, running_mean=True) for name in names]
    return power_text(row, measured, stations)
