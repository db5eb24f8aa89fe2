"""Texts of a modular rig's campaign: the report of `rig check`, and a run in progress."""

from collections.abc import Sequence
from typing import Any

from rig.analysis.rows import NOT_RUN
from rig.campaign import CheckReport
from rig.kinds.modular.campaign import COLUMNS
from rig.kinds.modular.row_contents import row_contents
from rig.kinds.modular.tick.composition import ROTATION
from rig.presentation.campaign_text import power_text, row_text, total_duration
from rig.row_contents import LAW, Column, X, Y
from rig.stations import Station

__all__ = ["detail_lines", "plan_position", "short_text", "show_report", "total_duration"]

LogRow = dict[str, float | int]
_ESTIMATE = ".estimate.position"
_MEAN = "power.mean_"
_SHOWN_ROWS = 12


def show_report(report: CheckReport, *, every_row: bool) -> None:
    """Print the report of `rig check`, with the first simulated rows or all."""
    print(report.text())
    if report.prediction is None or report.campaign is None:
        return
    rows = report.prediction.as_dict()["simulated"]
    shown = rows if every_row else rows[:_SHOWN_ROWS]
    rig = report.campaign.rig
    contents = row_contents(rig, report.campaign.file.columns())
    rotates = rig.axes[contents.axis].motion == ROTATION
    units = ("rad", "N*m") if rotates else ("m", "N")
    gains = [each for each in contents.columns if each.role in (X, Y, LAW)]
    print("\nsimulated rows")
    for row in shown:
        print(f"{row['row']:5} {_simulated_text(row, gains, contents.stations, units)}")
    if len(shown) < len(rows):
        print(f"      and {len(rows) - len(shown)} more; --rows shows all")


def _simulated_text(
    row: Any, gains: Sequence[Column], stations: Sequence[Station], units: tuple[str, str]
) -> str:
    """Return set point, motion, force, current and powers of a simulated row."""
    if row["state"] == NOT_RUN:
        return f"{row['state']}: {row['incomplete_reason']}"
    settings = "  ".join(f"{each.heading or each.label} {row[each.name]:g}" for each in gains)
    powers = "  ".join(f"{each.heading} {row[f'power_{each.name}']:.4g} W" for each in stations)
    length, force = units
    motion = f"stroke {row['stroke']:.3g} {length}  F rms {row['force_rms']:.4g} {force}"
    cut = f"  {row['incomplete_reason']}" if row["incomplete_reason"] else ""
    return f"{settings}  {motion}  i rms {row['current_rms']:.3g} A  {powers}{cut}"


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
