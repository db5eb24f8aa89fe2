"""`rig bench SESSION`: `rig run` for sessions of the bench alone."""

from pathlib import Path
from typing import Annotated

import typer

from rig.api.campaign_run import RunOptions
from rig.cli.input_files import SESSIONS
from rig.cli.options import RUNS, Json, Realtime, Rig, Runs, Sim
from rig.cli.run import EXIT_CODES, run_named
from rig.kinds.registry import find

__all__ = ["EXIT_CODES", "command"]


def command(
    session: Annotated[
        Path, typer.Argument(help="Session file (YAML), or the name of a shipped session.")
    ],
    realtime: Realtime = False,
    rig: Rig = None,
    sim: Sim = False,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Run a session of the OSWEC bench, analyse it, and write its report and calibration file.

    A bench file without wiring runs as a rehearsal. A bench file with wiring
    runs on the bench's devices.
    """
    return run_named(
        "bench",
        session,
        runs,
        RunOptions(rig, realtime, sim),
        as_json=as_json,
        folders=(SESSIONS,),
        kind=find("oswec bench"),
    )
