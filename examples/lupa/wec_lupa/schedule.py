"""LUPA's gain schedules: read from its Excel files, or made for a wave period, as campaigns.

A schedule has two columns, stiffness K (N/m) and damping C (N s/m), without a header; each row
holds for ten wave periods. It begins with rows of zero gains, until the waves have built up at the
device: still water, ramp of the wave maker, and the travel of the waves by their group velocity.
"""

import argparse
import math
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

from openpyxl import load_workbook
from openpyxl.utils.exceptions import InvalidFileException
from rig.config.sea import RegularSea
from rig.config.tank import Tank
from rig.config.yaml_source import load_mapping
from rig.planning.tank import tank_times

PERIODS_PER_ROW = 10
DAMPING = tuple(range(100, 2001, 100))  # N s/m
FLUME = Tank.model_validate(load_mapping(Path(__file__).with_name("flume.yaml"))[0])
"""The Large Wave Flume; place of the device, still water and ramp as in LUPA's schedules."""

Gains = tuple[float, float]
"""Stiffness (N/m) and damping (N s/m)."""


class ScheduleError(ValueError):
    """A schedule that cannot be read; the message names file, row and column."""


def read_schedule(path: Path) -> list[Gains]:
    """Return the rows of a schedule's first sheet.

    Raises `ScheduleError` with every cell that is wrong, OSError for a file that cannot be read.
    """
    if path.suffix.lower() != ".xlsx":
        raise ScheduleError(f"{path}: cannot be read; allowed *.xlsx")
    try:
        sheet = load_workbook(path, read_only=True, data_only=True).worksheets[0]
    except (InvalidFileException, BadZipFile, IndexError, KeyError, ValueError, EOFError) as error:
        raise ScheduleError(f"{path}: is not an Excel workbook: {error}") from error
    problems: list[str] = []
    gains: list[Gains] = []
    for number, cells in enumerate(sheet.iter_rows(values_only=True), 1):
        row = list(cells)
        while row and row[-1] is None:
            row.pop()
        if not row:
            continue
        if len(row) != 2:
            problems.append(f"{path}:{number}: has {len(row)} columns; needed are K and C")
            continue
        wrong = [value for value in row if not _is_number(value)]
        problems += [f"{path}:{number}: {value!r} is no finite number" for value in wrong]
        if not wrong:
            gains.append((float(row[0]), float(row[1])))
    if not gains and not problems:
        problems.append(f"{path}: has no rows")
    if problems:
        raise ScheduleError("\n".join(problems))
    return gains


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


class Schedule(NamedTuple):
    """Rows of a period, and the times behind them, s."""

    rows: tuple[Gains, ...]
    zero_rows: int
    first_damping: float  # when the first row with gains begins
    full_waves: float  # when the waves have their full height at the device


def damping_schedule(
    period: float, damping: Sequence[float] = DAMPING, tank: Tank = FLUME
) -> Schedule:
    """Return zero rows until the waves have built up, then one row for each damping."""
    times = tank_times(tank, RegularSea(kind="regular", amplitude_m=0.05, period_s=period))
    assert times is not None
    row = PERIODS_PER_ROW * period
    zeros = math.ceil(times.full / row)
    rows = [(0.0, 0.0)] * zeros + [(0.0, float(value)) for value in damping]
    return Schedule(tuple(rows), zeros, zeros * row, times.full)


def campaign_text(
    name: str, rows: Sequence[Gains], period: float, amplitude: float, command: str
) -> str:
    """Return the campaign file of a schedule, for the folder of LUPA's campaigns."""
    listed = "\n".join(
        f"    - {{stiffness_n_per_m: {stiffness:g}, damping_n_s_per_m: {damping:g}}}"
        for stiffness, damping in rows
    )
    return f"""\
# A gain schedule of LUPA in regular waves of {period:g} s; each row holds for ten of them.
# Written by: {command}
name: {name}
rig: ../rigs/one_body.yaml
sea: {{kind: regular, amplitude_m: {amplitude:g}, period_s: {period:g}}}
tank: ../wec_lupa/flume.yaml
tare: {{duration_s: 2}}
start: {{lead_in_s: 0}}
timing: {{settle_s: 0, interval_s: {PERIODS_PER_ROW * period:g}}}
matrix:
  list:
{listed}
"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Write a campaign: `lupa-schedule damping --period 2.5` or `lupa-schedule read FILE.xlsx`."""
    parser = argparse.ArgumentParser(prog="lupa-schedule", description=__doc__)
    kinds = parser.add_subparsers(dest="kind", required=True)
    made = kinds.add_parser("damping", help="zero rows, then C from 100 to 2000 N s/m")
    read = kinds.add_parser("read", help="the rows of an Excel file")
    read.add_argument("file", type=Path)
    for each in (made, read):
        each.add_argument("--period", type=float, required=True, help="of the waves, s")
        each.add_argument("--amplitude", type=float, default=0.05, help="of the waves, m")
        each.add_argument("--name", help="of the campaign")
        each.add_argument("--output", type=Path, help="file to write; default: standard output")
    given = parser.parse_args(arguments)
    if not 0.5 <= given.period <= 20.0:
        parser.error(f"--period {given.period:g} s is out of range; allowed 0.5 .. 20 s")
    if not 0.001 <= given.amplitude <= 0.5:
        parser.error(f"--amplitude {given.amplitude:g} m is out of range; allowed 0.001 .. 0.5 m")
    shown = f"{given.period:g}s".replace(".", "p")
    try:
        if given.kind == "read":
            rows = read_schedule(given.file)
            name, words = f"lupa-{given.file.stem}", f"read {given.file.name}"
        else:
            rows = list(damping_schedule(given.period).rows)
            name, words = f"lupa-damping-{shown}", "damping"
    except (ScheduleError, OSError) as error:
        sys.exit(str(error))
    command = f"lupa-schedule {words} --period {given.period:g} --amplitude {given.amplitude:g}"
    name = given.name or re.sub(r"[^A-Za-z0-9_.-]", "-", name)[:60]
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,59}", name):
        parser.error(f"--name {name!r}: allowed letters, digits, _ . -, at most 60")
    text = campaign_text(name, rows, given.period, given.amplitude, command)
    if given.output is None:
        print(text, end="")
        return
    try:
        with given.output.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        sys.exit(f"{given.output}: exists; it is never overwritten")
    except OSError as error:
        sys.exit(f"{given.output}: {error.strerror}")
    print(f"written  {given.output}: {len(rows)} rows of {PERIODS_PER_ROW * given.period:g} s")


if __name__ == "__main__":
    main()
