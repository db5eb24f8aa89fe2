"""`rig matrix FILE --style mask4|lupa|foswec`: read, report, convert and write gain matrices."""

import os
import sys
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from rig.cli.calibration import find_calibration, recording_time
from rig.cli.options import CALIBRATIONS, Calibrations, Json
from rig.cli.output import OK, input_errors, print_json
from rig.config.problems import ConfigError, format_line_numbers, format_number
from rig.interop.legacy import mask4, matrix, stepped
from rig.interop.legacy.matrix import SPRING, GainMatrix
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.recording.calibration import apply_calibration

_OPTIONS = {
    "lever": "--lever-m",
    "gear": "--gear",
    "positive_damping": "--positive-damping",
    "spring_rate": "--spring-n-per-m",
    "flap": "--flap",
}


class MatrixReading(NamedTuple):
    """A matrix file as read: lines for people, facts for programs, and the converted matrix."""

    lines: list[str]
    facts: dict[str, Any]
    matrix: GainMatrix | None
    notes: list[str]  # comments of the written file
    campaign_lines: list[str]  # further lines of a written campaign


class Style(StrEnum):
    """Rig family whose gain-matrix format the file has."""

    MASK4 = "mask4"
    LUPA = "lupa"
    FOSWEC = "foswec"


class Damping(StrEnum):
    """Effect of a positive damping gain in the other rig."""

    ABSORBS = "absorbs"
    DRIVES = "drives"


_STATEMENT_PANEL = "Conversion of another rig's gains to the sign convention of wec-rig"


def _statement_option(name: str, text: str) -> Any:
    """Return an option that describes the other rig."""
    return typer.Option(name, help=text, rich_help_panel=_STATEMENT_PANEL)


Option = typer.Option


def command(
    file: Annotated[Path, typer.Argument(help="Gain matrix of an earlier rig: csv, xlsx, mat.")],
    style: Annotated[Style, Option("--style", help="Rig family of the file.")],
    columns: Annotated[
        str | None,
        Option("--columns", help="Column names in file order: Kp,Ki,springK; - skips a column."),
    ] = None,
    lead_rows: Annotated[
        int | None, Option("--lead-rows", min=0, help="Rows before the first measured one (mask4).")
    ] = None,
    sheet: Annotated[str | None, Option("--sheet", help="Sheet of a workbook.")] = None,
    variable: Annotated[str | None, Option("--variable", help="Matrix of a .mat file.")] = None,
    to: Annotated[
        Path | None,
        Option("--to", help="File to write: a wec-rig matrix (.csv) or campaign (.yaml)."),
    ] = None,
    base: Annotated[
        Path | None, Option("--campaign", help="Campaign that the .yaml file of --to extends.")
    ] = None,
    source: Annotated[
        Path | None,
        Option("--from", help="CSV matrix of wec-rig from which to write FILE (mask4)."),
    ] = None,
    header: Annotated[bool, Option(help="Write column names into FILE.")] = True,
    force: Annotated[bool, Option("--force", help="Overwrite an existing file.")] = False,
    calibration: Annotated[
        str | None, Option("--calibration", help="Correct spring rates: NAME, NAME@VERSION, file.")
    ] = None,
    run: Annotated[
        str | None, Option("--run", help="Run that used the matrix, for --calibration.")
    ] = None,
    calibrations: Calibrations = CALIBRATIONS,
    step: Annotated[
        float | None, Option("--step-s", help="GainTstep = numPeriods * wavePeriod, s.")
    ] = None,
    lever: Annotated[
        float | None,
        _statement_option("--lever-m", "Body travel per rad of the output shaft, m."),
    ] = None,
    gear: Annotated[
        float | None,
        _statement_option("--gear", "Motor rad per rad of the output shaft."),
    ] = None,
    damping: Annotated[
        Damping | None,
        _statement_option("--positive-damping", "Effect of B > 0 in that rig."),
    ] = None,
    spring: Annotated[
        float | None,
        _statement_option(
            "--spring-n-per-m", "Rate of a spring in parallel with the feedback, N/m."
        ),
    ] = None,
    flap: Annotated[str | None, _statement_option("--flap", "aft or bow (foswec).")] = None,
    torque_constant_ratio: Annotated[
        float,
        _statement_option(
            "--torque-constant-ratio", "True torque constant divided by that of the controller."
        ),
    ] = 1.0,
    as_json: Json = False,
) -> int:
    """Read a gain matrix of an earlier rig, report its contents, and convert it for wec-rig."""
    if source is not None:
        return _write(file, style, source, header=header, force=force, as_json=as_json)
    statement = {
        "lever": lever,
        "gear": gear,
        "positive_damping": damping.value if damping is not None else None,
        "spring_rate": spring,
        "flap": flap,
        "torque_constant_ratio": torque_constant_ratio,
    }
    with input_errors("matrix", as_json=as_json):
        if style == "mask4":
            rows = mask4.read(file, columns, lead_rows, sheet=sheet, variable=variable)
            corrected = _with_calibration(rows.matrix, calibration, run, calibrations)
            reading = _report_mask4(rows, *corrected, writes=to is not None)
        else:
            steps = stepped.read(file, style, columns, sheet=sheet, variable=variable)
            reading = _report_stepped(steps, step, statement, writes=to is not None)
        written = to and _write_target(to, base, reading, force=force)
    if as_json:
        return print_json(reading.facts | {"written": written and str(written)})
    print("\n".join(reading.lines))
    if written is not None:
        print(f"written    {written}")
    return OK


def _report_mask4(
    source: mask4.Mask4Matrix, converted: GainMatrix, notes: list[str], *, writes: bool
) -> MatrixReading:
    roles, line_numbers = source.roles, source.file.lines

    def numbers(rows: Sequence[int]) -> list[int]:
        return [line_numbers[i] for i in rows]

    measured = format_line_numbers(numbers(roles.measured))
    lines = [
        f"file       {source.path}, MASK4 gain matrix",
        f"columns    {', '.join(source.columns)} (by {source.file.names_from})",
        f"rows       {matrix.summary(converted)}: {measured}",
    ]
    labels = [f"lead row {i + 1}" for i in roles.lead]
    if len(labels) == 2:
        labels = ["load row, about 5 s", "hold row, until 120 s of the wave clock"]
    lead = zip(numbers(roles.lead), labels, strict=True)
    lines += [f"left out   line {number}: {label}" for number, label in lead]
    if roles.doubled:
        lines.append(
            f"left out   {format_line_numbers(numbers(roles.doubled))}: doubled at a change of the "
            "spring rate, held while the stator moves"
        )
    end = None if roles.end is None else line_numbers[roles.end]
    if end is not None:
        lines.append(f"end        line {end}: Kp = -999")
    lines += [f"check      {remark}" for remark in source.remarks]
    lines += [f"corrected  {note}" for note in notes]
    facts = {
        "file": str(source.path),
        "style": "mask4",
        "columns": source.columns,
        "columns_source": source.file.names_from,
        "lines": {
            "measured": numbers(roles.measured),
            "lead": numbers(roles.lead),
            "doubled": numbers(roles.doubled),
            "undoubled": numbers(roles.not_doubled),
            "repeated": numbers(roles.repeated),
            "end": end,
            "after_end": numbers(roles.after_end),
        },
        "remarks": source.remarks,
        "notes": notes,
        "matrix": converted._asdict(),
    }
    if writes and (problems := source.problems(converted, COLUMNS)):
        raise ConfigError(problems)
    return MatrixReading(lines, facts, converted, [f"from {source.path.name} (MASK4)", *notes], [])


def _with_calibration(
    original: GainMatrix, name: str | None, run: str | None, folder: Path
) -> tuple[GainMatrix, list[str]]:
    """Return the matrix with corrected spring rates, and a note that names the calibration."""
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


def _report_stepped(
    source: stepped.SteppedMatrix,
    step: float | None,
    statement_values: dict[str, Any],
    *,
    writes: bool,
) -> MatrixReading:
    active, count = source.active, len(source.rows)
    lines = [
        f"file       {source.path}, gain matrix of style {source.style}",
        f"columns    {', '.join(source.columns)} (by {source.file.names_from})",
        f"rows       {len(active)}: {format_line_numbers([source.file.lines[i] for i in active])}",
    ]
    before = [source.file.lines[i] for i in range(active.start)]
    after = [source.file.lines[i] for i in range(active.stop, count)]
    if before or after:
        where = format_line_numbers([*before, *after])
        lines.append(f"left out   {where}: all gains zero, before and after the test")
    if step is not None:
        if not step > 0.0:
            raise ValueError(f"--step-s {format_number(step)}: must be greater than 0 s")
        duration = format_number(count * step)
        lines.append(
            f"played     {count} rows of {format_number(step)} s, {duration} s in all; the "
            "block starts with index 0 at time 0 (out of range) and repeats row 1 after "
            f"{duration} s"
        )
    lines += [f"check      {remark}" for remark in source.remarks]
    facts: dict[str, Any] = {
        "file": str(source.path),
        "style": source.style,
        "columns": source.columns,
        "columns_source": source.file.names_from,
        "lines": {
            "active": [source.file.lines[i] for i in active],
            "zero_before": before,
            "zero_after": after,
        },
        "rows": [source.rows[i] for i in active],
        "step_s": step,
        "remarks": source.remarks,
        "matrix": None,
    }
    missing = stepped.missing_parameters(source.style, statement_values)
    if missing:
        option_names = ", ".join(_OPTIONS[name] for name in missing)
        message = (
            f"gains are feedback of motor angle and speed in that rig's signs; to convert them to "
            f"F = Kp v + Ki x on the body, give {option_names}"
        )
        if writes:
            raise ValueError(f"{source.path}: {message}")
        lines.append(f"signs      {message}")
        return MatrixReading(lines, facts, None, [], [])
    statement = stepped.SourceRig(**statement_values)
    converted = stepped.convert(source, statement, COLUMNS)
    factor = stepped.force_per_gain(source.style, statement)
    lines.append(f"signs      {statement.description()}, gains times {format_number(factor)}")
    lines.append(f"matrix     {matrix.summary(converted)}")
    facts |= {"statement": statement._asdict(), "factor": factor, "matrix": converted._asdict()}
    notes = [f"from {source.path.name} ({source.style})", statement.description()]
    campaign_lines = [f"timing: {{interval_s: {matrix.exact_text(step)}}}"] if step else []
    return MatrixReading(lines, facts, converted, notes, campaign_lines)


def _write_target(target: Path, base: Path | None, reading: MatrixReading, *, force: bool) -> Path:
    assert reading.matrix is not None
    if target.suffix == ".csv":
        text = matrix.format_csv(reading.matrix, reading.notes)
    elif target.suffix in (".yaml", ".yml"):
        if base is None:
            raise ValueError(
                f"{target}: a campaign needs a rig and a sea; name a campaign with --campaign"
            )
        origin = os.path.relpath(base, target.parent)
        text = "".join(f"# {note}\n" for note in reading.notes)
        text += matrix.format_campaign(reading.matrix, origin, target.stem, reading.campaign_lines)
    else:
        raise ValueError(f"{target}: cannot write {target.suffix!r}; allowed .csv, .yaml")
    with target.open("w" if force else "x", encoding="utf-8") as file:
        file.write(text)
    return target


def _write(
    file: Path, style: str, source: Path, *, header: bool, force: bool, as_json: bool
) -> int:
    """Write a MASK4 gain matrix from a CSV matrix of wec-rig, and return the exit code."""
    with input_errors("matrix", as_json=as_json):
        if style != "mask4":
            raise ValueError(f"cannot write files of style {style}; allowed --style mask4")
        if file.exists() and not force:
            raise ValueError(f"{file} exists; --force overwrites it")
        converted, rows_after_end = matrix.read_csv(source)
        rows = mask4.write(file, converted, COLUMNS, header=header)
    if as_json:
        facts = {
            "written": str(file),
            "rows": rows,
            "after_end": rows_after_end,
            "matrix": converted._asdict(),
        }
        return print_json(facts)
    if rows_after_end:
        left_out = f"{len(rows_after_end)} ({format_line_numbers(rows_after_end)})"
        print(f"warning: left out rows after the end mark: {left_out}", file=sys.stderr)
    print(f"rows       {matrix.summary(converted)}")
    print(f"written    {file}: {rows} rows with load, hold, doubled and end rows")
    return OK
