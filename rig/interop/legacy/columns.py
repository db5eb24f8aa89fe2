"""The columns of gain matrices: their names here, in the old files, and their units.

The column order of the MASK4 files is unpublished, so columns go by name: from a header, or from
a list that a person gives. MASK4 report (Sandia), 3.2.3 and Tables 3-2 and 3-3.
"""

import difflib
import re
from typing import NamedTuple

from rig.config.problems import Problem, format_value
from rig.interop.legacy.table import SKIPPED, Row, Table

SPRING, KP, KI = "spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m"


class Column(NamedTuple):
    """A column of a gain matrix."""

    name: str  # as the campaign file has it, with the unit
    legacy: str  # as it is written into a MASK4 file
    others: tuple[str, ...]  # further names that are understood
    units: tuple[str, ...]  # ways to write its unit


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
"""All columns, in the order in which today's matrix has them."""

_ROTATIONAL = ("N*m/rad", "N m/rad", "Nm/rad", "N·m/rad")
_ROTATIONAL_DAMPING = ("N*m*s/rad", "N m s/rad", "Nms/rad", "N·m·s/rad")

LUPA = (
    Column("stiffness", "stiffness", ("stiff", "stiffness_Nperm"), ("N/m",)),
    Column("damping", "damping", ("damp", "damping_Npermpers"), _DAMPING),
)
"""Two columns; order of the public WEC-Bench and LUPA files where there is no header."""

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

NEEDED = (SPRING, KP, KI)

_UNIT = re.compile(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]\s*")


def by_header(
    table: Table, header: Row, known: tuple[Column, ...], needed: tuple[str, ...]
) -> tuple[tuple[str, ...], list[Problem]]:
    """Names of the columns after their header, and everything wrong with it."""
    words = [("" if cell is None else str(cell)) for cell in header.cells]
    while words and not words[-1]:
        words.pop()
    return _named(table, header.line, words, known, needed)


def by_list(
    table: Table, given: str, known: tuple[Column, ...], needed: tuple[str, ...]
) -> tuple[tuple[str, ...], list[Problem]]:
    """Names of the columns after a person's list, such as `Kp,Ki,springK,-`."""
    words = [word.strip() for word in given.split(",")]
    return _named(table, 0, words, known, needed)


def _named(
    table: Table, line: int, words: list[str], known: tuple[Column, ...], needed: tuple[str, ...]
) -> tuple[tuple[str, ...], list[Problem]]:
    problems, names = [], list[str]()
    for i, word in enumerate(words, start=1):
        name, message = _name(word, known)
        if not message and name != SKIPPED and name in names:
            first = names.index(name) + 1
            message = f"{word!r} is {name}, which is column {first} already"
        if message:
            problems.append(table.problem(line or 1, i, "columns", word, message))
            name = f"column {i}"
        names.append(name)
    missing = [name for name in needed if name not in names]
    if missing and not problems:
        message = f"no column for {', '.join(missing)} among {', '.join(words)}"
        problems.append(table.problem(line or 1, 0, "columns", None, message))
    return tuple(names), problems


def _name(word: str, known: tuple[Column, ...]) -> tuple[str, str]:
    """Today's name of a column, and what is wrong with the word."""
    if word == SKIPPED:
        return SKIPPED, ""
    split = _UNIT.fullmatch(word)
    bare, unit = split.groups() if split else (word, "")
    for column in known:
        if _plain(bare) in {_plain(n) for n in (column.name, column.legacy, *column.others)}:
            if unit and _compact(unit) not in {_compact(u) for u in column.units}:
                return "", f"{word!r}: unit {unit}; allowed {column.units[0]}"
            return column.name, ""
    names = [column.legacy for column in known]
    near = difflib.get_close_matches(bare, names, n=1, cutoff=0.6)
    nearest = f"did you mean {near[0]}?" if near else f"known are {', '.join(names)}"
    said = f"{format_value(word)} is no known column" if word else "a column without a name"
    return "", f"{said}; {nearest}"


def _plain(word: str) -> str:
    return "".join(c for c in word.lower() if c.isalnum())


def _compact(unit: str) -> str:
    return "".join(c for c in unit if c not in " *·-") or unit
