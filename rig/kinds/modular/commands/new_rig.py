"""`rig new rig NAME`: the files of a rig, from a BEM file."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.new import EXIT_CODES, Folder, report_written
from rig.cli.options import Json
from rig.cli.output import input_errors
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
from rig.kinds.modular.commands.questions import ask_options
from rig.kinds.modular.mode_choice import ModeOptions
from rig.kinds.modular.new_rig import Options, write_rig
from sim_plant.modes.bem_content import Water

__all__ = ["EXIT_CODES", "command"]


def command(
    name: Annotated[str, typer.Argument(help="Name of the rig and of the folder of its files.")],
    bem: Annotated[
        Path | None,
        typer.Option(
            help="Coefficients of the body: capytaine .nc, WAMIT .out or .1 (with .3 and .hst), "
            "WEC-Sim BEMIO .h5, or the folder of a Nemoh run. Without it, a terminal is asked."
        ),
    ] = None,
    dof: Dofs = None,
    axis: Axes = None,
    mass: Masses = None,
    stiffness: Stiffnesses = None,
    frequency: Annotated[
        float | None,
        typer.Option(help="Of the waves, Hz; default: below the axis's resonance."),
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
    direction: Direction = None,
    density: Density = None,
    gravity: Gravity = None,
    depth: Depth = None,
    length_scale: LengthScale = None,
    ask: Annotated[
        bool | None,
        typer.Option(
            "--ask/--no-ask",
            help="Ask for what is not given (default: on a terminal, without --bem).",
            show_default=False,
        ),
    ] = None,
    folder: Folder = Path(),
    as_json: Json = False,
) -> int:
    """Write rig, limits, plant and campaign file of a body, or of several, from a BEM file.

    Two more files put the rig on its wires, with addresses on this computer for emulated devices.

    The campaign is a gain matrix around the impedance match. Motor, gear and limits are derived
    from its motion and forces; comments mark the numbers to choose. No Python is needed. The
    command never overwrites a file.
    """
    if ask is None:
        ask = bem is None and sys.stdin.isatty() and not as_json
    if bem is None and not ask:
        raise typer.BadParameter("give the file of the BEM coefficients", param_hint="--bem")
    modes = ModeOptions(
        bem or Path(), tuple(dof or ()), tuple(axis or ()), tuple(mass or ()),
        tuple(stiffness or ()), direction, Water(density, gravity, depth, length_scale),
    )  # fmt: skip
    options = Options(modes, frequency, amplitude, torque_constant, gear_ratio)
    if ask:
        options = ask_options(options, ask_file=bem is None)
    with input_errors("new rig", as_json=as_json):
        written = write_rig(name, folder, options)
    campaign, wired = folder / name / "campaign.yaml", folder / name / "rig_hil.yaml"
    commands = (
        f"rig check {campaign}",
        f"rig run {campaign}",
        f"rig sweep {campaign}",
        f"rig run {campaign} --rig {wired} --sim",
    )
    return report_written(written, commands, "edit the lines marked `choose`", as_json)
