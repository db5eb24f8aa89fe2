"""`rig plant from-bem FILE`: a plant file, the fit of its radiation and a page of pictures."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.new import EXIT_CODES
from rig.cli.options import Json
from rig.cli.output import input_errors, print_result
from rig.kinds.modular.commands.bem_options import (
    Axes,
    Density,
    Depth,
    Direction,
    Dofs,
    Gravity,
    LengthScale,
    Masses,
    Stiffnesses,
)
from rig.kinds.modular.from_bem import PlantRequest, fit_plant, report_text, write_plant
from rig.kinds.modular.mode_choice import ModeOptions
from rig.presentation.json_values import json_value
from sim_plant.modes.bem_content import Water

__all__ = ["EXIT_CODES", "command"]


def command(
    bem: Annotated[
        Path,
        typer.Argument(
            help="Capytaine .nc, WAMIT .out or .1 (with .3 and .hst), WEC-Sim BEMIO .h5, or the "
            "folder of a Nemoh run (or its Nemoh.cal)."
        ),
    ],
    dof: Dofs = None,
    axis: Axes = None,
    mass: Masses = None,
    stiffness: Stiffnesses = None,
    direction: Direction = None,
    density: Density = None,
    gravity: Gravity = None,
    depth: Depth = None,
    length_scale: LengthScale = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Plant file to write; default: NAME_plant.yaml here."),
    ] = None,
    as_json: Json = False,
) -> int:
    """Write a plant file from the results of a BEM program, and report what was derived.

    Without --axis each mode has a PTO.

    Next to it: the fitted radiation, a page of pictures, and a copy of the BEM file, unless it is
    in that folder. What the file leaves open is refused, with all reasons at once: name modes,
    masses, direction or depth. The command never overwrites a file.
    """
    modes = ModeOptions(
        bem, tuple(dof or ()), tuple(axis or ()), tuple(mass or ()), tuple(stiffness or ()),
        direction, Water(density, gravity, depth, length_scale),
    )  # fmt: skip
    request = PlantRequest(modes, output or Path(f"{bem.resolve().stem}_plant.yaml"))
    with input_errors("plant from-bem", as_json=as_json):
        fitted = fit_plant(request)
        from rig.kinds.modular.bem_picture import picture  # noqa: PLC0415  (matplotlib, half a second)

        written = write_plant(request, fitted, picture(fitted))
    text = report_text(fitted.report)
    return print_result(json_value(fitted.report), text, written, as_json=as_json)
