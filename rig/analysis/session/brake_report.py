"""The brake map session: torque over current, both branches."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import SubFigure

from rig.analysis.session import brake_map
from rig.analysis.session.brake_map import BrakeMap, Held
from rig.analysis.session.drawing import BLUE, RED, axes_of, note
from rig.analysis.session.estimate import Estimate
from rig.analysis.session.points import Session
from rig.analysis.session.result import Column, Compared, Picture, Result, Table, number, words

RANGE = (2.0, 95.0)
"""N*m of the brake, OSWEC thesis, section 2.1."""


def result(session: Session) -> Result:
    """Analyse a run."""
    whole = session.whole
    held = brake_map.held(
        [point.motion() for point in whole],
        [float(np.median(point.brake_current)) for point in whole],
    )
    found = brake_map.brake_map(held)
    idle = held[int(np.argmin([each.current for each in held]))]
    named = {"brake_residual": idle.torque, "brake_hysteresis": found.hysteresis}
    return Result(
        (_table(held, [point.row for point in whole]),),
        _compared(held, found, idle.torque),
        named,
        (
            Picture("brake_map", "The brake's torque over current", "Points with 95 % intervals.",
                    (7.2, 4.8), partial(_draw, found)),
        ),
        (
            "Torque is the load cell's, so the bearing's (below 0.4 N·m) is in it. A branch is the "
            "way its current was reached from the set point before.",
        ),
        _maps(found),
    )  # fmt: skip


def _table(held: Sequence[Held], rows: list[int]) -> Table:
    return Table(
        "brake_points",
        "Brake: torque by set point",
        (
            Column("row", "", tuple(rows)),
            Column("current", "A", tuple(each.current for each in held)),
            Column("branch", "", tuple("rising" if e.rising else "falling" for e in held)),
            Column("torque", "N*m", tuple(each.torque.value for each in held)),
            Column("torque ±", "N*m", tuple(each.torque.uncertainty for each in held)),
        ),
    )


def _compared(held: Sequence[Held], found: BrakeMap, idle: Estimate) -> tuple[Compared, ...]:
    most = max(each.torque.value for each in held)
    return (
        Compared("residual torque", f"{RANGE[0]:g} N·m", "", words(idle), None),
        Compared("largest torque", f"{RANGE[1]:g} N·m", "", f"{number(most, 4)} N·m", None),
        Compared("falling less rising branch", "", "", words(found.hysteresis), None),
    )


def _maps(found: BrakeMap) -> dict[str, Any]:
    branches = {}
    for name in ("rising", "falling"):
        branch = getattr(found, name)
        rises = np.append(True, np.diff(np.maximum.accumulate(branch.torque)) > 1e-6)
        if rises.sum() < 2:
            return {}
        branches[name] = {
            "current_a": branch.current[rises].tolist(),
            "torque_n_m": branch.torque[rises].tolist(),
            "uncertainty_n_m": branch.uncertainty[rises].tolist(),
        }
    return {"brake_map": branches}


def _draw(found: BrakeMap, body: SubFigure) -> None:
    axes = axes_of(body, "brake current, A", "torque, N·m")
    for name, colour, mark in (("rising", BLUE, "o-"), ("falling", RED, "s--")):
        branch = getattr(found, name)
        if len(branch.current):
            half = np.nan_to_num(branch.uncertainty)
            axes.errorbar(branch.current, branch.torque, half, fmt=mark, ms=4, lw=1.2,
                          color=colour, capsize=2.5, label=name)  # fmt: skip
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False, fontsize=8, loc="upper left")
    note(axes, f"falling less rising {words(found.hysteresis)}", "lower right")
