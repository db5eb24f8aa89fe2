"""Convert gains of another rig's feedback to house signs: F = Kp v + Ki x on the body.

These rigs command a motor current from motor angle theta and speed omega,

    LUPA    I = +-(K theta + B omega) r^2 / Kt      r = 0.0636651 m, gains in N/m and N s/m
    FOSWEC  I = +-(K theta + B omega) / (Kt N^2)    N = 75/20, gains in N m/rad and N m s/rad

(public repositories PMEC-OSU/LUPA, /WEC-Bench and /FOSWEC2). The force on the body depends on the
travel L = lever / gear per radian of the motor and on the sign of the feedback. The files contain
neither, so a person must state both. With F = T / L and theta = x / L

    F = +-(K x + B v) s,    s = g (Kt / Kt') / L^2,    g = r^2 or 1 / N^2

where Kt' is the torque constant that the controller divided by and Kt the true one.
"""

import math
from typing import Literal, NamedTuple

from rig.config.problems import ConfigError, Problem, display_path, format_number
from rig.interop.legacy.columns import KI, KP, SPRING
from rig.interop.legacy.matrix import GainMatrix, matrix_problems
from rig.interop.legacy.stepped import SteppedMatrix, cell_column

LUPA_SPROCKET_RADIUS = 0.0636651  # m, pitch radius of the 50-tooth sprocket in the LUPA scripts
FOSWEC_GEAR_RATIO = 75.0 / 20.0

FLAPS = ("aft", "bow")


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
            f"lever {format_number(self.lever)} m, gear {format_number(self.gear)}, positive "
            "damping "
            f"{self.positive_damping}, torque constant true/used "
            f"{format_number(self.torque_constant_ratio)}, spring "
            f"{format_number(self.spring_rate)} N/m"
        )
        return f"{text}, {self.flap} flap" if self.flap else text


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


def convert(source: SteppedMatrix, rig: SourceRig) -> GainMatrix:
    """Convert the rows between the zero rows to a gain matrix in house signs.

    Raises `ConfigError` with every cell that one axis cannot represent (gains from one flap to the
    other), every value that a campaign refuses, and every invalid entry of ``rig``.
    """
    problems = _rig_problems(source, rig)
    if problems:
        raise ConfigError(problems)
    stiffness, damping = _gain_columns(source.style, rig.flap)
    problems = [
        source.table.problem(
            source.lines[i],
            cell_column(source, name),
            name,
            source.rows[i][source.columns.index(name)],
            f"{format_number(source.rows[i][source.columns.index(name)])} acts from one flap on "
            "the "
            "other; F = Kp v + Ki x of one axis cannot represent it",
        )
        for i in source.active
        for name in source.columns
        if name.startswith(rig.flap or "-") and name.endswith("CC")
        if source.rows[i][source.columns.index(name)] != 0.0
    ]
    scale = force_per_gain(source.style, rig)
    sign = -scale if rig.positive_damping == "absorbs" else scale
    at_k, at_b = source.columns.index(stiffness), source.columns.index(damping)
    rows = tuple(
        (rig.spring_rate, 0.0 + sign * source.rows[i][at_b], 0.0 + sign * source.rows[i][at_k])
        for i in source.active
    )
    matrix = GainMatrix((SPRING, KP, KI), rows)
    problems += _campaign_problems(source, matrix, (stiffness, damping))
    if problems:
        raise ConfigError(problems)
    return matrix


def _gain_columns(style: str, flap: str | None) -> tuple[str, str]:
    return ("stiffness", "damping") if style == "lupa" else (f"{flap}Stiff", f"{flap}Damp")


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


def _campaign_problems(
    source: SteppedMatrix, matrix: GainMatrix, names: tuple[str, str]
) -> list[Problem]:
    """Return the problems of the converted rows, each at the cell of the source file."""
    gain_columns = {KI: names[0], KP: names[1]}
    problems = []
    for problem in matrix_problems(matrix):
        name = gain_columns.get(problem.key, "")
        if not name:
            problems.append(problem._replace(file=display_path(source.path)))
            continue
        index = source.active[problem.line - 1]
        value = source.rows[index][source.columns.index(name)]
        message = f"{format_number(value)} becomes {problem.key} {problem.message}"
        column = cell_column(source, name)
        problems.append(source.table.problem(source.lines[index], column, name, value, message))
    return problems
