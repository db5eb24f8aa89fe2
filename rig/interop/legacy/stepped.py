"""Gain matrices of the LUPA, WEC-Bench and FOSWEC rigs: stiffness and damping, one row per step.

Public repositories PMEC-OSU/LUPA, /WEC-Bench and /FOSWEC2. Their Simulink block selects a row by

    idx = ceil(time / GainTstep);  while idx > nrows, idx = idx - nrows;  end

with GainTstep = numPeriods * wavePeriod. It has two traps: at time 0 the index is 0, outside
MATLAB's range; after the last row the block starts again with the first one, for ever.

These rigs command a motor current from motor angle theta and speed omega,

    LUPA    I = +-(K theta + B omega) r^2 / Kt      r = 0.0636651 m, gains in N/m and N s/m
    FOSWEC  I = +-(K theta + B omega) / (Kt N^2)    N = 75/20, gains in N m/rad and N m s/rad

The force on the body depends on the travel L = lever / gear per radian of the motor and on the
sign of the feedback. The files contain neither, so a person must state both. With F = T / L and
theta = x / L, in house signs (F = Kp v + Ki x on the body)

    F = +-(K x + B v) s,    s = g (Kt / Kt') / L^2,    g = r^2 or 1 / N^2

where Kt' is the torque constant that the controller divided by and Kt the true one.
"""

import math
from pathlib import Path
from typing import Literal, NamedTuple

from rig.config.matrix import KindColumns
from rig.config.problems import ConfigError, Problem, display_path, format_number
from rig.interop.legacy.matrix import (
    FOSWEC,
    KI,
    KP,
    LUPA,
    SPRING,
    Column,
    GainMatrix,
    NumberTable,
    name_columns,
    refused_values,
)
from rig.interop.legacy.table import SKIPPED, read_table

STYLES: dict[str, tuple[Column, ...]] = {"lupa": LUPA, "foswec": FOSWEC}
"""Columns of each style, in the order of its files; WEC-Bench files are of style `lupa`."""

LUPA_SPROCKET_RADIUS = 0.0636651  # m, pitch radius of the 50-tooth sprocket in the LUPA scripts
FOSWEC_GEAR_RATIO = 75.0 / 20.0

FLAPS = ("aft", "bow")


class SteppedMatrix(NamedTuple):
    """A gain matrix of equal steps: feedback gains in the signs of its file."""

    path: Path
    style: str
    columns: tuple[str, ...]
    file: NumberTable
    rows: tuple[tuple[float, ...], ...]  # all rows of the file, by ``columns``
    active: range  # indices of the rows from the first gain to the last
    remarks: tuple[str, ...]

    def value(self, row: int, name: str) -> float:
        """Return the gain of a column in a row of the file."""
        return self.rows[row][self.columns.index(name)]


class SourceRig(NamedTuple):
    """The rig that the gains were written for, as stated by a person."""

    lever: float  # m of body travel per radian of the output shaft
    gear: float  # motor radians per radian of the output shaft
    positive_damping: Literal["absorbs", "drives"]
    spring_rate: float  # N/m, of a magnetic spring in parallel with the feedback
    flap: str | None = None  # aft or bow, for foswec
    torque_constant_ratio: float = 1.0  # true value / value that the controller divides by

    def description(self) -> str:
        """Return the statement as one line, for the header of converted files."""
        text = (
            f"lever {format_number(self.lever)} m, gear {format_number(self.gear)}, "
            f"positive damping {self.positive_damping}, "
            f"torque constant true/used {format_number(self.torque_constant_ratio)}, "
            f"spring {format_number(self.spring_rate)} N/m"
        )
        return f"{text}, {self.flap} flap" if self.flap else text


def read(
    path: Path,
    style: str,
    columns: str | None = None,
    *,
    sheet: str | None = None,
    variable: str | None = None,
) -> SteppedMatrix:
    """Read a gain matrix of style ``style``: `lupa` (two columns) or `foswec` (eight).

    Without header or ``columns`` the column order is that of the style. Rows of zeros at both ends
    are not active. Raises `ConfigError` with every problem.
    """
    needed = tuple(column.name for column in STYLES[style])
    table = read_table(path, sheet, variable)
    file = name_columns(table, STYLES[style], needed, columns, order=needed)
    indices = [file.names.index(name) for name in needed]
    rows = tuple(tuple(row[i] for i in indices) for row in file.rows)
    nonzero = [i for i, row in enumerate(rows) if any(row)]
    if not nonzero:
        raise ConfigError([table.problem(file.lines[0], 0, "", None, "all gains are zero")])
    active = range(nonzero[0], nonzero[-1] + 1)
    remarks = [
        f"line {file.lines[i]}: all gains are zero between rows with gains; kept as a row"
        for i in active
        if not any(rows[i])
    ]
    if len(rows) < len(needed):
        remarks.append(
            f"{len(rows)} rows and {len(needed)} columns: MATLAB's length() gives the larger, "
            "so a block that uses it runs beyond the last row"
        )
    if SKIPPED in file.names:
        remarks.append(f"{file.names.count(SKIPPED)} columns left out")
    return SteppedMatrix(Path(path), style, needed, file, rows, active, tuple(remarks))


def missing_parameters(style: str, given: dict[str, object]) -> tuple[str, ...]:
    """Return the names of the `SourceRig` entries that ``style`` needs and ``given`` lacks."""
    needed = ["lever", "gear", "positive_damping", "spring_rate"]
    if style == "foswec":
        needed.append("flap")
    return tuple(name for name in needed if given.get(name) is None)


def force_per_gain(style: str, rig: SourceRig) -> float:
    """Return the factor s of this module's equation: unit 1 for lupa, 1/m2 for foswec."""
    travel = rig.lever / rig.gear  # m per radian of the motor
    own = (
        LUPA_SPROCKET_RADIUS * LUPA_SPROCKET_RADIUS
        if style == "lupa"
        else 1.0 / (FOSWEC_GEAR_RATIO * FOSWEC_GEAR_RATIO)
    )
    return own * rig.torque_constant_ratio / (travel * travel)


def convert(source: SteppedMatrix, rig: SourceRig, columns: KindColumns) -> GainMatrix:
    """Convert the active rows to a gain matrix in house signs.

    Raises `ConfigError` with every cell that one axis cannot represent (gains from one flap to the
    other), every value that a campaign with these ``columns`` refuses, and every invalid entry of
    ``rig``.
    """
    if problems := _rig_problems(source, rig):
        raise ConfigError(problems)
    stiffness, damping = "stiffness", "damping"
    if source.style == "foswec":
        stiffness, damping = f"{rig.flap}Stiff", f"{rig.flap}Damp"
    scale = force_per_gain(source.style, rig)
    sign = -scale if rig.positive_damping == "absorbs" else scale
    rows = tuple(
        (
            rig.spring_rate,
            0.0 + sign * source.value(i, damping),
            0.0 + sign * source.value(i, stiffness),
        )
        for i in source.active
    )
    matrix = GainMatrix((SPRING, KP, KI), rows)
    problems = _cross_gain_problems(source, rig)
    for row, name, converted, message in refused_values(matrix, columns):
        if name == SPRING:
            problems.append(Problem(display_path(source.path), row + 1, name, converted, message))
            continue
        line, own_name = source.active[row], damping if name == KP else stiffness
        value = source.value(line, own_name)
        becomes = f"{format_number(value)} becomes {name} {message}"
        problems.append(source.file.problem(line, own_name, value, becomes))
    if problems:
        raise ConfigError(problems)
    return matrix


def _rig_problems(source: SteppedMatrix, rig: SourceRig) -> list[Problem]:
    file, problems = display_path(source.path), []
    for name, value in (
        ("lever", rig.lever),
        ("gear", rig.gear),
        ("torque constant ratio", rig.torque_constant_ratio),
    ):
        if not (math.isfinite(value) and value > 0.0):
            message = f"{format_number(value)} is out of range; allowed above 0"
            problems.append(Problem(file, 1, name, value, message))
    if source.style == "foswec" and rig.flap not in FLAPS:
        message = f"{rig.flap} is not a flap; allowed {', '.join(FLAPS)}"
        problems.append(Problem(file, 1, "flap", rig.flap, message))
    return problems


def _cross_gain_problems(source: SteppedMatrix, rig: SourceRig) -> list[Problem]:
    """Return a problem for every gain from one flap to the other."""
    names = [n for n in source.columns if n.startswith(rig.flap or "-") and n.endswith("CC")]
    return [
        source.file.problem(
            i,
            name,
            value,
            f"{format_number(value)} acts from one flap on the other; "
            "F = Kp v + Ki x of one axis cannot represent it",
        )
        for i in source.active
        for name in names
        if (value := source.value(i, name)) != 0.0
    ]
