"""`rig twoport RUN`: the pictures of the two-port theory, of a device as measured."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import RUNS, Json, Runs

_RUN = "A run in calm water with an open-loop reference: folder, MCAP file, id, campaign, 'last'."


def command(
    run: Annotated[Path, typer.Argument(help=_RUN)],
    kp: Annotated[float, typer.Option(help="Kp that is looked at, N*s/m.")] = -2500.0,
    ki: Annotated[float, typer.Option(help="Ki that is looked at, N/m.")] = 0.0,
    spring: Annotated[
        float | None, typer.Option(help="Spring rate, N/m (that of the run).")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to write to (default: the run's).")
    ] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Draw what gains, spring and gear do to the match, and how much power comes through."""
    sys.exit(main(run, runs, (kp, ki, spring), output, as_json=json))


def main(
    named: Path,
    runs: Path,
    setting: tuple[float, float, float | None],
    output: Path | None,
    *,
    as_json: bool,
) -> int:
    """Identify, draw, say which files."""
    from rig import cli
    from rig.cli.file_problems import REFUSED, refuse
    from rig.cli.find_run import find_run
    from rig.design.twoport.measured import Steps, measured, write_pictures
    from rig.identification.identify import identify
    from rig.identification.twin.records import read

    try:
        path = find_run(named, runs)
        known = read(path)
        device = measured(identify([path]), known.facts, known.records)
        folder = output or (path if path.is_dir() else path.parent)
        written = write_pictures(device, Steps(*setting), folder)
    except REFUSED as error:
        return refuse("twoport", error, as_json=as_json)
    names = [str(one) for one in written]
    if as_json:
        print(json.dumps({"model": device.model, "written": names}))
    else:
        print(f"of {device.model}\n" + "\n".join(names))
    return cli.OK
