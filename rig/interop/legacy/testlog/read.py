"""Read a test log: every row of the sheet is an entry or a separator between entries."""

import hashlib
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from rig.config.problems import ConfigError, Problem, display_path
from rig.interop.legacy.table import read_bytes
from rig.interop.legacy.testlog.entry import (
    Cell,
    Condition,
    Entry,
    Remark,
    RemarkKind,
    Separator,
    WaveKind,
)
from rig.interop.legacy.testlog.notes import read_bias, read_notes
from rig.interop.legacy.testlog.settings import read_settings
from rig.interop.legacy.testlog.sheet import SheetRow, read_sheet
from rig.interop.legacy.testlog.waves import read_waves

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
    settings = read_settings(wavebot, notes)
    remarks += settings.remarks
    if not settings.drive:
        settings = settings._replace(drive=drive.name, drive_source=drive.source)
        if drive.from_run:
            text = f"{drive.name}, from {drive.source}"
            remarks.append(wavebot.remark(RemarkKind.DRIVE_CARRIED, text))
    if settings.drive == "custom" and has_waves and not settings.scheme:
        remarks.append(wavebot.remark(RemarkKind.SCHEME_UNSPECIFIED))
    for cell in (waves, wavebot, notes):
        remarks += read_notes(cell)
    if row.condition is Condition.UNKNOWN:
        remarks.append(run.remark(RemarkKind.COLOUR_UNKNOWN, ""))
    biases = (read_bias(wavebot), read_bias(notes))
    fields = settings._asdict() | {"remarks": tuple(remarks)}
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
        **fields,
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
