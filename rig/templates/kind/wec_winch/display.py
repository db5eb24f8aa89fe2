"""Texts for people, before and during a run."""

from typing import Any

from rig.log_fields import FieldLimit, LogFields, axis_labels, axis_limits

LogRow = dict[str, float | int]


def log_fields(rig: Any) -> LogFields:
    limits = FieldLimit("slack_stop_m", "axis.estimate.position", both=False, label="line slack")
    return LogFields(axis_labels("axis"), (*axis_limits("axis", ""), limits))


def show_report(report: Any, *, every_row: bool) -> None:
    print(report.text())


def plan_position(plan: Any, row: LogRow) -> tuple[str, str]:
    return "hold", f"{int(row['plan.row'])} of {len(plan.rows)}"


def detail_lines(plan: Any, row: LogRow, measured: LogRow) -> list[tuple[str, str]]:
    return [("float", short_text(plan, row, measured))]


def short_text(plan: Any, row: LogRow, measured: LogRow) -> str:
    return f"x {1e3 * row['axis.estimate.position']:+.1f} mm"


def total_duration(plan: Any, row: LogRow) -> float:
    duration: float = plan.duration
    return duration
