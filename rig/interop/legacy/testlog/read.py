"""Read a test log: every row of the sheet is an entry or a separator between entries."""

import hashlib
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from rig.config.problems import ConfigError, Problem, display_path
from rig.interop.legacy.table import read_bytes
from rig.interop.legacy.testlog.entry import (
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
    filled = [(c, t.strip()) for c, t in zip(row.cells, row.texts, strict=True) if t.strip(" *")]
    following = next((run[1] for run in later_runs if run is not None), 0)
    cell = filled[0][0] if filled else row.cells[0]
    return Separator(row.row, cell, " / ".join(text for _, text in filled), following)


def _run_ids(path: Path, rows: tuple[SheetRow, ...]) -> list[tuple[str, int] | None]:
    """Return series and number of each row's run, None for a separator."""
    run_ids: list[tuple[str, int] | None] = []
    problems = []
    seen: dict[tuple[str, int], int] = {}
    for row in rows:
        text = row.texts[0]
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
    run_text, series_text, file_text, waves_text, wavebot, notes = row.texts
    cell_of = dict(
        zip(("run", "series", "file", "waves", "wavebot", "notes"), row.cells, strict=True)
    )
    remarks = []
    if run_text != run_text.strip():
        remarks.append(Remark(RemarkKind.RUN_ID_SPACES, cell_of["run"], repr(run_text)))
    file, recorded = _parse_file_name(file_text, cell_of["file"], remarks)
    waves = read_waves(waves_text)
    remarks += [Remark(kind, cell_of["waves"], text) for kind, text in waves.remarks]
    has_waves = any(wave.kind is not WaveKind.CALM for wave in waves.waves)
    series = _parse_series(series_text, cell_of["series"], remarks, has_waves=has_waves)
    cells = (cell_of["wavebot"], cell_of["notes"])
    settings = read_settings(wavebot, notes, cells)
    remarks += [Remark(kind, cells[i], (wavebot, notes)[i].strip()) for kind, i in settings.remarks]
    drive_name, drive_source = (
        (settings.drive, settings.drive_cell) if settings.drive else (drive.name, drive.source)
    )
    if not settings.drive and drive.from_run:
        remarks.append(
            Remark(
                RemarkKind.DRIVE_CARRIED, cell_of["wavebot"], f"{drive_name}, from {drive_source}"
            )
        )
    if drive_name == "custom" and has_waves and not settings.scheme:
        remarks.append(Remark(RemarkKind.SCHEME_UNSPECIFIED, cell_of["wavebot"], wavebot.strip()))
    for text, cell in ((waves_text, cell_of["waves"]), (wavebot, cells[0]), (notes, cells[1])):
        remarks += [Remark(kind, cell, quoted) for kind, quoted in read_notes(text)]
    if row.condition is Condition.UNKNOWN:
        remarks.append(Remark(RemarkKind.COLOUR_UNKNOWN, cell_of["run"], ""))
    biases = (read_bias(wavebot, cells[0]), read_bias(notes, cells[1]))
    return Entry(
        run=run_id[1],
        series_name=run_id[0],
        row=row.row,
        wave_series=series,
        file=file,
        recorded=recorded,
        file_text=file_text,
        waves=waves.waves,
        waves_text=waves_text,
        wavebot_text=wavebot,
        notes=notes,
        activities=settings.activities,
        matrix=settings.matrix,
        gains=settings.gains,
        spring=settings.spring,
        stator_percent=settings.stator,
        drive=drive_name,
        drive_source=drive_source,
        scheme=settings.scheme,
        surge=settings.surge,
        bus_voltage_v=settings.bus_voltage,
        amplitudes=settings.amplitudes,
        order=settings.order,
        biases=tuple(bias for bias in biases if bias is not None),
        condition=row.condition,
        remarks=tuple(remarks),
    )


def _parse_file_name(text: str, cell: str, remarks: list[Remark]) -> tuple[str, str]:
    """Return the name of a run's record and the time in it; both empty for an invalid name."""
    name = text.strip()
    if not name:
        remarks.append(Remark(RemarkKind.FILE_MISSING, cell, ""))
        return "", ""
    if match := _FILE.fullmatch(name):
        year, month, day, *clock = match.groups()
        return name, f"{year}-{month}-{day}T{':'.join(clock)}"
    partial = _PARTIAL.fullmatch(name)
    kind = RemarkKind.FILE_PARTIAL if partial else RemarkKind.FILE_NO_NAME
    remarks.append(Remark(kind, cell, name))
    return "", ""


def _parse_series(
    text: str, cell: str, remarks: list[Remark], *, has_waves: bool
) -> tuple[int, ...]:
    if not text.strip():
        if has_waves:
            remarks.append(Remark(RemarkKind.SERIES_MISSING, cell, ""))
        return ()
    parts = [part.strip() for part in text.split(",")]
    if not all(word.isdecimal() for word in parts):
        remarks.append(Remark(RemarkKind.SERIES_UNREADABLE, cell, text))
        return ()
    if len(parts) > 1:
        remarks.append(Remark(RemarkKind.SERIES_SEVERAL, cell, text))
    return tuple(int(word) for word in parts)


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
