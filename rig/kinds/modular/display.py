"""Texts of a modular rig's campaign: the report of `rig check`, and a run in progress."""

from typing import Any

from rig.campaign import CheckReport
from rig.kinds.modular.campaign import COLUMNS
from rig.kinds.modular.tick.composition import ROTATION
from rig.log_fields import LogFields, axis_labels
from rig.presentation import campaign_text
from rig.presentation.campaign_text import ShownField, fields_text, power_text, row_text

LogRow = dict[str, float | int]

total_duration = campaign_text.total_duration


def log_fields(rig: Any) -> LogFields:
    """Return the labels of axes and sensors; the limits of both need no declaration."""
    labels: dict[str, str] = {}
    for name, axis in rig.axes.items():
        labels |= axis_labels(name, rotary=axis.motion == ROTATION)
    for name, sensor in rig.sensors.items():
        label = sensor.label or name.replace("_", " ")
        labels |= {name: label, f"{name}.value": label}
    return LogFields(labels)


def show_report(report: CheckReport, *, every_row: bool) -> None:
    """Print the report of `rig check`; the command adds the simulated rows."""
    print(report.text())


def plan_position(plan: Any, row: LogRow) -> tuple[str, str]:
    """Return a label and the text of the position in the plan."""
    laws = plan.axis_laws.values()
    columns = COLUMNS.first_and(column for each in laws for column in each.needed_columns)
    return "row", row_text(plan, row, columns, laws)


def detail_lines(plan: Any, row: LogRow, measured: LogRow) -> list[tuple[str, str]]:
    """Return motion, force and current of each axis, and the power."""
    labels = log_fields(plan.rig).labels
    return [
        *(
            (name, fields_text(row, _shown(name, axis.motion), labels, name))
            for name, axis in plan.rig.axes.items()
        ),
        ("power", short_text(plan, row, measured)),
    ]


def short_text(plan: Any, row: LogRow, measured: LogRow) -> str:
    """Return the mean powers of the row."""
    return power_text(plan, row, measured, plan.rig.power_stations)


def _shown(axis: str, motion: str) -> tuple[ShownField, ...]:
    length, force = ("rad", "N·m") if motion == ROTATION else ("m", "N")
    return (
        ShownField(f"{axis}.estimate.position", "+8.4f", length),
        ShownField(f"{axis}.estimate.velocity", "+7.3f", f"{length}/s"),
        ShownField(f"{axis}.command.force", "+9.1f", force),
        ShownField(f"{axis}.command.current", "+6.2f", "A"),
    )
