"""What `rig matrix` does: read, report, turn, write."""

import json
import os
import sys
from pathlib import Path
from typing import Any, NamedTuple

from rig import cli
from rig.cli.calibration_commands import at_of_run, find
from rig.cli.file_problems import REFUSED, refuse
from rig.config.problems import ConfigError, format_line_numbers, format_number
from rig.interop.legacy import mask4, mask4_file, matrix, sign_conventions, stepped
from rig.interop.legacy.columns import SPRING
from rig.interop.legacy.matrix import Matrix
from rig.recording.calibration import corrected

_OPTIONS = {
    "lever": "--lever-m",
    "gear": "--gear",
    "positive_damping": "--positive-damping",
    "spring_rate": "--spring-n-per-m",
    "flap": "--flap",
}


class MatrixOptions(NamedTuple):
    """What a person asks of a file of the old style."""

    file: Path
    style: str
    columns: str | None
    lead_rows: int | None
    sheet: str | None
    variable: str | None
    to: Path | None
    base: Path | None
    force: bool
    step: float | None  # s
    calibration: tuple[str | None, str | None, Path]  # name, run, folder


class _Read(NamedTuple):
    """What was found, for people and programs, and the matrix if it is wanted."""

    lines: list[str]
    facts: dict[str, Any]
    matrix: Matrix | None
    notes: list[str]  # that go into what is written
    more: list[str]  # lines of a campaign


def read(asked: MatrixOptions, said: dict[str, Any], *, as_json: bool) -> int:
    """Print what a file holds and write today's matrix if that is asked."""
    try:
        found = _mask4(asked) if asked.style == "mask4" else _stepped(asked, said)
        written = _write_house(asked, found)
    except REFUSED as error:
        return refuse("matrix", error, as_json=as_json)
    if as_json:
        print(json.dumps(found.facts | {"written": written and str(written)}, ensure_ascii=False))
        return cli.OK
    print("\n".join(found.lines))
    if written is not None:
        print(f"written    {written}")
    return cli.OK


def _mask4(asked: MatrixOptions) -> _Read:
    got = mask4.read(
        asked.file, asked.columns, asked.lead_rows, sheet=asked.sheet, variable=asked.variable
    )
    found, at = got.found, got.lines
    made, notes = _calibrated(got.matrix, asked)
    lead = ["load row, about 5 s", "hold row, until 120 s of the wave clock"]
    lines = [
        f"file       {got.path}, MASK4 gain matrix",
        f"columns    {', '.join(got.columns)} (by {got.said_by})",
        f"rows       {matrix.words(made)}: {format_line_numbers([at[i] for i in found.rows])}",
    ]
    for i in found.lead:
        what = lead[i] if len(found.lead) == 2 else f"lead row {i + 1}"
        lines.append(f"left out   line {at[i]}: {what}")
    if found.doubled:
        lines.append(
            f"left out   {format_line_numbers([at[i] for i in found.doubled])}: doubled at a change of "
            "the spring rate, held while the stator moves"
        )
    if found.end is not None:
        lines.append(f"end        line {at[found.end]}: Kp = -999")
    lines += [f"look at    {remark}" for remark in got.remarks]
    lines += [f"corrected  {note}" for note in notes]
    facts = {
        "file": str(got.path),
        "style": "mask4",
        "columns": got.columns,
        "columns_said_by": got.said_by,
        "lines": {
            "measured": [at[i] for i in found.rows],
            "lead": [at[i] for i in found.lead],
            "doubled": [at[i] for i in found.doubled],
            "undoubled": [at[i] for i in found.undoubled],
            "repeated": [at[i] for i in found.repeated],
            "end": at[found.end] if found.end is not None else None,
            "after_end": [at[i] for i in found.after],
        },
        "remarks": got.remarks,
        "notes": notes,
        "matrix": made._asdict(),
    }
    if asked.to is not None:
        _check(made, got.place)
    return _Read(lines, facts, made, [f"from {got.path.name} (MASK4)", *notes], [])


def _calibrated(given: Matrix, asked: MatrixOptions) -> tuple[Matrix, list[str]]:
    """The matrix with corrected spring rates, and what that was done with."""
    name, run, folder = asked.calibration
    if name is None:
        return given, []
    known = find(name, folder)
    if known.file.quantity != "spring_rate":
        raise ValueError(f"{known.file.title} corrects {known.file.quantity}, not spring rates")
    if run is None:
        raise ValueError(f"{known.file.title} needs the run the matrix was used in; give --run")
    at = at_of_run(known, run, None)
    i = given.columns.index(SPRING)
    applied = [corrected(known.file, row[i], at) for row in given.rows]
    rows = tuple(
        (*row[:i], one.value, *row[i + 1 :]) for row, one in zip(given.rows, applied, strict=True)
    )
    inside = applied[0].inside
    how = "" if inside else ": outside its range, unchanged"
    note = f"{SPRING} by {known.description()} for run {run}, {known.file.valid.description()}{how}"
    return given._replace(rows=rows), [note]


def _check(made: Matrix, place: matrix.Place | None) -> None:
    problems = matrix.problems(made, place)
    if problems:
        raise ConfigError(problems)


def _stepped(asked: MatrixOptions, said: dict[str, Any]) -> _Read:
    got = stepped.read(
        asked.file, asked.style, asked.columns, sheet=asked.sheet, variable=asked.variable
    )
    active = got.active
    lines = [
        f"file       {got.path}, gain matrix of style {got.style}",
        f"columns    {', '.join(got.columns)} (by {got.said_by})",
        f"rows       {len(active)}: {format_line_numbers([got.lines[i] for i in active])}",
    ]
    zeros = [*range(got.before), *range(active.stop, len(got.rows))]
    if zeros:
        where = format_line_numbers([got.lines[i] for i in zeros])
        lines.append(f"left out   {where}: all gains zero, before and after the test")
    lines += _traps(got, asked.step)
    lines += [f"look at    {remark}" for remark in got.remarks]
    facts: dict[str, Any] = {
        "file": str(got.path),
        "style": got.style,
        "columns": got.columns,
        "columns_said_by": got.said_by,
        "lines": {
            "active": [got.lines[i] for i in active],
            "zero_before": [got.lines[i] for i in range(got.before)],
            "zero_after": [got.lines[i] for i in zeros[got.before :]],
        },
        "rows": [got.rows[i] for i in active],
        "step_s": asked.step,
        "remarks": got.remarks,
        "matrix": None,
    }
    missing = sign_conventions.missing(got.style, said)
    if missing:
        options = ", ".join(_OPTIONS[name] for name in missing)
        message = (
            f"gains are feedback of motor angle and speed in that rig's signs; to turn them into "
            f"F = Kp v + Ki x on the body say {options}"
        )
        if asked.to is not None:
            raise ValueError(f"{got.path}: {message}")
        lines.append(f"signs      {message}")
        return _Read(lines, facts, None, [], [])
    statement = sign_conventions.Statement(**said)
    made = sign_conventions.converted(got, statement)
    factor = sign_conventions.factor(got.style, statement)
    lines.append(f"signs      {statement.description()}, gains times {format_number(factor)}")
    lines.append(f"matrix     {matrix.words(made)}")
    facts |= {"statement": statement._asdict(), "factor": factor, "matrix": made._asdict()}
    notes = [f"from {got.path.name} ({got.style})", statement.description()]
    more = [f"timing: {{interval_s: {matrix.plain(asked.step)}}}"] if asked.step else []
    return _Read(lines, facts, made, notes, more)


def _traps(got: stepped.Stepped, step: float | None) -> list[str]:
    if step is None:
        return []
    if not step > 0.0:
        raise ValueError(f"--step-s {format_number(step)}: allowed above 0 s")
    count = len(got.rows)
    over = format_number(count * step)
    return [
        f"played     {count} rows of {format_number(step)} s, {over} s in all; the block starts with "
        f"index 0 at time 0 (out of range) and plays row 1 again after {over} s"
    ]


def _write_house(asked: MatrixOptions, found: _Read) -> Path | None:
    to = asked.to
    if to is None:
        return None
    assert found.matrix is not None
    if to.suffix == ".csv":
        text = matrix.csv_text(found.matrix, found.notes)
    elif to.suffix in (".yaml", ".yml"):
        if asked.base is None:
            raise ValueError(f"{to}: a campaign needs rig and sea; name one with --campaign")
        base = os.path.relpath(asked.base, to.parent)
        text = "".join(f"# {note}\n" for note in found.notes)
        text += matrix.campaign_text(found.matrix, base, to.stem, found.more)
    else:
        raise ValueError(f"{to}: {to.suffix!r} is not written; allowed .csv, .yaml")
    with to.open("w" if asked.force else "x", encoding="utf-8") as file:
        file.write(text)
    return to


def write(file: Path, style: str, source: Path, *, header: bool, force: bool, as_json: bool) -> int:
    """Write a MASK4 gain matrix from today's CSV."""
    try:
        if style != "mask4":
            raise ValueError(f"files of style {style} are read only; allowed --style mask4")
        if file.exists() and not force:
            raise ValueError(f"{file} is there already; --force overwrites it")
        made, after = matrix.read_csv(source)
        rows = mask4_file.write(file, made, header=header)
    except REFUSED as error:
        return refuse("matrix", error, as_json=as_json)
    if as_json:
        facts = {"written": str(file), "rows": rows, "after_end": after, "matrix": made._asdict()}
        print(json.dumps(facts))
    else:
        if after:
            left = f"{len(after)} ({format_line_numbers(after)})"
            print(f"warning: rows after the end mark, left out: {left}", file=sys.stderr)
        print(f"rows       {matrix.words(made)}")
        print(f"written    {file}: {rows} rows with load, hold, doubled and end rows")
    return cli.OK
