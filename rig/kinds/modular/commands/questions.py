"""The questions of `rig new rig` at a terminal: what neither the options nor the BEM file state."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from rig.kinds.modular.new_rig import Options
from sim_plant.modes.bem import read_content, stated_mass
from sim_plant.modes.bem_content import BemContent, Water, rotates


def ask_options(given: Options, *, ask_file: bool) -> Options:
    """Return the options, completed by answers; an answer that cannot be used is asked again.

    ``ask_file``: the BEM file is asked for, too.
    """
    options, content = _read_file(given, ask_file=ask_file)
    dof = options.dof
    if dof not in content.modes:
        if dof is not None:
            typer.echo(f"{options.bem}: has no mode {dof!r}; it has {', '.join(content.modes)}")
            options = options._replace(mass=None, stiffness=None)  # they were that mode's
        dof = _choose("Mode that the PTO moves with", content.modes)
    mode, unit = content.modes.index(dof), "kg*m2" if rotates(dof) else "kg"
    direction = options.direction
    if direction is None and len(content.directions) > 1:
        listed = [f"{each:g}" for each in content.directions]
        direction = float(_choose("Direction of the waves, degrees", listed))
    mass, stiffness = options.mass, options.stiffness
    if mass is None:
        known, source = stated_mass(content, mode)
        shown = f" (the file: {source})" if known is not None else ""
        mass = _ask_number(f"Mass, {unit}{shown}", known)
    if stiffness is None:
        own = None if content.stiffness is None else float(content.stiffness[mode, mode])
        per = "N*m/rad" if rotates(dof) else "N/m"
        known = own if own is not None and own > 0.0 else None
        stiffness = _ask_number(f"Stiffness with that of the mooring, {per}", known)
    torque_constant = options.torque_constant or _ask_number(
        "Torque constant of the motor, N*m/A", 1.0
    )
    gear_ratio = options.gear_ratio
    if gear_ratio is None and typer.confirm("Is there a gear ratio already?", default=False):
        gear_ratio = _ask_number(
            f"Motor angle per {'rad' if rotates(dof) else 'm'} of the axis", None
        )
    return options._replace(
        dof=dof, direction=direction, mass=mass, stiffness=stiffness,
        torque_constant=torque_constant, gear_ratio=gear_ratio,
    )  # fmt: skip


def _read_file(options: Options, *, ask_file: bool) -> tuple[Options, BemContent]:
    """Return the options with a BEM file that can be read, and its content."""
    while True:
        if ask_file:
            path = Path(str(typer.prompt("File with the BEM coefficients"))).expanduser()
            options = options._replace(bem=path)
        try:
            return options, read_content(options.bem, options.water)
        except (OSError, ValueError) as error:
            typer.echo(str(error))
            water = _ask_water(options.water, str(error))
            ask_file = water is None
            options = options._replace(water=water or options.water)


def _ask_water(water: Water, message: str) -> Water | None:
    """Return the water with the numbers that a message says are not stated; None for another."""
    questions = {
        "density": ("density_kg_per_m3", "Density of the water, kg/m3", 1000.0),
        "gravity": ("gravity_m_per_s2", "Gravity, m/s2", 9.81),
        "depth": ("depth_m", "Depth of the water, m", None),
    }
    answers = {
        field: _ask_number(question, default)
        for field, (key, question, default) in questions.items()
        if f"does not state {key}" in message and getattr(water, field) is None
    }
    return water._replace(**answers) if answers else None


def _choose(question: str, choices: Sequence[str]) -> str:
    """Return one of some choices, by name or number; the only one without a question."""
    if len(choices) == 1:
        return choices[0]
    for number, choice in enumerate(choices, 1):
        typer.echo(f"  {number} {choice}")
    while True:
        answer = str(typer.prompt(question)).strip()
        if answer in choices:
            return answer
        if answer.isdecimal() and 1 <= int(answer) <= len(choices):
            return choices[int(answer) - 1]
        typer.echo(f"{answer!r} is none of them; allowed {', '.join(choices)}")


def _ask_number(question: str, default: float | None) -> float:
    """Return a positive number."""
    while True:
        answer: Any = typer.prompt(
            question, default=default and float(f"{default:.6g}"), type=float
        )
        if answer > 0.0 and math.isfinite(answer):
            return float(answer)
        typer.echo(f"{answer:g}: allowed above 0")
