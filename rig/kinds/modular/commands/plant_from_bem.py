"""`rig plant from-bem FILE`: a plant file, the fit of its radiation and a page of pictures."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.new import EXIT_CODES
from rig.cli.options import Json
from rig.cli.output import input_errors, print_result
from rig.kinds.modular.commands.bem_options import (
    Density,
    Depth,
    Direction,
    Gravity,
    LengthScale,
)
from rig.kinds.modular.from_bem import PlantRequest, fit_plant, report_text, write_plant
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
    dof: Annotated[
        list[str] | None, typer.Option(help="Mode of the file; repeat it for several.")
    ] = None,
    axis: Annotated[
        list[str] | None,
        typer.Option(help="Mode with a PTO; repeat it for several. Default: all modes."),
    ] = None,
    mass: Annotated[
        list[str] | None,
        typer.Option(
            help="MODE=VALUE, kg or kg*m2; default: inertia or displaced mass of the file."
        ),
    ] = None,
    stiffness: Annotated[
        list[str] | None,
        typer.Option(help="MODE=VALUE, N/m or N*m/rad; default: the file's hydrostatic one."),
    ] = None,
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

    Next to it: the fitted radiation, a page of pictures, and a copy of the BEM file, unless it is
    in that folder. What the file leaves open is refused, with all reasons at once: name modes,
    masses, direction or depth. The command never overwrites a file.
    """
    request = PlantRequest(
        bem, output or Path(f"{bem.resolve().stem}_plant.yaml"), tuple(dof or ()),
        tuple(axis or ()), tuple(mass or ()), tuple(stiffness or ()), direction,
        Water(density, gravity, depth, length_scale),
    )  # fmt: skip
    with input_errors("plant from-bem", as_json=as_json):
        fitted = fit_plant(request)
        from rig.kinds.modular.bem_picture import picture  # noqa: PLC0415  (matplotlib, half a second)

        written = write_plant(request, fitted, picture(fitted))
    text = report_text(fitted.report)
    return print_result(json_value(fitted.report), text, written, as_json=as_json)
