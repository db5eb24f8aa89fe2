"""What the `rig calibration` commands do."""

import csv
import json
import sys
from datetime import date
from pathlib import Path
from typing import Any

from rig import cli
from rig.cli.file_problems import REFUSED, refuse
from rig.config.problems import format_number
from rig.interop.legacy.testlog import read_log
from rig.recording.calibration import (
    Applied,
    At,
    Known,
    corrected,
    open_calibration,
    open_history,
    recorded,
)
from rig.recording.calibration.diff import Changed, Difference, difference
from rig.recording.calibration.sources import Stood, in_log, in_runs


def find(named: str, folder: Path) -> Known:
    """The calibration a person means: a file, or a name with or without its version."""
    path = Path(named)
    if path.suffix in (".yaml", ".yml"):
        return open_calibration(path)
    return open_history(folder).find(named)


def list_all(folder: Path, *, as_json: bool) -> int:
    """Print all versions of all calibrations."""
    try:
        history = open_history(folder)
    except REFUSED as error:
        return refuse("calibration list", error, as_json=as_json)
    if as_json:
        print(json.dumps([_plain(known) for known in history.versions], ensure_ascii=False))
        return cli.OK
    for name in history.names():
        chain = history.chain(name)
        for known in chain:
            file = known.file
            mark = "*" if known is chain[-1] else " "
            says = f"{_correction(known)}, {file.valid.description()}"
            print(f"{mark} {file.title:28} {file.quantity} [{file.unit}]  {says}")
    print("* counts, unless a version is named")
    return cli.OK


def show(named: str, folder: Path, *, as_json: bool) -> int:
    """Print one version and what it superseded."""
    try:
        known = find(named, folder)
    except REFUSED as error:
        return refuse("calibration show", error, as_json=as_json)
    if as_json:
        print(json.dumps(_plain(known), ensure_ascii=False))
        return cli.OK
    file = known.file
    pairs = [
        ("calibration", file.title),
        ("corrects", f"{file.quantity} in {file.unit}"),
        ("how", _correction(known)),
        ("valid for", file.valid.description()),
        ("outside", "refused" if file.outside == "refuse" else "values stay as recorded"),
        ("source", file.source),
        ("reason", file.reason),
        ("supersedes", f"{file.name} v{file.supersedes}" if file.supersedes else ""),
        ("file", f"{known.path} (sha256 {known.sha256})"),
    ]
    print("\n".join(f"{name:12} {words}" for name, words in pairs if words))
    return cli.OK


def _correction(known: Known) -> str:
    correction = known.file.correction.model_dump()
    kind = correction.pop("kind")
    if kind == "table":
        pairs = zip(correction["recorded"], correction["corrected"], strict=True)
        return "table " + ", ".join(f"{format_number(x)} -> {format_number(y)}" for x, y in pairs)
    return f"{kind} {', '.join(format_number(value) for value in correction.values())}"


def _plain(known: Known) -> dict[str, Any]:
    file = known.file.model_dump(mode="json", by_alias=True)
    return {**file, "file": str(known.path), "sha256": known.sha256}


def apply_to_values(
    named: str,
    folder: Path,
    values: list[float],
    when: tuple[str | None, str | None],
    *,
    invert: bool,
    as_json: bool,
) -> int:
    """Print values corrected, or taken back."""
    try:
        known = find(named, folder)
        if not values:
            raise ValueError("nothing to correct; give --value or --testlog")
        at = at_of_run(known, *when)
        turn = recorded if invert else corrected
        applied = [turn(known.file, value, at) for value in values]
    except REFUSED as error:
        return refuse("calibration apply", error, as_json=as_json)
    if as_json:
        told = [one._asdict() for one in applied]
        print(json.dumps({"calibration": _plain(known), "values": told}, ensure_ascii=False))
    else:
        for one in applied:
            print(_taken_back(one) if invert else one.description())
    return cli.OK


def _taken_back(one: Applied) -> str:
    if not one.inside:
        return one.description()
    return f"{format_number(one.given)} was recorded as {format_number(one.value)}, before {one.by}"


def at_of_run(known: Known, run: str | None, day: str | None) -> At:
    """When a value was recorded, as a person says it; a bare number is of the file's series."""
    series, number = "", None
    if run is not None:
        series, _, digits = run.rpartition("_")
        runs = known.file.valid.runs
        series = series or (runs.series if runs is not None else "")
        if not digits.isdecimal():
            raise ValueError(f"{run!r} is no run; allowed as 24 or MASK4_024")
        number = int(digits)
    return At(series, number, _day(day) if day is not None else None)


def _day(text: str) -> date:
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise ValueError(f"{text!r} is no date; allowed as 2023-09-26") from None


def apply_to_log(
    named: str, folder: Path, path: Path, output: Path | None, *, as_json: bool
) -> int:
    """Print or write all values of a log with their corrected ones."""
    try:
        known = find(named, folder)
        log = read_log(path)
        rows = [
            (stood, corrected(known.file, stood.value, stood.at))
            for stood in in_log(log, known.file.quantity)
            if stood.value is not None
        ]
        if output is not None:
            _write(output, known, f"{path.name} (sha256 {log.sha256[:12]})", rows)
    except REFUSED as error:
        return refuse("calibration apply", error, as_json=as_json)
    if as_json:
        told = [{"where": s.where, "field": s.field, **applied._asdict()} for s, applied in rows]
        print(json.dumps({"calibration": _plain(known), "values": told}, ensure_ascii=False))
        return cli.OK
    if output is not None:
        print(output)
        return cli.OK
    print(f"by {known.description()}, {known.file.valid.description()}")
    for stood, one in rows:
        said = "" if one.inside else "  outside, unchanged"
        print(f"{stood.where}  {one.given:+10.6g} -> {one.value:+10.6g} {known.file.unit}{said}")
    return cli.OK


def _write(output: Path, known: Known, source: str, rows: list[tuple[Stood, Applied]]) -> None:
    file = known.file
    with output.open("x", newline="", encoding="utf-8") as out:
        out.write(f"# {file.quantity} of {source} by {known.description()}\n")
        out.write(f"# {_correction(known)}, {file.valid.description()}\n")
        writer = csv.writer(out, lineterminator="\n")
        unit = file.unit
        writer.writerow(["run", "field", f"recorded [{unit}]", f"corrected [{unit}]", "valid"])
        for stood, one in rows:
            valid = "yes" if one.inside else "no"
            writer.writerow([stood.where, stood.field, repr(one.given), repr(one.value), valid])


def diff(
    old: str, new: str, testlog: Path | None, runs: Path | None, folder: Path, *, as_json: bool
) -> int:
    """Print what reading with a new version changes."""
    try:
        before, after = find(old, folder), find(new, folder)
        stood: list[Stood] = []
        if testlog is not None:
            stood += in_log(read_log(testlog), before.file.quantity)
        if runs is not None:
            stood += in_runs(runs, before.file.quantity)
        found = difference(before.file, after.file, stood)
    except REFUSED as error:
        return refuse("calibration diff", error, as_json=as_json)
    if as_json:
        print(json.dumps(_difference_json(found, before, after), ensure_ascii=False))
        return cli.OK
    _tell(found, after.file.unit, looked=testlog is not None or runs is not None)
    if runs is not None and found.stale:
        print(f"\nrig plot RUN --calibration {new} makes those of a run, beside the old ones")
    return cli.OK


def _difference_json(found: Difference, before: Known, after: Known) -> dict[str, Any]:
    return {
        "old": _plain(before),
        "new": _plain(after),
        "keys": [dict(zip(("key", "old", "new"), key, strict=True)) for key in found.keys],
        "changed": [change._asdict() for change in found.changed],
        "unchanged": found.unchanged,
        "untold": [{"where": where, "why": why} for where, why in found.untold],
        "stale": found.stale,
    }


def _tell(found: Difference, unit: str, *, looked: bool) -> None:
    print(f"{found.old} -> {found.new}")
    for key, old, new in found.keys:
        print(f"  {key}: {'-' if old is None else old} -> {'-' if new is None else new}")
    if not looked:
        print("what it changes: give --testlog, --runs or both", file=sys.stderr)
        return
    print(f"\n{len(found.changed)} changed, {found.unchanged} read as before")
    for change in found.changed:
        print(f"  {change.where} {change.field}: {_change_words(change, unit)}")
    if found.stale:
        print("\nto be made anew")
        for where, names in found.stale.items():
            print(f"  {where}: {', '.join(names)}")
    if found.untold:
        print("\ncannot be told")
        for where, why in found.untold:
            print(f"  {where}: {why}")


def _change_words(change: Changed, unit: str) -> str:
    if change.recorded is None:
        return change.note
    old, new = (
        "refused" if value is None else format_number(value) for value in (change.old, change.new)
    )
    return f"{old} -> {new} {unit} (recorded {format_number(change.recorded)})"
