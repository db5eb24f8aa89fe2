"""The questions of `rig new rig` at a terminal: what neither the options nor the BEM file state."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from rig.kinds.modular.mode_choice import (
    ModeOptions,
    axis_motions,
    modes_of_axes,
    numbers_by_mode,
    own_stiffness,
)
from rig.kinds.modular.new_rig import Options
from sim_plant.modes.bem import read_content, stated_mass
from sim_plant.modes.bem_content import BemContent, OpenWaterError, Water, rotates


def ask_options(given: Options, *, ask_file: bool) -> Options:
    """Return the options, completed by answers; an answer that cannot be used is asked again.

    ``ask_file``: the BEM file is asked for, too.
    """
    modes, content = _read_file(given.modes, ask_file=ask_file)
    dofs = modes.dofs or tuple(modes_of_axes(modes.axes, content.modes))
    unknown = [dof for dof in dofs if dof not in content.modes]
    if unknown or not dofs:
        for dof in unknown:
            typer.echo(f"{modes.bem}: has no mode {dof!r}; it has {', '.join(content.modes)}")
            modes = modes._replace(masses=(), stiffnesses=())  # they were those modes'
        dofs = _choose_several("Modes that move (several with commas)", content.modes)
    axes = modes.axes
    if len(dofs) > 1 and not axes:
        axes = _ask_axes(dofs)
    direction = modes.direction
    if direction is None and len(content.directions) > 1:
        listed = [f"{each:g}" for each in content.directions]
        direction = float(_choose("Direction of the waves, degrees", listed))
    masses, stiffnesses = list(modes.masses), list(modes.stiffnesses)
    for dof in dofs:
        mode = content.modes.index(dof)
        units = ("kg*m2", "N*m/rad") if rotates(dof) else ("kg", "N/m")
        of_mode = f" of {dof}" if len(dofs) > 1 else ""
        if dof not in numbers_by_mode("--mass", modes.masses, dofs)[0]:
            known, source = stated_mass(content, mode)
            shown = f" (the file: {source})" if known is not None else ""
            masses += _ask_of_mode(dof, f"Mass{of_mode}, {units[0]}{shown}", known)
        if dof not in numbers_by_mode("--stiffness", modes.stiffnesses, dofs)[0]:
            own = own_stiffness(content, mode)
            known = own if own is not None and own > 0.0 else None
            question = f"Stiffness{of_mode} with that of the mooring, {units[1]}"
            stiffnesses += _ask_of_mode(dof, question, known)
    torque_constant = given.torque_constant or _ask_number(
        "Torque constant of the motor, N*m/A", 1.0
    )
    gear_ratio = given.gear_ratio
    if gear_ratio is None and typer.confirm("Is there a gear ratio already?", default=False):
        unit = "rad" if all(map(rotates, dofs)) else "m"
        gear_ratio = _ask_number(f"Motor angle per {unit} of the axis", None)
    modes = modes._replace(
        dofs=dofs, axes=axes, masses=tuple(masses), stiffnesses=tuple(stiffnesses),
        direction=direction,
    )  # fmt: skip
    return given._replace(modes=modes, torque_constant=torque_constant, gear_ratio=gear_ratio)


def _read_file(modes: ModeOptions, *, ask_file: bool) -> tuple[ModeOptions, BemContent]:
    """Return the options with a BEM file that can be read, and its content."""
    while True:
        if ask_file:
            path = Path(str(typer.prompt("File with the BEM coefficients"))).expanduser()
            modes = modes._replace(bem=path)
        try:
            return modes, read_content(modes.bem, modes.water)
        except OpenWaterError as error:
            typer.echo(str(error))
            ask_file = not error.fields
            modes = modes._replace(water=_ask_water(modes.water, error.fields))
        except (OSError, ValueError) as error:
            typer.echo(str(error))
            ask_file = True


def _ask_water(water: Water, fields: Sequence[str]) -> Water:
    """Return the water with answers for some of its fields."""
    questions = {
        "density": ("Density of the water, kg/m3", 1000.0),
        "gravity": ("Gravity, m/s2", 9.81),
        "depth": ("Depth of the water, m", None),
    }
    return water._replace(**{field: _ask_number(*questions[field]) for field in fields})


def _ask_axes(dofs: Sequence[str]) -> tuple[str, ...]:
    """Return the motions of the PTOs, as `--axis` has them."""
    question = f"Motions of the PTOs (several with commas), such as pto={dofs[0]}-{dofs[1]}"
    while True:
        axes = tuple(each.strip() for each in str(typer.prompt(question)).split(","))
        _, problems = axis_motions(axes, dofs)
        if not problems:
            return axes
        typer.echo("\n".join(problems))


def _choose_several(question: str, choices: Sequence[str]) -> tuple[str, ...]:
    """Return some of some choices, by names or numbers; the only one without a question."""
    if len(choices) == 1:
        return tuple(choices)
    _list_choices(choices)
    while True:
        answers = [each.strip() for each in str(typer.prompt(question)).split(",")]
        chosen = [_chosen(answer, choices) for answer in answers]
        if None not in chosen and len(set(chosen)) == len(chosen):
            return tuple(each for each in chosen if each is not None)
        typer.echo(f"{', '.join(answers)!r} is none of them; allowed {', '.join(choices)}")


def _choose(question: str, choices: Sequence[str]) -> str:
    """Return one of some choices, by name or number; the only one without a question."""
    if len(choices) == 1:
        return choices[0]
    _list_choices(choices)
    while True:
        answer = str(typer.prompt(question)).strip()
        chosen = _chosen(answer, choices)
        if chosen is not None:
            return chosen
        typer.echo(f"{answer!r} is none of them; allowed {', '.join(choices)}")


def _list_choices(choices: Sequence[str]) -> None:
    for number, choice in enumerate(choices, 1):
        typer.echo(f"  {number} {choice}")


def _chosen(answer: str, choices: Sequence[str]) -> str | None:
    """Return the choice of a name or a number; None for another answer."""
    if answer in choices:
        return answer
    if answer.isdecimal() and 1 <= int(answer) <= len(choices):
        return choices[int(answer) - 1]
    return None


def _ask_of_mode(dof: str, question: str, known: float | None) -> list[str]:
    """Return `MODE=NUMBER` for an answer other than the known number."""
    answer = _ask_number(question, known)
    stated = known is not None and math.isclose(answer, known, rel_tol=1.0e-5)
    return [] if stated else [f"{dof}={answer!r}"]


def _ask_number(question: str, default: float | None) -> float:
    """Return a positive number."""
    while True:
        answer: Any = typer.prompt(
            question, default=default and float(f"{default:.6g}"), type=float
        )
        if answer > 0.0 and math.isfinite(answer):
            return float(answer)
        typer.echo(f"{answer:g}: allowed above 0")
