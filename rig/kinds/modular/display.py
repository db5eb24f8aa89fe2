"""Texts of a modular rig's campaign for people: the report of `rig check`, and a run in progress."""

from rig.presentation.campaign_text import total_duration

__all__ = ["detail_lines", "plan_position", "short_text", "show_report", "total_duration"]

LogRow = dict[str, float | int]
