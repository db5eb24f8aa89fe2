"""Implementation of `rig matrix`: read, report, convert and write gain matrices."""

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rig import cli
from rig.cli.calibration_commands import find_calibration, recording_time
from rig.cli.file_problems import INPUT_ERRORS, refuse
from rig.config.problems import ConfigError, format_line_numbers, format_number
from rig.interop.legacy import mask4, mask4_file, matrix, sign_conventions, stepped
from rig.interop.legacy.columns import SPRING
from rig.interop.legacy.matrix import GainMatrix
from rig.recording.calibration import apply_calibration

_OPTIONS = {
    "lever": "--lever-m",
    "gear": "--gear",
    "positive_damping": "--positive-damping",
    "spring_rate": "--spring-n-per-m",
    "flap": "--flap",
}


class MatrixOptions(NamedTuple):
    """Options of `rig matrix`."""

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


class MatrixReading(NamedTuple):
    """A matrix file as read: lines for people, facts for programs, and the converted matrix."""

    lines: list[str]
    facts: dict[str, Any]
    matrix: GainMatrix | None
    notes: list[str]  # comments of the written file
    campaign_lines: list[str]  # further lines of a written campaign


def read(options: MatrixOptions, statement: dict[str, Any], *, as_json: bool) -> int:
    """Print the contents of a file, write the converted matrix (--to), return the exit code."""
    try:
        reading = (
            _read_mask4(options) if options.style == "mask4" else _read_stepped(options, statement)
        )
        written = _write_target(options, reading)
    except INPUT_ERRORS as error:
        return refuse("matrix", error, as_json=as_json)
    if as_json:
        print(json.dumps(reading.facts | {"written": written and str(written)}, ensure_ascii=False))
        return cli.OK
    print("\n".join(reading.lines))
    if written is not None:
        print(f"written    {written}")
    return cli.OK


def _read_mask4(options: MatrixOptions) -> MatrixReading:
    source = mask4.read(
        options.file,
        options.columns,
        options.lead_rows,
        sheet=options.sheet,
        variable=options.variable,
    )
    structure, line_numbers = source.roles, source.lines
    converted, notes = _with_calibration(source.matrix, options)

    def at_lines(rows: Sequence[int]) -> str:
        return format_line_numbers([line_numbers[i] for i in rows])

    lead_labels = ["load row, about 5 s", "hold row, until 120 s of the wave clock"]
    lines = [
        f"file       {source.path}, MASK4 gain matrix",
        f"columns    {', '.join(source.columns)} (by {source.columns_from})",
        f"rows       {matrix.summary(converted)}: {at_lines(structure.measured)}",
    ]
    for i in structure.lead:
        label = lead_labels[i] if len(structure.lead) == 2 else f"lead row {i + 1}"
        lines.append(f"left out   line {line_numbers[i]}: {label}")
    if structure.doubled:
        lines.append(
            f"left out   {at_lines(structure.doubled)}: doubled at a change of the spring rate, "
            "held while the stator moves"
        )
    if structure.end is not None:
        lines.append(f"end        line {line_numbers[structure.end]}: Kp = -999")
    lines += [f"check      {remark}" for remark in source.remarks]
    lines += [f"corrected  {note}" for note in notes]
    facts = {
        "file": str(source.path),
        "style": "mask4",
        "columns": source.columns,
        "columns_source": source.columns_from,
        "lines": {
            "measured": [line_numbers[i] for i in structure.measured],
            "lead": [line_numbers[i] for i in structure.lead],
            "doubled": [line_numbers[i] for i in structure.doubled],
            "undoubled": [line_numbers[i] for i in structure.not_doubled],
            "repeated": [line_numbers[i] for i in structure.repeated],
            "end": line_numbers[structure.end] if structure.end is not None else None,
            "after_end": [line_numbers[i] for i in structure.after_end],
        },
        "remarks": source.remarks,
        "notes": notes,
        "matrix": converted._asdict(),
    }
    if options.to is not None:
        _check_matrix(converted, source.location)
    return MatrixReading(lines, facts, converted, [f"from {source.path.name} (MASK4)", *notes], [])


def _with_calibration(original: GainMatrix, options: MatrixOptions) -> tuple[GainMatrix, list[str]]:
    """Return the matrix with corrected spring rates, and a note that names the calibration."""
    name, run, folder = options.calibration
    if name is None:
        return original, []
    known = find_calibration(name, folder)
    if known.file.quantity != "spring_rate":
        raise ValueError(f"{known.file.title} corrects {known.file.quantity}, not spring rates")
    if run is None:
        raise ValueError(f"{known.file.title} needs the run that used the matrix; give --run")
    recorded_at = recording_time(known, run, None)
    i = original.columns.index(SPRING)
    applied = [apply_calibration(known.file, row[i], recorded_at) for row in original.rows]
    rows = tuple(
        (*row[:i], correction.value, *row[i + 1 :])
        for row, correction in zip(original.rows, applied, strict=True)
    )
    inside = applied[0].inside
    remark = "" if inside else ": outside its range, unchanged"
    note = (
        f"{SPRING} by {known.description()} for run {run}, {known.file.valid.description()}{remark}"
    )
    return original._replace(rows=rows), [note]


def _check_matrix(converted: GainMatrix, place: matrix.MatrixLocation | None) -> None:
    problems = matrix.matrix_problems(converted, place)
    if problems:
        raise ConfigError(problems)


def _read_stepped(options: MatrixOptions, statement_values: dict[str, Any]) -> MatrixReading:
    source = stepped.read(
        options.file, options.style, options.columns, sheet=options.sheet, variable=options.variable
    )
    active = source.active
    lines = [
        f"file       {source.path}, gain matrix of style {source.style}",
        f"columns    {', '.join(source.columns)} (by {source.columns_from})",
        f"rows       {len(active)}: {format_line_numbers([source.lines[i] for i in active])}",
    ]
    zeros = [*range(source.zero_rows_before), *range(active.stop, len(source.rows))]
    if zeros:
        where = format_line_numbers([source.lines[i] for i in zeros])
        lines.append(f"left out   {where}: all gains zero, before and after the test")
    lines += _playback_lines(source, options.step)
    lines += [f"check      {remark}" for remark in source.remarks]
    facts: dict[str, Any] = {
        "file": str(source.path),
        "style": source.style,
        "columns": source.columns,
        "columns_source": source.columns_from,
        "lines": {
            "active": [source.lines[i] for i in active],
            "zero_before": [source.lines[i] for i in range(source.zero_rows_before)],
            "zero_after": [source.lines[i] for i in zeros[source.zero_rows_before :]],
        },
        "rows": [source.rows[i] for i in active],
        "step_s": options.step,
        "remarks": source.remarks,
        "matrix": None,
    }
    missing = sign_conventions.missing_parameters(source.style, statement_values)
    if missing:
        option_names = ", ".join(_OPTIONS[name] for name in missing)
        message = (
            f"gains are feedback of motor angle and speed in that rig's signs; to convert them to "
            f"F = Kp v + Ki x on the body, give {option_names}"
        )
        if options.to is not None:
            raise ValueError(f"{source.path}: {message}")
        lines.append(f"signs      {message}")
        return MatrixReading(lines, facts, None, [], [])
    statement = sign_conventions.SourceRig(**statement_values)
    converted = sign_conventions.convert(source, statement)
    factor = sign_conventions.force_per_gain(source.style, statement)
    lines.append(f"signs      {statement.description()}, gains times {format_number(factor)}")
    lines.append(f"matrix     {matrix.summary(converted)}")
    facts |= {"statement": statement._asdict(), "factor": factor, "matrix": converted._asdict()}
    notes = [f"from {source.path.name} ({source.style})", statement.description()]
    campaign_lines = (
        [f"timing: {{interval_s: {matrix.exact_text(options.step)}}}"] if options.step else []
    )
    return MatrixReading(lines, facts, converted, notes, campaign_lines)


def _playback_lines(source: stepped.SteppedMatrix, step: float | None) -> list[str]:
    if step is None:
        return []
    if not step > 0.0:
        raise ValueError(f"--step-s {format_number(step)}: must be greater than 0 s")
    count = len(source.rows)
    duration = format_number(count * step)
    return [
        f"played     {count} rows of {format_number(step)} s, {duration} s in all; the block "
        "starts "
        f"with index 0 at time 0 (out of range) and repeats row 1 after {duration} s"
    ]


def _write_target(options: MatrixOptions, reading: MatrixReading) -> Path | None:
    target = options.to
    if target is None:
        return None
    assert reading.matrix is not None
    if target.suffix == ".csv":
        text = matrix.format_csv(reading.matrix, reading.notes)
    elif target.suffix in (".yaml", ".yml"):
        if options.base is None:
            raise ValueError(
                f"{target}: a campaign needs a rig and a sea; name a campaign with --campaign"
            )
        base = os.path.relpath(options.base, target.parent)
        text = "".join(f"# {note}\n" for note in reading.notes)
        text += matrix.format_campaign(reading.matrix, base, target.stem, reading.campaign_lines)
    else:
        raise ValueError(f"{target}: cannot write {target.suffix!r}; allowed .csv, .yaml")
    with target.open("w" if options.force else "x", encoding="utf-8") as file:
        file.write(text)
    return target


def write(file: Path, style: str, source: Path, *, header: bool, force: bool, as_json: bool) -> int:
    """Write a MASK4 gain matrix from a CSV matrix of wec-rig, and return the exit code."""
    try:
        if style != "mask4":
            raise ValueError(f"cannot write files of style {style}; allowed --style mask4")
        if file.exists() and not force:
            raise ValueError(f"{file} exists; --force overwrites it")
        converted, rows_after_end = matrix.read_csv(source)
        rows = mask4_file.write(file, converted, header=header)
    except INPUT_ERRORS as error:
        return refuse("matrix", error, as_json=as_json)
    if as_json:
        facts = {
            "written": str(file),
            "rows": rows,
            "after_end": rows_after_end,
            "matrix": converted._asdict(),
        }
        print(json.dumps(facts))
    else:
        if rows_after_end:
            left_out = f"{len(rows_after_end)} ({format_line_numbers(rows_after_end)})"
            print(f"warning: left out rows after the end mark: {left_out}", file=sys.stderr)
        print(f"rows       {matrix.summary(converted)}")
        print(f"written    {file}: {rows} rows with load, hold, doubled and end rows")
    return cli.OK
