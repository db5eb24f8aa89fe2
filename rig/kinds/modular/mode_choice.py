"""Modes of a BEM file, their rigid bodies and the PTOs between them, as options choose them.

Nothing is guessed: several modes, wave directions, depths or bodies, and numbers that the file does
not state, are listed with the options that choose them.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.kinds.modular.plant_checks import NEGLIGIBLE, OFF_CENTRE
from rig.kinds.modular.plant_text import (
    DAMPING_RATIO,
    AxisMotion,
    ModeEntry,
    names_of_modes,
    rounded,
)
from sim_plant.modes.bem import BemModes, choose, open_choices, read_content, stated_mass
from sim_plant.modes.bem_content import BemContent, Water, body_of, direction_of, rotates
from sim_plant.modes.building import factors_between

OPEN_MASS_COUPLING = 0.01  # of the masses' geometric mean: a plant has a mass for each mode alone

_AXIS_NAME = re.compile(r"[a-z](_?[a-z0-9])*")
_FACTOR = r"\d+\.?\d*|\.\d+"


class ModeOptions(NamedTuple):
    """Options of the commands that read a BEM file."""

    bem: Path
    dofs: tuple[str, ...] = ()
    axes: tuple[str, ...] = ()  # `NAME=MODES`, or a mode
    masses: tuple[str, ...] = ()  # `MODE=NUMBER`, or a number for a single mode
    stiffnesses: tuple[str, ...] = ()
    direction: float | None = None  # degrees, of the waves
    water: Water = Water()


class ChosenModes(NamedTuple):
    """The modes of a plant and the motions of its axes, by name."""

    content: BemContent
    bem: BemModes  # of the chosen modes
    modes: tuple[ModeEntry, ...]
    axes: dict[str, AxisMotion]


def choose_modes(
    options: ModeOptions,
    problems: Iterable[str] = (),
    *,
    pto_of_each: bool = False,
    restored: bool = False,
) -> ChosenModes:
    """Return the modes and axes that options choose.

    ``problems`` are those of other options. ``pto_of_each``: without ``axes`` each of several modes
    has a PTO, otherwise they are refused. ``restored``: each mode needs a stiffness above 0. Raises
    ValueError with everything that is wrong or open.
    """
    content = read_content(options.bem, options.water)
    found: list[str] = []
    dofs = tuple(options.dofs or modes_of_axes(options.axes, content.modes))
    found += _wrong_modes(content, dofs)
    found += open_choices(content, dofs or None, options.direction)
    axes: dict[str, AxisMotion] = {}
    if dofs or options.axes:
        candidates = dofs or content.modes
        axes, wrong = axis_motions(options.axes, candidates, pto_of_each=pto_of_each)
        found += wrong
    masses, wrong_masses = numbers_by_mode("--mass", options.masses, dofs)
    stiffnesses, wrong_stiffnesses = numbers_by_mode("--stiffness", options.stiffnesses, dofs)
    found += [*wrong_masses, *wrong_stiffnesses]
    found += [f"--mass {d}={mass:g}: allowed above 0" for d, mass in masses.items() if mass <= 0.0]
    if dofs and set(dofs) <= set(content.modes):
        found += _missing_numbers(content, dofs, masses, stiffnesses, restored=restored)
        found += _mass_couplings(content, dofs, masses)
        found += _off_centre_rotations(content, dofs, masses)
    found = [*(f"{options.bem}: {each}" for each in found), *problems]
    if found:
        raise ValueError("\n".join(found))
    bem = choose(options.bem, content, dofs, options.direction)
    modes = tuple(
        _mode_entry(bem, k, name, masses, stiffnesses)
        for k, name in enumerate(names_of_modes(bem.modes))
    )
    return ChosenModes(content, bem, modes, axes)


def _wrong_modes(content: BemContent, dofs: Sequence[str]) -> Iterator[str]:
    """Yield what is wrong with the choice of modes, besides names that do not exist."""
    if not dofs:
        bodies = sorted({mode.rpartition("__")[0] for mode in content.modes} - {""})
        several = f" of the bodies {', '.join(bodies)}" if len(bodies) > 1 else ""
        listed = ", ".join(content.modes)
        yield f"has several modes{several}: {listed}; choose some with --dof"
    for dof in dict.fromkeys(dofs):
        if dofs.count(dof) > 1:
            yield f"--dof {dof} is given twice"


def modes_of_axes(axes: Sequence[str], modes: Sequence[str]) -> list[str]:
    """Return the only mode of a file, or those that some axes move with, in the file's order."""
    if len(modes) == 1:
        return list(modes)
    used = {dof for text in axes for dof in (_combination(text.rpartition("=")[2], modes) or ())}
    return [mode for mode in modes if mode in used]


# Motions of the axes.
def axis_motions(
    texts: Sequence[str], dofs: Sequence[str], *, pto_of_each: bool = False
) -> tuple[dict[str, AxisMotion], list[str]]:
    """Return the motions of all axes by name, and what is wrong with them."""
    names = dict(zip(dofs, names_of_modes(dofs), strict=True))
    if not texts:
        if len(dofs) > 1 and not pto_of_each:
            return {}, [
                f"{len(dofs)} modes, but no motion of a PTO; choose it with --axis, as "
                f"{_example(dofs)} or {dofs[0]}; repeat it for several PTOs"
            ]
        texts = dofs
    found: dict[str, AxisMotion] = {}
    problems = []
    for text in texts:
        name, equals, expression = text.rpartition("=")
        factors = _combination(expression, dofs)
        if factors is None:
            problems.append(
                f"--axis {text}: expected NAME=MODES, a sum or difference of {', '.join(dofs)}, "
                f"such as {_example(dofs)} or arm=0.5*{dofs[0]}"
            )
            continue
        if not equals and len(factors) == 1:
            name = names[next(iter(factors))]
        if not _AXIS_NAME.fullmatch(name):
            problems.append(
                f"--axis {text}: {name!r} is no name of a log field; allowed [a-z][a-z0-9_]*, as in"
                f" pto={expression}"
            )
        if name in found:
            problems.append(f"--axis {text}: {name} is given twice")
        angles = [rotates(dof) for dof in factors]
        if any(angles) and not all(angles):
            problems += [
                f"--axis {text}: {dof} is an angle among distances; give its lever arm in m, as "
                f"1.5*{dof}"
                for dof in factors
                if rotates(dof) and not re.search(rf"\*\s*{re.escape(dof)}", expression)
            ]
        moves_with = {names[dof]: factor for dof, factor in factors.items()}
        found[name] = AxisMotion(moves_with, all(angles))
    matrix = factors_between(names.values(), [motion.moves_with for motion in found.values()])
    if not problems and found and np.linalg.matrix_rank(matrix) < len(found):
        listed = ", ".join(found)
        problems.append(f"--axis: the motions of {listed} depend on each other; leave out some")
    return found, problems


def _example(dofs: Sequence[str]) -> str:
    """Return the motion between two modes of one sort, or of a mode, as an option has it."""
    alike = [dof for dof in dofs if rotates(dof) == rotates(dofs[0])]
    return f"pto={'-'.join(alike[:2])}"


def _combination(text: str, dofs: Sequence[str]) -> dict[str, float] | None:
    """Return the factors of modes in `A-0.5*B`; None for another text, or a mode twice."""
    listed = "|".join(re.escape(dof) for dof in sorted(dofs, key=len, reverse=True))
    term = rf"(?:(?P<factor>{_FACTOR})\s*\*\s*)?(?P<dof>{listed})"
    compact = text.strip()
    factors: dict[str, float] = {}
    at = 0
    while dofs and at < len(compact):
        sign = "[+-]" if at else "[+-]?"
        found = re.compile(rf"\s*(?P<sign>{sign})\s*{term}").match(compact, at)
        if found is None or found["dof"] in factors:
            return None
        size = float(found["factor"] or 1.0)
        factors[found["dof"]] = -size if found["sign"] == "-" else size
        at = found.end()
    return factors if factors and all(factors.values()) else None


# Numbers of the rigid bodies.
def numbers_by_mode(
    option: str, texts: Sequence[str], dofs: Sequence[str]
) -> tuple[dict[str, float], list[str]]:
    """Return the numbers of a repeated option by mode, and what is wrong with them."""
    found: dict[str, float] = {}
    problems = []
    for text in texts:
        dof, equals, number = text.rpartition("=")
        if not equals and len(dofs) == 1:
            dof = dofs[0]
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if dof not in dofs or not math.isfinite(value):
            names = ", ".join(dofs) or "the modes of --dof"
            problems.append(f"{option} {text}: expected MODE=NUMBER with a mode of {names}")
        elif dof in found:
            problems.append(f"{option} of {dof} is given twice")
        found[dof] = value
    return found, problems


def _missing_numbers(
    content: BemContent,
    dofs: Sequence[str],
    masses: Mapping[str, float],
    stiffnesses: Mapping[str, float],
    *,
    restored: bool,
) -> Iterator[str]:
    """Yield the masses and stiffnesses that neither file nor options state."""
    for dof in dofs:
        k = content.modes.index(dof)
        units = ("kg*m2", "N*m/rad") if rotates(dof) else ("kg", "N/m")
        if dof not in masses and stated_mass(content, k)[0] is None:
            yield f"does not state the mass of {dof}: give --mass {dof}=... ({units[0]})"
        stiffness = stiffnesses.get(dof, own_stiffness(content, k))
        request = f"give --stiffness {dof}=... ({units[1]}), with that of the mooring"
        if stiffness is None:
            drift = "" if restored else "; 0 lets it drift"
            yield f"states no stiffness of {dof}: {request}{drift}"
        elif restored and stiffness <= 0.0:
            yield f"{dof} has a stiffness of {stiffness:g} {units[1]} and would drift: {request}"


def own_stiffness(bem: BemContent | BemModes, mode: int) -> float | None:
    """Return the file's hydrostatic stiffness of a mode; None if it has none or only rounding."""
    if bem.stiffness is None:
        return None
    own = float(bem.stiffness[mode, mode])
    largest = float(np.nanmax(np.abs(bem.stiffness)))
    return own if abs(own) > NEGLIGIBLE * largest else None


def _mass_couplings(
    content: BemContent, dofs: Sequence[str], masses: Mapping[str, float]
) -> Iterator[str]:
    """Yield the terms of the file's inertia that a plant cannot have."""
    if content.inertia is None:
        return
    for i, j in zip(*np.triu_indices(len(content.modes), 1), strict=True):
        one, other = content.modes[i], content.modes[j]
        term = float(content.inertia[i, j])
        size = math.sqrt(abs(float(content.inertia[i, i] * content.inertia[j, j])))
        open_pair = {one, other} <= set(dofs) and not {one, other} <= masses.keys()
        if math.isfinite(term) and open_pair and abs(term) > OPEN_MASS_COUPLING * size:
            yield (
                f"couples {one} and {other} by a mass of {term:.4g}, which a plant has not; rotate "
                "about the centre of mass, or give --mass of both to leave it out"
            )


def _off_centre_rotations(
    content: BemContent, dofs: Sequence[str], masses: Mapping[str, float]
) -> Iterator[str]:
    """Yield the rotations that a centre of mass off their axis couples with a translation."""
    centres = dict(zip(content.modes, content.centres, strict=False))
    for turned in filter(rotates, dofs):
        own = centres.get(turned)
        for moved in dofs:
            at = direction_of(moved)
            if own is None or at is None or body_of(moved) != body_of(turned):
                continue
            if abs(own.lever(turned)[at]) > OFF_CENTRE and not {turned, moved} <= masses.keys():
                yield (
                    f"{own.text(turned)}: that couples {moved} and {turned} by a mass, which a "
                    "plant has not; rotate about the centre of mass, or give --mass of both to "
                    "leave it out"
                )


def _mode_entry(
    bem: BemModes,
    mode: int,
    name: str,
    masses: Mapping[str, float],
    stiffnesses: Mapping[str, float],
) -> ModeEntry:
    """Return a mode with numbers that file or options state, and a first viscous damping."""
    dof = bem.modes[mode]
    mass, mass_source = masses.get(dof), "given"
    if mass is None:
        mass, mass_source = stated_mass(bem, mode)
    stiffness, source = stiffnesses.get(dof), "given"
    if stiffness is None:
        stiffness, source = own_stiffness(bem, mode), "hydrostatic, of the BEM file"
    assert mass is not None
    assert stiffness is not None
    inertia = mass + float(bem.added_mass_infinite[mode, mode])
    damping = 2.0 * DAMPING_RATIO * math.sqrt(max(stiffness, 0.0) * max(inertia, 0.0))
    return ModeEntry(
        name, dof, rounded(mass, 6), mass_source, rounded(stiffness, 6), source, rounded(damping)
    )
