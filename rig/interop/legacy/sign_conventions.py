"""Gains of another rig's feedback turned into house signs: F = Kp v + Ki x on the body.

Those rigs command a motor current from motor angle theta and speed omega,

    LUPA    I = +-(K theta + B omega) r^2 / Kt      r = 0.0636651 m, gains in N/m and N s/m
    FOSWEC  I = +-(K theta + B omega) / (Kt N^2)    N = 75/20, gains in N m/rad and N m s/rad

(public repositories PMEC-OSU/LUPA, /WEC-Bench and /FOSWEC2). What force on the body that is
depends on the travel L = lever / gear per radian of the motor, and on the sign of the feedback:
the files say neither, so a person must. With F = T / L and theta = x / L

    F = +-(K x + B v) s,    s = g (Kt / Kt') / L^2,    g = r^2 or 1 / N^2

where Kt' is the torque constant the controller divided by and Kt the true one.
"""

import math
from typing import Literal, NamedTuple

from rig.config.problems import ConfigError, Problem, display_path, format_number
from rig.interop.legacy.columns import KI, KP, SPRING
from rig.interop.legacy.matrix import Matrix, problems
from rig.interop.legacy.stepped import Stepped, cell_column

LUPA_SPROCKET = 0.0636651  # m, pitch radius of the 50-tooth sprocket in the LUPA scripts
FOSWEC_GEAR = 75.0 / 20.0

FLAPS = ("aft", "bow")


class Statement(NamedTuple):
    """What a person says of the rig the gains were written for."""

    lever: float  # m of body travel per radian of the output shaft
    gear: float  # motor radians per radian of the output shaft
    positive_damping: Literal["absorbs", "drives"]
    spring_rate: float  # N/m, of a magnetic spring beside the feedback
    flap: str | None = None  # aft or bow, for foswec
    torque_constant_ratio: float = 1.0  # true over the one the controller divides by

    def description(self) -> str:
        """The statement in a line, as it is written into what comes of it."""
        said = (
            f"lever {format_number(self.lever)} m, gear {format_number(self.gear)}, positive damping "
            f"{self.positive_damping}, torque constant true/used "
            f"{format_number(self.torque_constant_ratio)}, spring {format_number(self.spring_rate)} N/m"
        )
        return f"{said}, {self.flap} flap" if self.flap else said


def missing(style: str, given: dict[str, object]) -> tuple[str, ...]:
    """Names of what must still be said before gains of ``style`` can be turned."""
    needed = ["lever", "gear", "positive_damping", "spring_rate"]
    if style == "foswec":
        needed.append("flap")
    return tuple(name for name in needed if given.get(name) is None)


def factor(style: str, said: Statement) -> float:
    """Newtons on the body per unit of gain: s of this module's equation (1, or 1/m2 for foswec)."""
    travel = said.lever / said.gear  # m per radian of the motor
    own = LUPA_SPROCKET * LUPA_SPROCKET if style == "lupa" else 1.0 / (FOSWEC_GEAR * FOSWEC_GEAR)
    return own * said.torque_constant_ratio / (travel * travel)


def converted(found: Stepped, said: Statement) -> Matrix:
    """The rows between the zeros as a matrix of ours.

    Raises `ConfigError` naming every cell that has no place here (gains from one flap to the
    other) and every value that a campaign refuses, and a statement that makes no sense.
    """
    wrong = _senseless(found, said)
    if wrong:
        raise ConfigError(wrong)
    stiffness, damping = _gains_of(found.style, said.flap)
    wrong = [
        found.table.problem(
            found.lines[i],
            cell_column(found, name),
            name,
            found.rows[i][found.columns.index(name)],
            f"{format_number(found.rows[i][found.columns.index(name)])} acts from one flap on the "
            "other; F = Kp v + Ki x of one axis has no place for it",
        )
        for i in found.active
        for name in found.columns
        if name.startswith(said.flap or "-") and name.endswith("CC")
        if found.rows[i][found.columns.index(name)] != 0.0
    ]
    scale = factor(found.style, said)
    sign = -scale if said.positive_damping == "absorbs" else scale
    at_k, at_b = found.columns.index(stiffness), found.columns.index(damping)
    rows = tuple(
        (said.spring_rate, 0.0 + sign * found.rows[i][at_b], 0.0 + sign * found.rows[i][at_k])
        for i in found.active
    )
    matrix = Matrix((SPRING, KP, KI), rows)
    wrong += _refused(found, matrix, (stiffness, damping))
    if wrong:
        raise ConfigError(wrong)
    return matrix


def _gains_of(style: str, flap: str | None) -> tuple[str, str]:
    return ("stiffness", "damping") if style == "lupa" else (f"{flap}Stiff", f"{flap}Damp")


def _senseless(found: Stepped, said: Statement) -> list[Problem]:
    file, wrong = display_path(found.path), []
    for name, value in (
        ("lever", said.lever),
        ("gear", said.gear),
        ("torque constant ratio", said.torque_constant_ratio),
    ):
        if not (math.isfinite(value) and value > 0.0):
            message = f"{format_number(value)} is out of range; allowed above 0"
            wrong.append(Problem(file, 1, name, value, message))
    if found.style == "foswec" and said.flap not in FLAPS:
        message = f"{said.flap} is not known; allowed {', '.join(FLAPS)}"
        wrong.append(Problem(file, 1, "flap", said.flap, message))
    return wrong


def _refused(found: Stepped, matrix: Matrix, names: tuple[str, str]) -> list[Problem]:
    """What a campaign refuses of the converted rows, told at the cell it comes from."""
    source = {KI: names[0], KP: names[1]}
    told = []
    for problem in problems(matrix):
        name = source.get(problem.key, "")
        if not name:
            told.append(problem._replace(file=display_path(found.path)))
            continue
        index = found.active[problem.line - 1]
        value = found.rows[index][found.columns.index(name)]
        message = f"{format_number(value)} becomes {problem.key} {problem.message}"
        column = cell_column(found, name)
        told.append(found.table.problem(found.lines[index], column, name, value, message))
    return told
