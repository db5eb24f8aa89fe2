"""`rig testlog FILE`."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.text import Text

from rig.cli.options import CALIBRATIONS, Calibrations, Json
from rig.cli.output import OK, input_errors, print_json
from rig.config.problems import format_number
from rig.interop.legacy.testlog import Entry, RunLog, find_links, read_log, recording_time
from rig.presentation.console import plain_table, table_console
from rig.presentation.json_values import json_value
from rig.recording.calibration import (
    CalibratedValue,
    CalibrationVersion,
    apply_calibration,
    open_history,
)

Corrections = dict[int, CalibratedValue]
"""Corrections of the spring rate, by run."""


def command(
    file: Annotated[
        Path,
        typer.Argument(
            help="Test log (xlsx), such as MASK4_testlog.xlsx of the public fbWecCntrl repository."
        ),
    ],
    run: Annotated[int | None, typer.Option("--run", help="Show only this run, in full.")] = None,
    calibrations: Calibrations = CALIBRATIONS,
    as_json: Json = False,
) -> int:
    """Read the log of a test: list its runs, the links between them, and every irregularity.

    Spring rates are also corrected by the newest calibration.
    """
    with input_errors("testlog", as_json=as_json):
        log = read_log(file)
        entries = log.entries if run is None else (log.find(run),)
        known = spring_calibration(calibrations, log.entries[0].series_name)
        corrections = {
            entry.run: apply_calibration(
                known.file, entry.spring.written_n_per_m, recording_time(entry)
            )
            for entry in entries
            if known is not None and entry.spring is not None
        }
    if as_json:
        return print_json(_as_dict(log, entries, known, corrections, whole_log=run is None))
    if run is None:
        _print_table(log, corrections)
        if known is not None:
            valid = known.file.valid.description()
            print(f"spring rates written -> corrected by {known.description()}, {valid}")
    else:
        _print_entry(entries[0], corrections)
    return OK


def spring_calibration(folder: Path, series: str) -> CalibrationVersion | None:
    """Return the newest calibration of spring rates for runs of ``series``; None without one.

    A missing folder counts as empty. Raises ValueError if several calibrations match.
    """
    if not folder.is_dir():
        return None
    history = open_history(folder)
    matches = [
        known
        for known in map(history.find, history.names())
        if known.file.quantity == "spring_rate"
        if known.file.valid.runs is not None and known.file.valid.runs.series == series
    ]
    if len(matches) > 1:
        names = ", ".join(known.file.name for known in matches)
        raise ValueError(f"{folder}: several calibrations of spring rates for {series}: {names}")
    return matches[0] if matches else None


def _as_dict(
    log: RunLog,
    entries: tuple[Entry, ...],
    known: CalibrationVersion | None,
    corrections: Corrections,
    *,
    whole_log: bool,
) -> dict[str, Any]:
    runs = [json_value(entry) for entry in entries]
    for run in runs:
        if applied := corrections.get(run["run"]):
            run["spring"] |= {
                "corrected_n_per_m": applied.value, "by": applied.by, "valid": applied.inside,
            }  # fmt: skip
    out: dict[str, Any] = {
        "file": str(log.path),
        "sha256": log.sha256,
        "spring_calibration": known and {"title": known.file.title, "sha256": known.sha256},
        "runs": runs,
    }
    if whole_log:
        out |= {"separators": json_value(log.separators), "links": json_value(find_links(log))}
    return out


def _print_table(log: RunLog, corrections: Corrections) -> None:
    table = plain_table(">run", "waves…", "rig…", ">spring, N/m", "drive", "remarks…")
    before = {separator.before_run: separator.text for separator in log.separators}
    for entry in log.entries:
        if entry.run in before:
            table.add_row("", Text(before[entry.run], style="bold yellow"))
        remarks = "; ".join(dict.fromkeys(remark.kind.value for remark in entry.remarks))
        table.add_row(
            str(entry.run),
            Text(_waves_text(entry)),
            Text(entry.matrix or ", ".join(activity.value for activity in entry.activities)),
            _spring_text(entry, corrections),
            " ".join(filter(None, (entry.drive, entry.scheme))),
            Text(remarks, style="dim"),
        )
    table_console().print(table, crop=False)
    count = sum(len(entry.remarks) for entry in log.entries)
    print(f"\n{len(log.entries)} runs, {count} remarks")


def _waves_text(entry: Entry) -> str:
    text = "; ".join(_wave_text(wave) for wave in entry.waves) or f"? {entry.waves_text.strip()}"
    series = ",".join(map(str, entry.wave_series))
    return f"{series}: {text}" if series else text


def _wave_text(wave: Any) -> str:
    when = f"{wave.frequency_hz:.3g} Hz" if wave.frequency_hz else ""
    height = ""
    if wave.amplitude_m is not None:
        height = f"amplitude {format_number(wave.amplitude_m)} m"
    if wave.hs_m is not None:
        height = f"Hs {format_number(wave.hs_m)} m"
    return " ".join(filter(None, (wave.kind.value, when, height, wave.code)))


def _spring_text(entry: Entry, corrections: Corrections) -> str:
    if entry.spring is None:
        return ""
    written, applied = f"{entry.spring.written_n_per_m:+.0f}", corrections.get(entry.run)
    if applied is None or applied.value == applied.given:
        return written
    return f"{written} -> {applied.value:+.0f}"


def _print_entry(entry: Entry, corrections: Corrections) -> None:
    applied = corrections.get(entry.run)
    orders = entry.order or entry.amplitudes
    pairs = (
        ("run", f"{entry.name}, row {entry.row} of the sheet, {entry.condition.value}"),
        ("file", entry.file or f"none ({entry.file_text.strip() or 'blank'})"),
        ("waves", _waves_text(entry)),
        ("did", ", ".join(activity.value for activity in entry.activities)),
        ("matrix", entry.matrix),
        ("gains", "; ".join(f"{g.axis} {g.name} {list(g.values)} ({g.cell})" for g in entry.gains)),
        ("spring", _spring_text(entry, corrections)),
        ("", applied.description() if applied else ""),
        ("stator", ", ".join(f"{format_number(p)} %" for p in entry.stator_percent)),
        ("drive", f"{entry.drive} {entry.scheme}".strip() + f" ({entry.drive_source})"),
        ("surge", entry.surge),
        ("bus", f"{format_number(entry.bus_voltage_v)} V" if entry.bus_voltage_v else ""),
        (
            "current",
            ", ".join(f"{format_number(a.amperes)} A {a.waveform}".strip() for a in orders),
        ),
        ("zero", "; ".join(f"{b.action} {b.when} ({b.cell})" for b in entry.biases)),
        ("as written", f"{entry.waves_text.strip()} | {entry.wavebot_text.strip()}"),
        ("notes", entry.notes.strip()),
    )
    for name, text in pairs:
        if text:
            print(f"{name:10}  {text}")
    for remark in entry.remarks:
        print(f"! {remark.cell:6}  {remark.kind.value}: {remark.text}".rstrip(": "))
