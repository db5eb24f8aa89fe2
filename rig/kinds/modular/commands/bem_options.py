"""Options of the commands that read a BEM file: modes, PTOs, and what the file leaves open."""

from typing import Annotated

import typer

Dofs = Annotated[
    list[str] | None,
    typer.Option(
        "--dof",
        help="Mode of the file; repeat it for several. Default: the modes of --axis, or the only "
        "one of the file.",
    ),
]
Axes = Annotated[
    list[str] | None,
    typer.Option(
        "--axis",
        help="Motion of a PTO, NAME=MODES: pto=float__Heave-spar__Heave, arm=0.5*Pitch; a mode "
        "alone names the axis after itself. Repeat it for several PTOs.",
    ),
]
Masses = Annotated[
    list[str] | None,
    typer.Option(
        "--mass",
        help="MODE=VALUE, kg or kg*m2; default: inertia or displaced mass of the file. A single "
        "mode needs no MODE=.",
    ),
]
Stiffnesses = Annotated[
    list[str] | None,
    typer.Option(
        "--stiffness",
        help="MODE=VALUE, N/m or N*m/rad, with that of the mooring; default: the file's "
        "hydrostatic one.",
    ),
]

Direction = Annotated[
    float | None, typer.Option(help="Of the waves, degrees; needed if the file has several.")
]
Density = Annotated[
    float | None, typer.Option(help="Of the water, kg/m3, if the file does not state it.")
]
Gravity = Annotated[float | None, typer.Option(help="m/s2, if the file does not state it.")]
Depth = Annotated[
    float | None,
    typer.Option(help="Of the water, m, if the file does not state it or has several."),
]
LengthScale = Annotated[float | None, typer.Option(help="ULEN of WAMIT's numeric files, m.")]
