"""Read a test log: every row of the sheet is an entry or a separator between entries."""

import hashlib
import re
from collections import Counter
from collections.abc import Iterable
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from rig.config.problems import ConfigError, Problem, display_path
from rig.interop.legacy.table import MAX_ROWS, file_error, open_workbook, read_bytes
from rig.interop.legacy.testlog.entry import (
    Activity,
    Bias,
    Cell,
    Condition,
    Entry,
    Remark,
    RemarkKind,
    Separator,
    WaveKind,
)
from rig.interop.legacy.testlog.settings import read_bias, read_notes, read_settings, read_waves
from rig.recording.calibration import RecordingTime
from rig.recording.calibration_changes import RecordedValue

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


_RUN = re.compile(r"\s*([A-Za-z][A-Za-z0-9]*)_(\d{1,6})\s*")
_FILE = re.compile(r"\w+?_(\d{4})_(\d\d)_(\d\d)_(\d\d)_(\d\d)_(\d\d)")
_PARTIAL = re.compile(r"\w+?_\d{4}_\d\d_\d\d_\w*")
_CUSTOM = re.compile(r"custom drive", re.IGNORECASE)

_CLOSE_RATES = 0.01  # relative; spring rates closer than this are suspected to be equal
_MAX_RARE_RUNS = 2  # ... if one of them occurs in at most this many runs


class RunLog(NamedTuple):
    """A test log."""

    path: Path
    sha256: str
    entries: tuple[Entry, ...]  # in the order of the sheet
    separators: tuple[Separator, ...]

    def find(self, run: int) -> Entry:
        """Return the entry of a run; raise KeyError with the range of runs if it is missing."""
        for entry in self.entries:
            if entry.run == run:
                return entry
        runs = [entry.run for entry in self.entries]
        raise KeyError(f"no run {run} in the log; it has {min(runs)} .. {max(runs)}")


class _DriveInUse(NamedTuple):
    """The drive in use until a row names another one."""

    name: str
    source: str  # cell that names it
    from_run: bool  # the cell belongs to a run, not to a separator


def read_log(path: Path) -> RunLog:
    """Read a test log from its workbook.

    Raises `ConfigError` if the file cannot be read, if it has no entry, and for invalid and
    repeated run IDs. Every other irregularity becomes a remark of its entry.
    """
    path = Path(path)
    data = read_bytes(path)
    rows = read_sheet(path, data)
    run_ids = _run_ids(path, rows)
    entries: list[Entry] = []
    separators = []
    drive = _DriveInUse("COTS", "from the start", from_run=False)
    for i, row in enumerate(rows):
        run_id = run_ids[i]
        if run_id is None:
            separator = _separator(row, run_ids[i + 1 :])
            separators.append(separator)
            if _CUSTOM.search(separator.text):
                drive = _DriveInUse("custom", separator.cell, from_run=False)
            continue
        entry = _entry(row, run_id, drive)
        if entry.drive != drive.name:
            drive = _DriveInUse(entry.drive, entry.drive_source, from_run=True)
        entries.append(entry)
    digest = hashlib.sha256(data).hexdigest()
    return RunLog(path, digest, _add_comparisons(tuple(entries)), tuple(separators))


def _separator(row: SheetRow, later_runs: list[tuple[str, int] | None]) -> Separator:
    filled = [cell for cell in row.cells if cell.text.strip(" *")]
    following = next((run[1] for run in later_runs if run is not None), 0)
    text = " / ".join(cell.text.strip() for cell in filled)
    return Separator(row.row, (filled or row.cells)[0].name, text, following)


def _run_ids(path: Path, rows: tuple[SheetRow, ...]) -> list[tuple[str, int] | None]:
    """Return series and number of each row's run, None for a separator."""
    run_ids: list[tuple[str, int] | None] = []
    problems = []
    seen: dict[tuple[str, int], int] = {}
    for row in rows:
        text = row.cells[0].text
        match = _RUN.fullmatch(text)
        if match is None:
            if any(c.isalnum() for c in text):
                message = f"{text!r} is not a run ID; allowed as MASK4_001"
                problems.append(Problem(display_path(path), row.row, "Run ID", text, message))
            run_ids.append(None)
            continue
        key = (match[1], int(match[2]))
        if key in seen:
            message = f"{text.strip()} occurs twice, first in row {seen[key]}"
            problems.append(Problem(display_path(path), row.row, "Run ID", text, message))
        seen.setdefault(key, row.row)
        run_ids.append(key)
    if not seen and not problems:
        problems.append(Problem(display_path(path), 1, "Run ID", None, "no run in the log"))
    if problems:
        raise ConfigError(problems)
    return run_ids


def _entry(row: SheetRow, run_id: tuple[str, int], drive: _DriveInUse) -> Entry:
    run, series, file, waves, wavebot, notes = row.cells
    remarks = []
    if run.text != run.text.strip():
        remarks.append(run.remark(RemarkKind.RUN_ID_SPACES, repr(run.text)))
    file_name, recorded = _parse_file_name(file, remarks)
    parsed = read_waves(waves.text)
    remarks += [waves.remark(kind, text) for kind, text in parsed.remarks]
    has_waves = any(wave.kind is not WaveKind.CALM for wave in parsed.waves)
    wave_series = _parse_series(series, remarks, has_waves=has_waves)
    settings = read_settings(wavebot, notes, remarks)
    if not settings["drive"]:
        settings |= {"drive": drive.name, "drive_source": drive.source}
        if drive.from_run:
            text = f"{drive.name}, from {drive.source}"
            remarks.append(wavebot.remark(RemarkKind.DRIVE_CARRIED, text))
    if settings["drive"] == "custom" and has_waves and not settings["scheme"]:
        remarks.append(wavebot.remark(RemarkKind.SCHEME_UNSPECIFIED))
    for cell in (waves, wavebot, notes):
        remarks += read_notes(cell)
    if row.condition is Condition.UNKNOWN:
        remarks.append(run.remark(RemarkKind.COLOUR_UNKNOWN, ""))
    biases = (read_bias(wavebot), read_bias(notes))
    return Entry(
        run=run_id[1],
        series_name=run_id[0],
        row=row.row,
        wave_series=wave_series,
        file=file_name,
        recorded=recorded,
        file_text=file.text,
        waves=parsed.waves,
        waves_text=waves.text,
        wavebot_text=wavebot.text,
        notes=notes.text,
        biases=tuple(bias for bias in biases if bias is not None),
        condition=row.condition,
        remarks=tuple(remarks),
        **settings,
    )


def _parse_file_name(file: Cell, remarks: list[Remark]) -> tuple[str, str]:
    """Return the name of a run's record and the time in it; both empty for an invalid name."""
    name = file.text.strip()
    if match := _FILE.fullmatch(name):
        year, month, day, *clock = match.groups()
        return name, f"{year}-{month}-{day}T{':'.join(clock)}"
    kind = RemarkKind.FILE_MISSING
    if name:
        partial = _PARTIAL.fullmatch(name)
        kind = RemarkKind.FILE_PARTIAL if partial else RemarkKind.FILE_NO_NAME
    remarks.append(file.remark(kind))
    return "", ""


def _parse_series(series: Cell, remarks: list[Remark], *, has_waves: bool) -> tuple[int, ...]:
    if not series.text.strip():
        if has_waves:
            remarks.append(series.remark(RemarkKind.SERIES_MISSING))
        return ()
    parts = [part.strip() for part in series.text.split(",")]
    if not all(part.isdecimal() for part in parts):
        remarks.append(series.remark(RemarkKind.SERIES_UNREADABLE, series.text))
        return ()
    if len(parts) > 1:
        remarks.append(series.remark(RemarkKind.SERIES_SEVERAL, series.text))
    return tuple(int(part) for part in parts)


def _add_comparisons(entries: tuple[Entry, ...]) -> tuple[Entry, ...]:
    """Return the entries with the remarks that result from comparing entries."""
    files = Counter(entry.file for entry in entries if entry.file)
    rates = Counter(entry.spring.written_n_per_m for entry in entries if entry.spring)
    compared = []
    newest = ""
    for entry in entries:
        remarks = []
        if files[entry.file] > 1:
            runs = ", ".join(str(other.run) for other in entries if other.file == entry.file)
            remarks.append(Remark(RemarkKind.FILE_SHARED, f"C{entry.row}", f"runs {runs}"))
        if entry.recorded and entry.recorded < newest:
            text = f"{entry.recorded}, after {newest}"
            remarks.append(Remark(RemarkKind.FILE_ORDER, f"C{entry.row}", text))
        newest = max(newest, entry.recorded)
        if entry.spring is not None:
            rate = entry.spring.written_n_per_m
            close = [r for r in rates if r != rate and abs(r - rate) <= _CLOSE_RATES * abs(rate)]
            if close and rates[rate] <= _MAX_RARE_RUNS:
                text = f"{rate:g} N/m here, {', '.join(f'{r:g}' for r in close)} elsewhere"
                remarks.append(Remark(RemarkKind.SPRING_CLOSE, entry.spring.cell, text))
        compared.append(entry._replace(remarks=(*entry.remarks, *remarks)))
    return tuple(compared)


K = TypeVar("K")
V = TypeVar("V")


class Repeat(NamedTuple):
    """Runs of one gain matrix, and the other settings that differ between them."""

    matrix: str
    runs: tuple[int, ...]
    differences: tuple[str, ...]  # of waves, drive, scheme, surge; empty for a plain repetition


class Links(NamedTuple):
    """Runs that belong together, by relation."""

    wave_series: dict[int, tuple[int, ...]]  # wave series -> runs
    unnamed_series: tuple[int, ...]  # numbers between first and last that no run has
    shared_files: dict[str, tuple[int, ...]]  # file -> runs
    matrices: dict[str, tuple[int, ...]]  # gain matrix -> runs
    repeats: tuple[Repeat, ...]  # of gain matrices that more than one run used
    biases: tuple[tuple[int, Bias], ...]  # run, and action on the heave position's zero


_COMPARED = ("waves", "drive", "scheme", "surge")


def find_links(log: RunLog) -> Links:
    """Return the relations between the runs of a log."""
    entries = log.entries
    series = _group((number, entry.run) for entry in entries for number in entry.wave_series)
    files = _group((entry.file, entry.run) for entry in entries if entry.file)
    matrices = _group((entry.matrix, entry) for entry in entries if entry.matrix)
    numbers = sorted(series)
    span = range(numbers[0], numbers[-1]) if numbers else range(0)
    return Links(
        wave_series={number: series[number] for number in numbers},
        unnamed_series=tuple(number for number in span if number not in series),
        shared_files={name: runs for name, runs in files.items() if len(runs) > 1},
        matrices={name: tuple(e.run for e in group) for name, group in matrices.items()},
        repeats=tuple(
            Repeat(
                name,
                tuple(entry.run for entry in group),
                tuple(f for f in _COMPARED if len({getattr(entry, f) for entry in group}) > 1),
            )
            for name, group in matrices.items()
            if len(group) > 1
        ),
        biases=tuple((entry.run, bias) for entry in entries for bias in entry.biases),
    )


def _group(pairs: Iterable[tuple[K, V]]) -> dict[K, tuple[V, ...]]:
    groups: dict[K, tuple[V, ...]] = {}
    for key, value in pairs:
        groups[key] = (*groups.get(key, ()), value)
    return groups


_PRODUCTS = {
    Activity.GAIN_MATRIX: ("row table", "power surfaces"),
    Activity.GAINS: ("row table",),
    Activity.BY_HAND: ("row table",),
    Activity.MULTISINE: ("identified impedance",),
}


def values_in_log(log: RunLog, quantity: str) -> tuple[RecordedValue, ...]:
    """Return every record of a quantity in a log, and every gain matrix that contains it."""
    if quantity != "spring_rate":
        return ()
    return tuple(value for entry in log.entries if (value := _of_entry(entry)) is not None)


def recording_time(entry: Entry) -> RecordingTime:
    """Return the time of an entry's run, by its number and the date in its file's name."""
    day = date.fromisoformat(entry.recorded[:10]) if entry.recorded else None
    return RecordingTime(entry.series_name, entry.run, day)


def _of_entry(entry: Entry) -> RecordedValue | None:
    products = [name for a in entry.activities for name in _PRODUCTS.get(a, ())]
    rests = tuple(dict.fromkeys(products))
    if entry.spring is not None:
        value = entry.spring.written_n_per_m
        return RecordedValue(entry.name, entry.spring.cell, recording_time(entry), value, "", rests)
    if not entry.matrix:
        return None
    note = f"spring rates are in {entry.matrix}, not in the log"
    return RecordedValue(entry.name, f"row {entry.row}", recording_time(entry), None, note, rests)
