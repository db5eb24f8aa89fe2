"""Options of the commands that read a BEM file: what the file leaves open of waves and water."""

from typing import Annotated

import typer

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
