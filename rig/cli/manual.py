"""`rig manual FILE`: run a rig in manual mode."""

from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from rig.api.campaign_run import RunOptions
from rig.cli.input_files import CAMPAIGNS, RIGS, SESSIONS, input_file
from rig.cli.options import RUNS, Interpreted, Json, Realtime, Runs, Sim, WithPage
from rig.cli.output import input_errors
from rig.cli.run import EXIT_CODES, run_named
from rig.config.problems import ConfigError
from rig.config.yaml_source import load_mapping
from rig.kinds.interface import Manual
from rig.kinds.registry import KindError
from rig.kinds.rig_file import kind_of
from rig.planning.input_files import ConfigSource, load_named_source

__all__ = ["EXIT_CODES"]
_FILE_HELP = (
    "Rig, campaign or session: file (YAML), or the name of a shipped one. A rig runs in calm water."
)


class Drive(StrEnum):
    """The loop of a drive that has several."""

    VELOCITY = "velocity"
    TORQUE = "torque"


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help=_FILE_HELP)],
    realtime: Realtime = False,
    sim: Sim = False,
    interpreted: Interpreted = False,
    unattended: Annotated[
        bool, typer.Option("--unattended", help="Go on without an operator (no dead man's time).")
    ] = False,
    no_arming: Annotated[
        bool, typer.Option("--no-arming", help="Switch power on at once, not when it is armed.")
    ] = False,
    drive: Annotated[
        Drive | None,
        typer.Option("--drive", help="Loop of the drive, of a rig whose drive has several."),
    ] = None,
    clamped: Annotated[
        bool,
        typer.Option("--clamped", help="The shaft is clamped: for the torque loop of a bench."),
    ] = False,
    kept: Annotated[
        Path, typer.Option("--kept", help="File for the set points that you keep as rows.")
    ] = Path("kept_rows.yaml"),
    page: WithPage = False,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Run a rig in manual mode.

    After the tare the run waits in standby until an operator arms it. Then the
    drive is on with nothing to do, and the operator changes gains, motion, drive
    settings and the signal generator, with the page or with `rig request`. Each
    change is a whole set point: checked as a row of the file, ramped, logged.
    `rig request finish` ends the run.
    """
    with TemporaryDirectory(prefix="wec-rig-") as folder:
        with input_errors("manual", as_json=as_json):
            origin = input_file(file, CAMPAIGNS, SESSIONS, RIGS)
            path = write_task(origin, Path(folder), drive or "", clamped=clamped)
        options = RunOptions(
            None,
            realtime,
            sim,
            interpreted,
            arm=not no_arming,
            manual=origin,
            unattended=unattended,
            page=page,
            kept=kept.absolute(),
        )
        return run_named("manual", path, runs, options, as_json=as_json)


def write_task(file: Path, folder: Path, drive: str = "", *, clamped: bool = False) -> Path:
    """Write the campaign or session for manual mode of a file; return its path.

    Raises ConfigError with all reasons why there is no manual mode.
    """
    source = ConfigSource(*load_mapping(file, inline=("sea", "tank")))
    rig = load_named_source(source, ("rig",)) if "rig" in source.mapping else source
    if rig is None:
        problem = source.locate.problem(("rig",), source.mapping["rig"], "no such file")
        raise ConfigError([problem])
    try:
        room: Manual = kind_of(*rig).room("manual")
    except KindError as error:
        message = f"rigs of this kind have no manual mode: {error}"
        raise ConfigError([rig.locate.problem(("kind",), rig.mapping["kind"], message)]) from None
    path = folder / "manual.yaml"
    room.write_task(file, path, drive, clamped=clamped)
    return path
