"""Checks of a plant with its BEM file and its rig: what contradicts without being impossible."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from rig.config.problems import Problem, format_number
from rig.config.yaml_source import KeyPath, SourceMap
from rig.emulation.sea import build_sea
from rig.kinds.modular.config import RigFile
from rig.kinds.modular.tick.composition import ROTATION
from sim_plant import sea_states
from sim_plant.modes.bem import BemModes
from sim_plant.modes.bem_content import rotates
from sim_plant.modes.parameters import Plant

MASS_GAP = 0.05  # of the displaced water: a body with more or less does not float as computed
STIFFNESS_GAP = 0.05  # of the BEM file's
OFF_CENTRE = 1.0e-3  # m: a centre of mass as near to the axis of rotation as this is on it
NEGLIGIBLE = 1.0e-6  # of the largest stiffness: rounding of a zero

UNEXCITED = 0.01  # of the variance of the waves, beyond the BEM file: a warning
MOSTLY_UNEXCITED = 0.5  # an error

_ROUNDING = 1.0e-9

Finding = tuple[KeyPath, float, str]


def plant_findings(plant: Plant, bem: BemModes) -> Iterator[Finding]:
    """Yield key, value and message of each mode that contradicts its BEM file."""
    for index, (name, mode) in enumerate(plant.modes.items()):
        if mode.dof is None:
            continue
        centres = bem.centres[index] if rotates(mode.dof) else None
        if centres is not None and np.abs(centres.lever(mode.dof)).max() > OFF_CENTRE:
            yield (
                ("modes", name, "mass"),
                mode.mass,
                f"{format_number(mode.mass)} kg*m2: {centres.text(mode.dof)}: inertia and "
                "stiffness must be those about the axis of rotation, as of a body on a hinge",
            )
        volume = bem.volume[index]
        if volume is not None and mode.dof.rpartition("__")[2].capitalize() == "Heave":
            displaced = bem.density * volume
            if abs(mode.mass - displaced) > MASS_GAP * displaced:
                low, high = (1.0 - MASS_GAP) * displaced, (1.0 + MASS_GAP) * displaced
                yield (
                    ("modes", name, "mass"),
                    mode.mass,
                    f"{format_number(mode.mass)} kg, but the body displaces {volume:.4g} m3 = "
                    f"{displaced:.4g} kg: it does not float freely at this draught; without "
                    f"another force {low:.4g} .. {high:.4g} kg",
                )
        if bem.stiffness is None or mode.stiffness is None:
            continue
        of_file = float(bem.stiffness[index, index])
        unit = "N*m/rad" if rotates(mode.dof) else "N/m"
        if abs(of_file) <= NEGLIGIBLE * abs(bem.stiffness).max():
            continue  # nothing restores it but a mooring
        if abs(mode.stiffness - of_file) > STIFFNESS_GAP * abs(of_file):
            yield (
                ("modes", name, "stiffness"),
                mode.stiffness,
                f"{format_number(mode.stiffness)} {unit}, but the BEM file states {of_file:.5g} "
                f"{unit}; a mooring and the spring of an axis add to it",
            )


def rig_findings(plant: Plant, rig: RigFile) -> Iterator[Finding]:
    """Yield each axis of a rig whose motion is not that of the mode it moves with one to one."""
    for name, axis in rig.axes.items():
        moves_with = plant.axes[name].moves_with if name in plant.axes else {}
        if len(moves_with) != 1:
            continue
        mode, factor = next(iter(moves_with.items()))
        dof = plant.modes[mode].dof
        if dof is None:
            continue
        if math.isclose(abs(factor), 1.0) and rotates(dof) != (axis.motion == ROTATION):
            yield (
                ("axes", name, "motion"),
                factor,
                f"{axis.motion}, but in the plant it moves one to one with {dof}, which is "
                f"{'an angle' if rotates(dof) else 'a distance'}",
            )


def sea_finding(sea: dict[str, Any], bem: BemModes) -> tuple[float, str]:
    """Return the share of the variance of a sea (of `build_sea`) beyond a BEM file, and a message.

    Above its frequencies nothing excites the body; below, the force is that of the lowest one.
    """
    built = build_sea(sea)
    frequency, variance = sea_states.frequencies(built), np.abs(built.amplitude) ** 2
    low, high = float(bem.frequency[0]), float(bem.frequency[-1])
    outside = (frequency < low * (1.0 - _ROUNDING)) | (frequency > high * (1.0 + _ROUNDING))
    share = float(variance[outside].sum() / max(variance.sum(), 1e-300))
    return share, (
        f"{share:.1%} of the variance of the waves is beyond the BEM file: allowed {low:.4g} .. "
        f"{high:.4g} Hz; above nothing excites the body"
    )


def plant_warnings(
    plant: Plant, bem: BemModes, locate: SourceMap, rig: RigFile, rig_locate: SourceMap
) -> tuple[Problem, ...]:
    """Return all findings as warnings, with their places in plant and rig file."""
    of_plant = (locate.problem(*finding) for finding in plant_findings(plant, bem))
    of_rig = (rig_locate.problem(*finding) for finding in rig_findings(plant, rig))
    return (*of_plant, *of_rig)
