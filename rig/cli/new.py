"""`rig new kind|rig`: a kind of rig in a package of its own, or the files of a rig."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Json
from rig.cli.output import OK, input_errors, print_json
from rig.kinds.new_kind import write_kind

_EXIT_CODES = "Exit codes: 0 written; 2 bad input, and nothing is written."

Folder = Annotated[Path, typer.Option("--folder", help="Folder to write to.")]

command = typer.Typer(no_args_is_help=True)


@command.command(epilog=_EXIT_CODES)
def kind(
    name: Annotated[str, typer.Argument(help="Name of the kind: [a-z][a-z0-9_]*.")],
    folder: Folder = Path(),
    as_json: Json = False,
) -> int:
    """Write a kind of rig as a package of its own, wec_NAME: a small complete example to change.

    It has every room of a kind, a control law, a simulated plant, rig, limits and plant files,
    tests, and a workflow that runs them. The command never overwrites a file.
    """
    with input_errors("new kind", as_json=as_json):
        written = write_kind(name, folder)
    package = folder / f"wec_{name}"
    commands = (
        f"pip install -e {package}",
        "rig kinds",
        f"rig check {package / 'configs' / 'holds.yaml'}",
        f"rig run {package / 'configs' / 'holds.yaml'}",
    )
    return _report(written, commands, f"{package / 'README.md'} explains the files", as_json)


@command.command(epilog=_EXIT_CODES)
def rig(
    name: Annotated[str, typer.Argument(help="Name of the rig and of the folder of its files.")],
    bem: Annotated[
        Path,
        typer.Option(
            help="Coefficients of the body: capytaine .nc, WAMIT .out or .1 (with .3 and .hst), "
            "WEC-Sim BEMIO .h5."
        ),
    ],
    dof: Annotated[
        str | None, typer.Option(help="Mode of the file; needed if it has several.")
    ] = None,
    axis: Annotated[
        str | None, typer.Option(help="Name of the axis in files and log; default: of the mode.")
    ] = None,
    mass: Annotated[
        float | None,
        typer.Option(help="kg or kg*m2; default: inertia or displaced mass of the file."),
    ] = None,
    stiffness: Annotated[
        float | None, typer.Option(help="N/m or N*m/rad; default: the file's hydrostatic one.")
    ] = None,
    frequency: Annotated[
        float | None, typer.Option(help="Of the waves, Hz; default: below the body's resonance.")
    ] = None,
    amplitude: Annotated[
        float | None, typer.Option(help="Of the waves, m; default: a tenth of 1 / wave number.")
    ] = None,
    torque_constant: Annotated[
        float | None, typer.Option(help="Of the motor, N*m/A; default 1.")
    ] = None,
    gear_ratio: Annotated[
        float | None,
        typer.Option(help="Motor per axis, rad/m or rad/rad; default: 20 A for the peak force."),
    ] = None,
    direction: Annotated[
        float | None, typer.Option(help="Of the waves, degrees; needed if the file has several.")
    ] = None,
    density: Annotated[
        float | None, typer.Option(help="Of the water, kg/m3, if the file does not state it.")
    ] = None,
    gravity: Annotated[
        float | None, typer.Option(help="m/s2, if the file does not state it.")
    ] = None,
    depth: Annotated[
        float | None, typer.Option(help="Of the water, m, if the file does not state it.")
    ] = None,
    length_scale: Annotated[
        float | None, typer.Option(help="ULEN of WAMIT's numeric files, m.")
    ] = None,
    folder: Folder = Path(),
    as_json: Json = False,
) -> int:
    """Write rig, limits, plant and campaign file of a body with one axis, from its BEM file.

    Two more files put the rig on its wires, with addresses on this computer for emulated devices.

    The campaign is a gain matrix around the impedance match. Motor, gear and limits are derived
    from its motion and forces; comments mark the numbers to choose. No Python is needed. The
    command never overwrites a file.
    """
    from rig.kinds.modular.new_rig import Options, Water, write_rig

    options = Options(
        bem, dof, axis, mass, stiffness, frequency, amplitude, torque_constant, gear_ratio,
        direction, Water(density, gravity, depth, length_scale),
    )  # fmt: skip
    with input_errors("new rig", as_json=as_json):
        written = write_rig(name, folder, options)
    campaign, wired = folder / name / "campaign.yaml", folder / name / "rig_hil.yaml"
    commands = (
        f"rig check {campaign}",
        f"rig run {campaign}",
        f"rig sweep {campaign}",
        f"rig run {campaign} --rig {wired} --sim",
    )
    return _report(written, commands, "edit the lines marked `choose`", as_json)


def _report(written: Iterable[Path], commands: Iterable[str], text: str, as_json: bool) -> int:
    """Print the written files and the next commands; return the exit code."""
    files = list(map(str, written))
    if as_json:
        return print_json({"written": files, "commands": list(commands)})
    print("\n".join(f"written  {file}" for file in files))
    print("\n".join([f"\n{text}; then", *(f"  {each}" for each in commands)]))
    return OK
