"""`rig twoport RUN`: pictures of the two-port theory for a measured device."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import RUNS, Json, Runs

_RUN = "A run in calm water with an open-loop reference: folder, MCAP file, id, campaign, 'last'."


def command(
    run: Annotated[Path, typer.Argument(help=_RUN)],
    kp: Annotated[float, typer.Option(help="Kp of the pictures, N*s/m.")] = -2500.0,
    ki: Annotated[float, typer.Option(help="Ki of the pictures, N/m.")] = 0.0,
    spring: Annotated[
        float | None, typer.Option(help="Spring rate, N/m (default: that of the run).")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to write to (default: the run's).")
    ] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Draw how gains, spring and gear change the impedance match and the transmitted power."""
    sys.exit(main(run, runs, (kp, ki, spring), output, as_json=json))


def main(
    run_name: Path,
    runs: Path,
    setting: tuple[float, float, float | None],
    output: Path | None,
    *,
    as_json: bool,
) -> int:
    """Identify the device, draw the pictures, print their paths, and return the exit code."""
    from rig import cli
    from rig.cli.file_problems import INPUT_ERRORS, refuse
    from rig.cli.find_run import find_run
    from rig.identification.identify import identify
    from rig.kinds.wavebot.twin.records import read_records
    from rig.kinds.wavebot.twin.two_port import (
        VariationOptions,
        device_from_run,
        write_pictures,
    )

    try:
        path = find_run(run_name, runs)
        record = read_records(path)
        device = device_from_run(identify([path]), record.facts, record.records)
        folder = output or (path if path.is_dir() else path.parent)
        written = write_pictures(device, VariationOptions(*setting), folder)
    except INPUT_ERRORS as error:
        return refuse("twoport", error, as_json=as_json)
    names = [str(path) for path in written]
    if as_json:
        print(json.dumps({"model": device.model, "written": names}))
    else:
        print(f"of {device.model}\n" + "\n".join(names))
    return cli.OK
