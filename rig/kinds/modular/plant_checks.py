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
from sim_plant.modes.bem import BemModes, axis_damping
from sim_plant.modes.bem_content import rotates
from sim_plant.modes.building import factor_matrix
from sim_plant.modes.parameters import Plant

MASS_GAP = 0.05  # of displaced water and stated inertia: with more or less it floats otherwise
STIFFNESS_GAP = 0.05  # of the BEM file's
OFF_CENTRE = 1.0e-3  # m: a centre of mass as near to the axis of rotation as this is on it
NEGLIGIBLE = 1.0e-6  # of the largest stiffness: rounding of a zero

UNEXCITED = 0.01  # of the variance of the waves, beyond the BEM file: a warning
MOSTLY_UNEXCITED = 0.5  # an error

HARDLY_RADIATED = 1.0e-3  # of the largest radiation damping

_ROUNDING = 1.0e-9

Finding = tuple[KeyPath, float, str]


def plant_findings(plant: Plant, bem: BemModes) -> Iterator[Finding]:
    """Yield key, value and message of each mode that contradicts its BEM file."""
    wet = [(name, mode) for name, mode in plant.modes.items() if mode.dof is not None]
    for index, (name, mode) in enumerate(wet):
        assert mode.dof is not None
        centres = bem.centres[index] if rotates(mode.dof) else None
        if centres is not None and np.abs(centres.lever(mode.dof)).max() > OFF_CENTRE:
            yield (
                ("modes", name, "mass"),
                mode.mass,
                f"{format_number(mode.mass)} kg*m2: {centres.text(mode.dof)}: inertia and "
                "stiffness must be those about the axis of rotation, as of a body on a hinge",
            )
        if contradiction := _mass_contradiction(bem, index, mode.mass):
            yield ("modes", name, "mass"), mode.mass, contradiction
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


def _mass_contradiction(bem: BemModes, index: int, mass: float) -> str:
    """Return why the mass (kg or kg*m2) of a mode is not the file's; empty if it is.

    A body in heave is compared with the displaced water first, each mode with the file's inertia.
    """
    dof, volume = bem.modes[index], bem.volume[index]
    if volume is not None and dof.rpartition("__")[2].capitalize() == "Heave":
        displaced = bem.density * volume
        if abs(mass - displaced) > MASS_GAP * displaced:
            low, high = (1.0 - MASS_GAP) * displaced, (1.0 + MASS_GAP) * displaced
            return (
                f"{format_number(mass)} kg, but the body displaces {volume:.4g} m3 = "
                f"{displaced:.4g} kg: it does not float freely at this draught; without "
                f"another force {low:.4g} .. {high:.4g} kg"
            )
    stated = math.nan if bem.inertia is None else float(bem.inertia[index, index])
    if not stated > 0.0 or abs(mass - stated) <= MASS_GAP * stated:
        return ""
    unit = "kg*m2" if rotates(dof) else "kg"
    return (
        f"{format_number(mass)} {unit}, but the BEM file states {stated:.5g} {unit} "
        f"({bem.inertia_source})"
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


def still_axes(frequency: float, plant: Plant, bem: BemModes) -> Iterator[str]:
    """Yield a message for each axis that radiates hardly any waves of a frequency (Hz).

    By Haskind's relation waves of that frequency hardly excite it either. An axis that radiates at
    no frequency is left out.
    """
    wet = [mode.dof is not None for mode in plant.modes.values()]
    for name, factors in zip(plant.axes, factor_matrix(plant)[:, wet], strict=True):
        damping = np.abs(axis_damping(bem, factors))
        peak, there = float(damping.max()), float(np.interp(frequency, bem.frequency, damping))
        if there < HARDLY_RADIATED * peak:
            yield (
                f"at {frequency:.4g} Hz the radiation damping of {name} is {there / peak:.1g} of "
                f"its largest, at {bem.frequency[damping.argmax()]:.3g} Hz: waves hardly excite it"
            )


def plant_warnings(
    plant: Plant, bem: BemModes, locate: SourceMap, rig: RigFile, rig_locate: SourceMap
) -> tuple[Problem, ...]:
    """Return all findings as warnings, with their places in plant and rig file."""
    of_plant = (locate.problem(*finding) for finding in plant_findings(plant, bem))
    of_rig = (rig_locate.problem(*finding) for finding in rig_findings(plant, rig))
    return (*of_plant, *of_rig)
