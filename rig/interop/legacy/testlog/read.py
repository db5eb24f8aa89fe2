"""Reading a test log: every row of the sheet as an entry or as a separator between entries."""

import hashlib
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from rig.config.problems import ConfigError, Problem, display_path
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
from rig.regular_file import MAX_TABLE_BYTES, read_regular

_RUN = re.compile(r"\s*([A-Za-z][A-Za-z0-9]*)_(\d{1,6})\s*")
_FILE = re.compile(r"\w+?_(\d{4})_(\d\d)_(\d\d)_(\d\d)_(\d\d)_(\d\d)")
_PARTIAL = re.compile(r"\w+?_\d{4}_\d\d_\d\d_\w*")
_CUSTOM = re.compile(r"custom drive", re.IGNORECASE)

_CLOSE = 0.01  # two spring rates nearer than this are suspected to be one
_FEW = 2  # ... if one of them stands in no more runs than this


class Log(NamedTuple):
    """A test log."""

    path: Path
    sha256: str
    entries: tuple[Entry, ...]  # in the order of the sheet
    separators: tuple[Separator, ...]

    def find(self, run: int) -> Entry:
        """The entry of a run; KeyError saying which runs there are."""
        for entry in self.entries:
            if entry.run == run:
                return entry
        runs = [entry.run for entry in self.entries]
        raise KeyError(f"no run {run} in the log; it has {min(runs)} .. {max(runs)}")


class _Drive(NamedTuple):
    """The drive in use until a row says otherwise."""

    name: str
    where: str  # cell that says so
    by_run: bool  # the cell is of a run, not of a separator


def read_log(path: Path) -> Log:
    """A test log from its workbook.

    Raises `ConfigError` if it cannot be read, has no entry, or a run ID is no run ID or stands
    twice; all else that is irregular becomes a remark of its entry.
    """
    path = Path(path)
    try:
        data = read_regular(path, MAX_TABLE_BYTES)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise ConfigError(
            [Problem(display_path(path), 1, "", None, f"cannot be read: {reason}")]
        ) from None
    rows = read_sheet(path, data)
    runs = _runs(path, rows)
    entries: list[Entry] = []
    separators = []
    drive = _Drive("COTS", "from the start", by_run=False)
    for i, row in enumerate(rows):
        named = runs[i]
        if named is None:
            separator = _separator(row, runs[i + 1 :])
            separators.append(separator)
            if _CUSTOM.search(separator.text):
                drive = _Drive("custom", separator.cell, by_run=False)
            continue
        entry = _entry(row, named, drive)
        if entry.drive != drive.name:
            drive = _Drive(entry.drive, entry.drive_said, by_run=True)
        entries.append(entry)
    digest = hashlib.sha256(data).hexdigest()
    return Log(path, digest, _compared(tuple(entries)), tuple(separators))


def _separator(row: SheetRow, behind: list[tuple[str, int] | None]) -> Separator:
    told = [(c, t.strip()) for c, t in zip(row.cells, row.texts, strict=True) if t.strip(" *")]
    following = next((run[1] for run in behind if run is not None), 0)
    cell = told[0][0] if told else row.cells[0]
    return Separator(row.row, cell, " / ".join(text for _, text in told), following)


def _runs(path: Path, rows: tuple[SheetRow, ...]) -> list[tuple[str, int] | None]:
    """Series and number of each row's run, None for a separator."""
    found: list[tuple[str, int] | None] = []
    problems = []
    seen: dict[tuple[str, int], int] = {}
    for row in rows:
        text = row.texts[0]
        named = _RUN.fullmatch(text)
        if named is None:
            if any(c.isalnum() for c in text):
                message = f"{text!r} is no run ID; allowed as MASK4_001"
                problems.append(Problem(display_path(path), row.row, "Run ID", text, message))
            found.append(None)
            continue
        key = (named[1], int(named[2]))
        if key in seen:
            message = f"{text.strip()} stands twice, first in row {seen[key]}"
            problems.append(Problem(display_path(path), row.row, "Run ID", text, message))
        seen.setdefault(key, row.row)
        found.append(key)
    if not seen and not problems:
        problems.append(Problem(display_path(path), 1, "Run ID", None, "no run in the log"))
    if problems:
        raise ConfigError(problems)
    return found


def _entry(row: SheetRow, named: tuple[str, int], drive: _Drive) -> Entry:
    run_id, series_text, file_text, waves_text, wavebot, notes = row.texts
    at = dict(zip(("run", "series", "file", "waves", "wavebot", "notes"), row.cells, strict=True))
    remarks = []
    if run_id != run_id.strip():
        remarks.append(Remark(RemarkKind.RUN_ID_SPACES, at["run"], repr(run_id)))
    file, recorded = _file(file_text, at["file"], remarks)
    waves = read_waves(waves_text)
    remarks += [Remark(kind, at["waves"], text) for kind, text in waves.remarks]
    wavy = any(wave.kind is not WaveKind.CALM for wave in waves.waves)
    series = _series(series_text, at["series"], remarks, wavy=wavy)
    cells = (at["wavebot"], at["notes"])
    said = read_settings(wavebot, notes, cells)
    remarks += [Remark(kind, cells[i], (wavebot, notes)[i].strip()) for kind, i in said.remarks]
    told, where = (said.drive, said.drive_cell) if said.drive else (drive.name, drive.where)
    if not said.drive and drive.by_run:
        remarks.append(Remark(RemarkKind.DRIVE_CARRIED, at["wavebot"], f"{told}, from {where}"))
    if told == "custom" and wavy and not said.scheme:
        remarks.append(Remark(RemarkKind.SCHEME_UNSAID, at["wavebot"], wavebot.strip()))
    for text, cell in ((waves_text, at["waves"]), (wavebot, cells[0]), (notes, cells[1])):
        remarks += [Remark(kind, cell, quoted) for kind, quoted in read_notes(text)]
    if row.condition is Condition.UNKNOWN:
        remarks.append(Remark(RemarkKind.COLOUR_UNKNOWN, at["run"], ""))
    biases = (read_bias(wavebot, cells[0]), read_bias(notes, cells[1]))
    return Entry(
        run=named[1],
        series_name=named[0],
        row=row.row,
        wave_series=series,
        file=file,
        recorded=recorded,
        file_text=file_text,
        waves=waves.waves,
        waves_text=waves_text,
        wavebot_text=wavebot,
        notes=notes,
        activities=said.activities,
        matrix=said.matrix,
        gains=said.gains,
        spring=said.spring,
        stator_percent=said.stator,
        drive=told,
        drive_said=where,
        scheme=said.scheme,
        surge=said.surge,
        bus_voltage_v=said.bus_voltage,
        amplitudes=said.amplitudes,
        order=said.order,
        biases=tuple(bias for bias in biases if bias is not None),
        condition=row.condition,
        remarks=tuple(remarks),
    )


def _file(text: str, cell: str, remarks: list[Remark]) -> tuple[str, str]:
    """Name of a run's record and the time in it; both empty where the cell holds no such name."""
    name = text.strip()
    if not name:
        remarks.append(Remark(RemarkKind.FILE_MISSING, cell, ""))
        return "", ""
    if whole := _FILE.fullmatch(name):
        year, month, day, *clock = whole.groups()
        return name, f"{year}-{month}-{day}T{':'.join(clock)}"
    partial = _PARTIAL.fullmatch(name)
    kind = RemarkKind.FILE_PARTIAL if partial else RemarkKind.FILE_NO_NAME
    remarks.append(Remark(kind, cell, name))
    return "", ""


def _series(text: str, cell: str, remarks: list[Remark], *, wavy: bool) -> tuple[int, ...]:
    if not text.strip():
        if wavy:
            remarks.append(Remark(RemarkKind.SERIES_MISSING, cell, ""))
        return ()
    words = [word.strip() for word in text.split(",")]
    if not all(word.isdecimal() for word in words):
        remarks.append(Remark(RemarkKind.SERIES_UNREAD, cell, text))
        return ()
    if len(words) > 1:
        remarks.append(Remark(RemarkKind.SERIES_SEVERAL, cell, text))
    return tuple(int(word) for word in words)


def _compared(entries: tuple[Entry, ...]) -> tuple[Entry, ...]:
    """The entries with the remarks that need a look at the others."""
    files = Counter(entry.file for entry in entries if entry.file)
    rates = Counter(entry.spring.written_n_per_m for entry in entries if entry.spring)
    found = []
    newest = ""
    for entry in entries:
        more = []
        if files[entry.file] > 1:
            runs = ", ".join(str(other.run) for other in entries if other.file == entry.file)
            more.append(Remark(RemarkKind.FILE_SHARED, f"C{entry.row}", f"runs {runs}"))
        if entry.recorded and entry.recorded < newest:
            text = f"{entry.recorded}, after {newest}"
            more.append(Remark(RemarkKind.FILE_ORDER, f"C{entry.row}", text))
        newest = max(newest, entry.recorded)
        if entry.spring is not None:
            rate = entry.spring.written_n_per_m
            near = [r for r in rates if r != rate and abs(r - rate) <= _CLOSE * abs(rate)]
            if near and rates[rate] <= _FEW:
                text = f"{rate:g} N/m here, {', '.join(f'{r:g}' for r in near)} elsewhere"
                more.append(Remark(RemarkKind.SPRING_CLOSE, entry.spring.cell, text))
        found.append(entry._replace(remarks=(*entry.remarks, *more)))
    return tuple(found)
