"""Rows that ended early by the power of one station, and what their marks mean."""

import xarray

from rig.analysis.row_ends import END_REASON, END_STATION, PRECISE, WORSE
from rig.analysis.rows import stations_of
from rig.config.problems import format_rows
from rig.stations import find


def ended_as_worse(table: xarray.Dataset) -> list[int]:
    """Return the ids of the rows that could no longer be the best; [] with fixed times."""
    return _ended(table, WORSE)


def _ended(table: xarray.Dataset, reason: str) -> list[int]:
    if END_REASON not in table:
        return []
    return [int(row) for row in table["row"].values[table[END_REASON].values == reason]]


def cut_note(table: xarray.Dataset) -> str:
    """Return what the mark of such rows means, for legends; empty without any."""
    return mark_meaning(_station(table)) if ended_as_worse(table) else ""


def mark_meaning(station: str) -> str:
    """Return the meaning of the mark of a row that ended by the power of a station."""
    return f"ended early: could no longer be the best at {station}; larger errors at all stations"


def cut_message(table: xarray.Dataset) -> str:
    """Return which rows ended early, and what follows for other stations; empty without any."""
    worse, precise = (_ended(table, reason) for reason in (WORSE, PRECISE))
    texts = []
    if worse:
        texts.append(
            f"{_begin(worse)} ended early: could no longer be the best at {_station(table)}. Such "
            "powers have larger errors, and the best row of another station may be among these "
            "rows."
        )
    if precise:
        texts.append(
            f"{_begin(precise)} ended when {_station(table)} was precise; powers of other stations "
            "may have larger errors."
        )
    return " ".join(texts)


def _begin(rows: list[int]) -> str:
    text = format_rows(rows)
    return text[0].upper() + text[1:]


def _station(table: xarray.Dataset) -> str:
    """Return label and id of the station by whose power the rows ended."""
    return find(stations_of(table), str(table.attrs[END_STATION])).reference
