"""`rig twoport RUN`: pictures of the two-port theory for a measured device."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.input_files import find_run_of_kind, run_folder
from rig.cli.options import RUNS, Json, OutputFolder, PictureFormat, PictureStyle, Runs
from rig.cli.output import input_errors, print_result
from rig.kinds.wavebot.commands import KIND
from rig.kinds.wavebot.twin.two_port import device_from_run, write_pictures

_RUN = "A run in calm water with an open-loop reference: folder, MCAP file, id, campaign, 'last'."


def command(
    run: Annotated[Path, typer.Argument(help=_RUN)],
    kp: Annotated[float, typer.Option(help="Kp of the pictures, N*s/m.")] = -2500.0,
    ki: Annotated[float, typer.Option(help="Ki of the pictures, N/m.")] = 0.0,
    spring: Annotated[
        float | None, typer.Option(help="Spring rate, N/m (default: that of the run).")
    ] = None,
    output: OutputFolder = None,
    style: PictureStyle = None,
    picture_format: PictureFormat = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Draw how gains, spring and gear change the impedance match and the transmitted power."""
    with input_errors("twoport", as_json=as_json):
        path = find_run_of_kind(KIND, run, runs)
        device = device_from_run(path)
        written = write_pictures(device, kp, ki, spring, output or run_folder(path))
    return print_result({"model": device.model}, f"of {device.model}", written, as_json=as_json)
