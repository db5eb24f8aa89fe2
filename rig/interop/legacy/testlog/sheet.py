"""Read the spreadsheet of a test log: its rows as text, and the meaning of their colours."""

import re
from pathlib import Path
from typing import Any, NamedTuple

from rig.interop.legacy.table import MAX_ROWS, file_error, open_workbook
from rig.interop.legacy.testlog.entry import Cell, Condition

COLUMNS = ("Run ID", "Wave Series #", "Filename", "Waves", "WaveBot", "Notes")

_LEGEND = (
    ("slightly unusual", Condition.UNUSUAL),
    ("not included in MHKDR", Condition.NOT_UPLOADED),
    ("Wave data stops", Condition.WAVES_END_EARLY),
    ("very unusual", Condition.VERY_UNUSUAL),
    ("minor error", Condition.COMPROMISED),
    ("Serious error", Condition.SERIOUS),
)
_THEME = re.compile(
    rb"<a:(dk1|lt1|dk2|lt2|accent[1-6])>\s*"
    rb"<a:(?:srgbClr val|sysClr [^>]*lastClr)=\"([0-9A-Fa-f]{6})"
)
_THEME_ORDER = ("lt1", "dk1", "lt2", "dk2", *(f"accent{i}" for i in range(1, 7)))

Colour = tuple[str, float]  # RRGGBB and the tint on it


class SheetRow(NamedTuple):
    """A row of the log as text."""

    row: int
    cells: tuple[Cell, ...]  # one for each of `COLUMNS`
    condition: Condition


def read_sheet(path: Path, data: bytes) -> tuple[SheetRow, ...]:
    """Return all rows below the header that are not blank.

    Raises `ConfigError` if the file is not a workbook, or if no sheet has the columns of a log.
    """
    with open_workbook(path, data) as book:
        sheets = book.worksheets
    for sheet in sheets:
        columns_at = _find_columns(sheet)
        if columns_at is not None:
            break
    else:
        raise file_error(path, f"no sheet has the columns of a test log: {', '.join(COLUMNS)}")
    if sheet.max_row > MAX_ROWS:
        raise file_error(path, f"{sheet.max_row} rows; allowed at most {MAX_ROWS}")
    theme = _theme_colours(book.loaded_theme)
    legend = _read_legend([other for other in sheets if other is not sheet], theme)
    rows = []
    for line in sheet.iter_rows(min_row=2):
        first = line[columns_at[0]]
        cells = tuple(Cell(line[i].coordinate, _cell_text(line[i].value)) for i in columns_at)
        if any(cell.text.strip() for cell in cells):
            colour = _fill_colour(first, theme)
            condition = Condition.PLAIN if colour is None else legend.get(colour, Condition.UNKNOWN)
            rows.append(SheetRow(first.row, cells, condition))
    return tuple(rows)


def _find_columns(sheet: Any) -> tuple[int, ...] | None:
    """Return the index (from 0) of each of `COLUMNS`; None if the first row lacks one."""
    first = next(iter(sheet.iter_rows(min_row=1, max_row=1, values_only=True)), ())
    names = [" ".join(_cell_text(value).lower().split()) for value in first]
    required = [name.lower() for name in COLUMNS]
    if any(name not in names for name in required):
        return None
    return tuple(names.index(name) for name in required)


def _cell_text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value)


def _theme_colours(text: bytes | None) -> dict[int, str]:
    """Return the colours of the workbook's theme by number (ECMA-376 part 1, 20.1.6.2, 18.8.3)."""
    by_name = {name.decode(): rgb.decode().upper() for name, rgb in _THEME.findall(text or b"")}
    return {i: by_name[name] for i, name in enumerate(_THEME_ORDER) if name in by_name}


def _fill_colour(cell: Any, theme: dict[int, str]) -> Colour | None:
    fill = cell.fill
    if fill is None or fill.fill_type != "solid":
        return None
    colour = fill.fgColor
    if colour.type == "theme":
        return theme.get(colour.theme, f"theme {colour.theme}"), round(colour.tint, 3)
    if colour.type == "rgb":
        return str(colour.rgb)[-6:].upper(), round(colour.tint, 3)
    return f"indexed {colour.indexed}", 0.0


def _read_legend(sheets: list[Any], theme: dict[int, str]) -> dict[Colour, Condition]:
    """Return the conditions of the colours that another sheet of the workbook explains."""
    legend = {}
    for sheet in sheets:
        for row in sheet.iter_rows(max_row=200, max_col=1):
            text = _cell_text(row[0].value)
            colour = _fill_colour(row[0], theme)
            for label, condition in _LEGEND:
                if colour is not None and label.lower() in text.lower():
                    legend[colour] = condition
    return legend
