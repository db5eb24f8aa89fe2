"""Gain matrices: columns by campaign name and legacy name, house units and signs, measured rows.

The column order of the MASK4 files is unpublished, so columns are identified by name, from a header
or from a list that a person gives. MASK4 report (Sandia), 3.2.3 and Tables 3-2 and 3-3.
"""

import difflib
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from controllers import impedance
from rig.config.matrix import END_MARK, KindColumns, combination_model
from rig.config.problems import ConfigError, Problem, format_number, format_value
from rig.config.ranges import allowed_values
from rig.config.unit_factors import factor_note
from rig.interop.legacy.table import SKIPPED, Table, TableRow, read_table, to_numbers
from rig.presentation.phrases import count_text

SPRING, KP, KI = "spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m"


class Column(NamedTuple):
    """A column of a gain matrix."""

    name: str  # in the campaign file, with the unit
    legacy: str  # in a MASK4 file
    aliases: tuple[str, ...]  # other accepted names
    units: tuple[str, ...]  # accepted spellings of its unit


_DAMPING = ("N*s/m", "N s/m", "N-s/m", "Ns/m", "N·s/m")

MASK4 = (
    Column(
        SPRING, "springK",
        ("spring", "magK", "magSpring", "magSpringK", "Ks", "spring rate", "targetSpring_N_m"),
        ("N/m",),
    ),
    Column(KP, "Kp", ("heaveKp", "hKp", "heaveKpUsed"), _DAMPING),
    Column(KI, "Ki", ("heaveKi", "hKi", "heaveKiUsed"), ("N/m",)),
    Column("surge_kp_n_s_per_m", "surgeKp", ("sKp",), _DAMPING),
    Column("surge_ki_n_per_m", "surgeKi", ("sKi",), ("N/m",)),
    Column("bus_voltage_v", "dcBusVoltage", ("VDC", "busVoltage"), ("V",)),
    Column(
        "switching_period_s", "driveSwitchT",
        ("switchT", "switchTime", "driveSwitchTime", "switchingPeriod"), ("s",),
    ),
    Column("hysteresis_a", "driveHystTol", ("hystTol",), ("A",)),
    Column(
        "velocity_threshold_m_per_s", "driveVelThreshold",
        ("velThreshold", "velThresh", "driveVelThresh"), ("m/s",),
    ),
    Column("discharge_level", "dischargeLevel", (), ("-", "1")),
)  # fmt: skip
"""All columns, in the order of today's matrix."""

_ROTATIONAL = ("N*m/rad", "N m/rad", "Nm/rad", "N·m/rad")
_ROTATIONAL_DAMPING = ("N*m*s/rad", "N m s/rad", "Nms/rad", "N·m·s/rad")

LUPA = (
    Column("stiffness", "stiffness", ("stiff", "stiffness_Nperm"), ("N/m",)),
    Column("damping", "damping", ("damp", "damping_Npermpers"), _DAMPING),
)
"""Two columns, in the order of public WEC-Bench and LUPA files without a header."""

FOSWEC = tuple(
    Column(
        name,
        name,
        (name.replace("Stiff", "Stiffness").replace("Damp", "Damping"),),
        _ROTATIONAL_DAMPING if "Damp" in name else _ROTATIONAL,
    )
    for name in (
        *("aftStiff", "aftDamp", "aftStiffCC", "aftDampCC"),
        *("bowStiffCC", "bowDampCC", "bowStiff", "bowDamp"),
    )
)
"""Eight columns in the order of the public script that writes them; it writes no header."""

REQUIRED = (SPRING, KP, KI)

_UNIT = re.compile(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]\s*")


class NumberTable(NamedTuple):
    """The rows of a file as numbers, in columns with today's names."""

    table: Table
    names: tuple[str, ...]  # in the order of the file; `SKIPPED` for a column left out
    names_from: str  # header, list, or style
    rows: tuple[tuple[float, ...], ...]

    @property
    def lines(self) -> tuple[int, ...]:
        """Line of the file of each row."""
        return tuple(row.line for row in self.table.rows)

    def problem(self, row: int, name: str, value: float, message: str) -> Problem:
        """Return a problem of a column in a row (from 0)."""
        column = self.names.index(name) + 1
        return self.table.problem(self.lines[row], column, name, value, message)


def name_columns(
    table: Table,
    known: tuple[Column, ...],
    needed: tuple[str, ...],
    given: str | None = None,
    order: tuple[str, ...] = (),
) -> NumberTable:
    """Return a table with the names of its columns, from ``given``, its header, or ``order``.

    ``given`` is a list such as `Kp,Ki,springK,-`; ``order`` is that of the files without a header.
    Raises `ConfigError` for unknown columns, for missing ones of ``needed``, for a list that
    contradicts the header, and for every cell that is not a number.
    """
    header = table.header
    if given is not None:
        labels = [name.strip() for name in given.split(",")]
        names, problems = _resolve_names(table, 1, labels, known, needed)
        if header is not None and not problems:
            problems = _disagreements(table, header, names, known)
    elif header is not None:
        names, problems = _resolve_names(table, header.line, _labels(header), known, needed)
    elif order:
        names, problems = order, []
    else:
        message = (
            "the file has no header, and the column order of the MASK4 files is unpublished; "
            "list the columns, as in --columns Kp,Ki,springK"
        )
        raise ConfigError([table.problem(1, 0, "columns", None, message)])
    if problems:
        raise ConfigError(problems)
    names_from = "list" if given is not None else "header" if header is not None else "style"
    return NumberTable(table, names, names_from, to_numbers(table, names))


def _labels(header: TableRow) -> list[str]:
    labels = [("" if cell is None else str(cell)) for cell in header.cells]
    while labels and not labels[-1]:
        labels.pop()
    return labels


def _disagreements(
    table: Table, header: TableRow, names: tuple[str, ...], known: tuple[Column, ...]
) -> list[Problem]:
    """Return a problem for each column that a readable header and the list name differently."""
    in_header, unread = _resolve_names(table, header.line, _labels(header), known, ())
    pairs = enumerate(zip(in_header, names, strict=False), start=1)
    return [
        table.problem(header.line, i, "columns", head, f"the header says {head}, the list {name}")
        for i, (head, name) in pairs
        if not unread  # unknown names contradict nothing
        if SKIPPED not in (head, name) and head != name
    ]


def _resolve_names(
    table: Table, line: int, labels: list[str], known: tuple[Column, ...], needed: tuple[str, ...]
) -> tuple[tuple[str, ...], list[Problem]]:
    problems, names = [], list[str]()
    for i, label in enumerate(labels, start=1):
        name, message = _resolve_name(label, known)
        if not message and name != SKIPPED and name in names:
            first = names.index(name) + 1
            message = f"{label!r} is {name}, which is column {first} already"
        if message:
            problems.append(table.problem(line, i, "columns", label, message))
            name = f"column {i}"
        names.append(name)
    missing = [name for name in needed if name not in names]
    if missing and not problems:
        message = f"no column for {', '.join(missing)} among {', '.join(labels)}"
        problems.append(table.problem(line, 0, "columns", None, message))
    return tuple(names), problems


def _resolve_name(label: str, known: tuple[Column, ...]) -> tuple[str, str]:
    """Return today's name of a column, and the problem of its label."""
    if label == SKIPPED:
        return SKIPPED, ""
    split = _UNIT.fullmatch(label)
    bare, unit = split.groups() if split else (label, "")
    for column in known:
        if _plain(bare) in {_plain(n) for n in (column.name, column.legacy, *column.aliases)}:
            if unit and _compact(unit) not in {_compact(u) for u in column.units}:
                note = factor_note(unit, column.units)
                text = f"{label!r}: unit {unit}; allowed {column.units[0]}"
                return "", f"{text}: {note}" if note else text
            return column.name, ""
    names = [column.legacy for column in known]
    near = difflib.get_close_matches(bare, names, n=1, cutoff=0.6)
    nearest = f"did you mean {near[0]}?" if near else f"known are {', '.join(names)}"
    problem = f"{format_value(label)} is not a known column" if label else "a column without a name"
    return "", f"{problem}; {nearest}"


def _plain(label: str) -> str:
    return "".join(c for c in label.lower() if c.isalnum())


def _compact(unit: str) -> str:
    return "".join(c for c in unit if c not in " *·-") or unit


COLUMN_ORDER = tuple(column.name for column in MASK4)


class GainMatrix(NamedTuple):
    """Columns in the order of `ORDER`, the first three always; F = Kp v + Ki x on the body."""

    columns: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]


class RefusedValue(NamedTuple):
    """A value that a campaign refuses."""

    row: int  # from 0
    name: str
    value: float
    message: str


def select_columns(names: tuple[str, ...], rows: Iterable[tuple[float, ...]]) -> GainMatrix:
    """Return rows with columns in any order as a matrix; columns of other names are left out."""
    columns = tuple(name for name in COLUMN_ORDER if name in names)
    indices = [names.index(name) for name in columns]
    return GainMatrix(columns, tuple(tuple(row[i] for i in indices) for row in rows))


def refused_values(matrix: GainMatrix, columns: KindColumns) -> list[RefusedValue]:
    """Return every value of a matrix that a campaign with these columns refuses."""
    return [
        RefusedValue(i, name, value, message)
        for i, row in enumerate(matrix.rows)
        for name, value in zip(matrix.columns, row, strict=True)
        if (message := _value_problem(name, value, columns))
    ]


def _value_problem(name: str, value: float, columns: KindColumns) -> str:
    if not math.isfinite(value):
        return f"{format_number(value)} is not a finite number"
    if name == KP and value == END_MARK:
        return "-999 ends a matrix and is never a gain"
    if name == "discharge_level" and value not in range(16):
        return f"{format_number(value)} is out of range; allowed a 4-bit mask, whole 0 .. 15"
    limits = allowed_values(combination_model(columns, impedance.COLUMNS), (name,))
    if limits is not None and not limits.contains(value):
        reason = f" ({limits.reason()})" if limits.reason() else ""
        return f"{format_number(value)} is out of range; allowed {limits.description(name)}{reason}"
    return ""


def exact_text(value: float) -> str:
    """Return a number as text that reads back to the same bits, whole numbers without a point."""
    return repr(value).removesuffix(".0")


def format_csv(matrix: GainMatrix, comments: Iterable[str] = ()) -> str:
    """Return today's CSV matrix; ``comments`` become comment lines above the header."""
    lines = [f"# {note}" for note in comments]
    lines.append(",".join(matrix.columns))
    lines += [",".join(exact_text(value) for value in row) for row in matrix.rows]
    return "\n".join(lines) + "\n"


def read_csv(path: Path) -> tuple[GainMatrix, tuple[int, ...]]:
    """Read today's CSV matrix up to its end mark; return it and the line numbers after the mark.

    Raises `ConfigError` with every problem.
    """
    table = read_table(path)
    if table.header is None:
        message = f"no header; allowed {','.join(REQUIRED)} and more columns of a campaign"
        raise ConfigError([table.problem(1, 0, "", None, message)])
    house_columns = tuple(column._replace(legacy=column.name, aliases=()) for column in MASK4)
    numbers = name_columns(table, house_columns, REQUIRED)
    matrix = select_columns(numbers.names, numbers.rows)
    kp_column = matrix.columns.index(KP)
    ends = [i for i, row in enumerate(matrix.rows) if row[kp_column] == END_MARK]
    rows = matrix.rows[: ends[0]] if ends else matrix.rows
    if not rows:
        raise ConfigError([table.problem(table.rows[0].line, 0, "", None, "no row before the end")])
    after = table.rows[ends[0] + 1 :] if ends else ()
    return matrix._replace(rows=rows), tuple(row.line for row in after)


def format_campaign(
    matrix: GainMatrix, base: str, name: str, extra_lines: Iterable[str] = ()
) -> str:
    """Return a campaign file that takes everything but its matrix from ``base``.

    ``extra_lines`` are inserted before the matrix, which replaces any kind of matrix of the base.
    """
    lines = [f"extends: {base}", f"name: {name}", *extra_lines]
    lines += ["matrix:", "  grid:", "  csv:", "  list:"]
    for row in matrix.rows:
        cells = zip(matrix.columns, map(exact_text, row), strict=True)
        lines.append(f"    - {{{', '.join(f'{column}: {text}' for column, text in cells)}}}")
    return "\n".join(lines) + "\n"


def summary(matrix: GainMatrix) -> str:
    """Return the number of rows, and of values of the three main columns, as one line."""
    rates, kps, kis = (
        len({row[matrix.columns.index(name)] for row in matrix.rows}) for name in (SPRING, KP, KI)
    )
    rows = count_text(len(matrix.rows), "row")
    return f"{rows}, {count_text(rates, 'spring rate')}, {kps} x Kp, {kis} x Ki"
