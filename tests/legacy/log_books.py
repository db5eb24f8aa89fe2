"""Write test logs of any content in the format of the MASK4 test log."""

from __future__ import annotations

from pathlib import Path

import openpyxl
from openpyxl.styles import PatternFill
from openpyxl.styles.colors import Color

COLUMNS = ("Run ID", "Wave Series #", "Filename", "Waves", "WaveBot", "Notes")
MASK4_LOG = "MASK4_testlog.xlsx"  # measured: see tests/measured_data.py

LEGEND = {
    "slightly unusual run": Color(theme=4, tint=0.6),
    "Serious error during test": Color(rgb="FF8064A2"),  # accent 4 of the theme openpyxl writes
}

Cells = tuple[object, ...]


def fill(colour: Color) -> PatternFill:
    return PatternFill(fill_type="solid", fgColor=colour)


def write_log(
    path: Path, *rows: Cells, columns: Cells = COLUMNS, colours: dict[int, Color] | None = None
) -> Path:
    """Write a log with these rows below its header; ``colours`` by row of the sheet."""
    workbook = openpyxl.Workbook()
    sheet = workbook.active
    sheet.title = "Log"
    sheet.append(columns)
    for row in rows:
        sheet.append(row)
    for number, colour in (colours or {}).items():
        sheet.cell(number, 1).fill = fill(colour)
    legend = workbook.create_sheet("Description")
    for text, colour in LEGEND.items():
        legend.append([f"A {text} in some words."])
        legend.cell(legend.max_row, 1).fill = fill(colour)
    workbook.save(path)
    return path
