"""`rig calibration list|show|apply|diff`."""

import csv
import datetime
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.options import CALIBRATIONS, Calibrations, Json
from rig.cli.output import OK, input_errors, print_json
from rig.config.problems import format_number
from rig.interop.legacy.testlog import read_log, values_in_log
from rig.recording.calibration import (
    CalibratedValue,
    CalibrationVersion,
    RecordingTime,
    apply_calibration,
    open_calibration,
    open_history,
)
from rig.recording.calibration_changes import (
    CalibrationDifference,
    ChangedValue,
    RecordedValue,
    compare_calibrations,
    values_in_runs,
)

command = typer.Typer(no_args_is_help=True)
CalibrationName = Annotated[str, typer.Argument(help="NAME, NAME@VERSION, or a calibration file.")]
TestLog = Annotated[Path | None, typer.Option("--testlog", help="Test log (xlsx).")]


def find_calibration(name: str, folder: Path) -> CalibrationVersion:
    """Return a calibration by file (.yaml, .yml), or by name with or without its version."""
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        return open_calibration(path)
    return open_history(folder).find(name)


@command.command("list")
def list_all(folder: Calibrations = CALIBRATIONS, as_json: Json = False) -> int:
    """List all calibrations with their versions; commands use the newest version by default."""
    with input_errors("calibration list", as_json=as_json):
        history = open_history(folder)
    if as_json:
        return print_json([_calibration_as_dict(known) for known in history.versions])
    for name in history.names():
        chain = history.chain(name)
        for known in chain:
            file = known.file
            marker = "*" if known is chain[-1] else " "
            summary = f"{_correction_text(known)}, {file.valid.description()}"
            print(f"{marker} {file.title:28} {file.quantity} [{file.unit}]  {summary}")
    print("* used unless you name a version")
    return OK


@command.command()
def show(name: CalibrationName, folder: Calibrations = CALIBRATIONS, as_json: Json = False) -> int:
    """Show one version of a calibration and the versions before it."""
    with input_errors("calibration show", as_json=as_json):
        known = find_calibration(name, folder)
    if as_json:
        return print_json(_calibration_as_dict(known))
    file = known.file
    pairs = [
        ("calibration", file.title),
        ("corrects", f"{file.quantity} in {file.unit}"),
        ("how", _correction_text(known)),
        ("valid for", file.valid.description()),
        ("outside", "refused" if file.outside == "refuse" else "values stay as recorded"),
        ("source", file.source),
        ("reason", file.reason),
        ("supersedes", f"{file.name} v{file.supersedes}" if file.supersedes else ""),
        ("file", f"{known.path} (sha256 {known.sha256})"),
    ]
    print("\n".join(f"{name:12} {text}" for name, text in pairs if text))
    return OK


def _correction_text(known: CalibrationVersion) -> str:
    correction = known.file.correction.model_dump()
    kind = correction.pop("kind")
    if kind == "table":
        pairs = zip(correction["recorded"], correction["corrected"], strict=True)
        return "table " + ", ".join(f"{format_number(x)} -> {format_number(y)}" for x, y in pairs)
    return f"{kind} {', '.join(format_number(value) for value in correction.values())}"


def _calibration_as_dict(known: CalibrationVersion) -> dict[str, Any]:
    file = known.file.model_dump(mode="json", by_alias=True)
    return {**file, "file": str(known.path), "sha256": known.sha256}


@command.command()
def apply(
    name: CalibrationName,
    values: Annotated[
        list[float] | None, typer.Option("--value", "-x", help="Recorded value; repeatable.")
    ] = None,
    run: Annotated[
        str | None,
        typer.Option("--run", help="Run in which the values were recorded: 24 or SERIES_024."),
    ] = None,
    date: Annotated[
        str | None,
        typer.Option("--date", help="Day (UTC) on which the values were recorded: 2023-09-26."),
    ] = None,
    invert: Annotated[
        bool, typer.Option("--invert", help="Convert corrected values back to recorded ones.")
    ] = False,
    testlog: TestLog = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="CSV to write with --testlog.")
    ] = None,
    folder: Calibrations = CALIBRATIONS,
    as_json: Json = False,
) -> int:
    """Correct values, or all values of a test log; the command never changes the record."""
    if testlog is not None:
        return _apply_to_log(name, folder, testlog, output, as_json=as_json)
    with input_errors("calibration apply", as_json=as_json):
        known = find_calibration(name, folder)
        if not values:
            raise ValueError("nothing to correct; give --value or --testlog")
        at = recording_time(known, run, date)
        applied = [apply_calibration(known.file, value, at, invert=invert) for value in values]
    if as_json:
        records = [value._asdict() for value in applied]
        return print_json({"calibration": _calibration_as_dict(known), "values": records})
    for value in applied:
        if invert and value.inside:
            given, recorded = format_number(value.given), format_number(value.value)
            print(f"{given} was recorded as {recorded}, before {value.by}")
        else:
            print(value.description())
    return OK


def recording_time(known: CalibrationVersion, run: str | None, day: str | None) -> RecordingTime:
    """Parse the run (24 or SERIES_024) and the day in which a value was recorded.

    A bare run number belongs to the series of the calibration file.
    """
    series, number = "", None
    if run is not None:
        series, _, digits = run.rpartition("_")
        runs = known.file.valid.runs
        series = series or (runs.series if runs is not None else "")
        if not digits.isdecimal():
            raise ValueError(f"{run!r} is not a run; write 24 or SERIES_024")
        number = int(digits)
    try:
        return RecordingTime(
            series, number, datetime.date.fromisoformat(day) if day is not None else None
        )
    except ValueError:
        raise ValueError(f"{day!r} is not a date; write it as 2023-09-26") from None


def _apply_to_log(
    name: str, folder: Path, path: Path, output: Path | None, *, as_json: bool
) -> int:
    """Print all values of a test log with their corrections, or write them to a CSV file."""
    with input_errors("calibration apply", as_json=as_json):
        known = find_calibration(name, folder)
        log = read_log(path)
        rows = [
            (entry, apply_calibration(known.file, entry.value, entry.time))
            for entry in values_in_log(log, known.file.quantity)
            if entry.value is not None
        ]
        if output is not None:
            _write_csv(output, known, f"{path.name} (sha256 {log.sha256[:12]})", rows)
    if as_json:
        records = [{"where": s.where, "field": s.field, **applied._asdict()} for s, applied in rows]
        return print_json({"calibration": _calibration_as_dict(known), "values": records})
    if output is not None:
        print(output)
        return OK
    print(f"by {known.description()}, {known.file.valid.description()}")
    for entry, applied in rows:
        remark = "" if applied.inside else "  outside the valid range, unchanged"
        values = f"{applied.given:+10.6g} -> {applied.value:+10.6g} {known.file.unit}"
        print(f"{entry.where}  {values}{remark}")
    return OK


def _write_csv(
    output: Path,
    known: CalibrationVersion,
    source: str,
    rows: list[tuple[RecordedValue, CalibratedValue]],
) -> None:
    file = known.file
    with output.open("x", newline="", encoding="utf-8") as out:
        out.write(f"# {file.quantity} of {source} by {known.description()}\n")
        out.write(f"# {_correction_text(known)}, {file.valid.description()}\n")
        writer = csv.writer(out, lineterminator="\n")
        unit = file.unit
        writer.writerow(["run", "field", f"recorded [{unit}]", f"corrected [{unit}]", "valid"])
        for entry, applied in rows:
            valid = "yes" if applied.inside else "no"
            values = repr(applied.given), repr(applied.value)
            writer.writerow([entry.where, entry.field, *values, valid])


@command.command()
def diff(
    old: CalibrationName,
    new: CalibrationName,
    testlog: TestLog = None,
    runs: Annotated[Path | None, typer.Option("--runs", help="Folder of runs to search.")] = None,
    folder: Calibrations = CALIBRATIONS,
    as_json: Json = False,
) -> int:
    """List what a new calibration version changes: runs, rows, values, and outdated products."""
    with input_errors("calibration diff", as_json=as_json):
        before, after = find_calibration(old, folder), find_calibration(new, folder)
        values: list[RecordedValue] = []
        if testlog is not None:
            values += values_in_log(read_log(testlog), before.file.quantity)
        if runs is not None:
            values += values_in_runs(runs, before.file.quantity)
        result = compare_calibrations(before.file, after.file, values)
    if as_json:
        return print_json(_difference_as_dict(result, before, after))
    _print_difference(result, after.file.unit, searched=testlog is not None or runs is not None)
    if runs is not None and result.stale:
        print(
            f"\nrig plot RUN --calibration {new} makes the new products of a run and keeps the old"
        )
    return OK


def _difference_as_dict(
    result: CalibrationDifference, before: CalibrationVersion, after: CalibrationVersion
) -> dict[str, Any]:
    return {
        "old": _calibration_as_dict(before),
        "new": _calibration_as_dict(after),
        "keys": [dict(zip(("key", "old", "new"), key, strict=True)) for key in result.keys],
        "changed": [change._asdict() for change in result.changed],
        "unchanged": result.unchanged,
        "undecided": [{"where": where, "why": why} for where, why in result.undetermined],
        "stale": result.stale,
    }


def _print_difference(result: CalibrationDifference, unit: str, *, searched: bool) -> None:
    print(f"{result.old} -> {result.new}")
    for key, old, new in result.keys:
        print(f"  {key}: {'-' if old is None else old} -> {'-' if new is None else new}")
    if not searched:
        print("to list the changed values, give --testlog, --runs or both", file=sys.stderr)
        return
    print(f"\n{len(result.changed)} values changed, {result.unchanged} unchanged")
    for change in result.changed:
        print(f"  {change.where} {change.field}: {_change_text(change, unit)}")
    if result.stale:
        print("\noutdated products, to compute again")
        for where, names in result.stale.items():
            print(f"  {where}: {', '.join(names)}")
    if result.undetermined:
        print("\nundecided")
        for where, why in result.undetermined:
            print(f"  {where}: {why}")


def _change_text(change: ChangedValue, unit: str) -> str:
    if change.recorded is None:
        return change.note
    old, new = (
        "refused" if value is None else format_number(value) for value in (change.old, change.new)
    )
    return f"{old} -> {new} {unit} (recorded {format_number(change.recorded)})"
