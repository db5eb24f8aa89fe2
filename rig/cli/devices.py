"""`rig devices RIG`."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, TypeVar

import typer
from rich.console import Console

from rig.cli.devices_view import as_dict, heard_as_dict, render, render_heard
from rig.cli.errors import fail, input_errors
from rig.cli.exit_codes import FAILED, OK
from rig.cli.input_files import RIGS, input_file
from rig.cli.options import WIRED_RIG_HELP, Json
from rig.kinds.rig_file import load_rig
from rig.presentation.console import table_console
from rig.processes import wire_locks
from rig.recording.runs.create import BusyError
from rig.wires.listen import listen
from rig.wires.survey import survey

EXIT_CODES = """\
Exit codes: 0 all devices answer and agree with the rig file; 1 a device does not, or one of the \
rig's wires is in use; 2 bad input."""
T = TypeVar("T")


def command(
    path: Annotated[Path, typer.Argument(metavar="RIG", help=WIRED_RIG_HELP)],
    objects: Annotated[
        bool, typer.Option("--objects", help="Also list every object that a run will set.")
    ] = False,
    only_listen: Annotated[
        bool, typer.Option("--listen", help="Send nothing; works while a run uses the rig.")
    ] = False,
    as_json: Json = False,
) -> int:
    """List the devices that answer on a rig's wires, and check their settings. It only reads."""
    with input_errors("devices", as_json=as_json):
        rig, _, kind = load_rig(input_file(path, RIGS))
        job = kind.room("hardware.job").build_job(rig)
    console = table_console()
    if only_listen:
        heard = _with_status(console, lambda: listen(rig), as_json=as_json)
        data, rendered = heard_as_dict(rig.name, heard), render_heard(rig.name, heard)
    else:
        try:
            with wire_locks.acquire(wire_locks.wires_in(rig), "rig devices"):
                found = _with_status(console, lambda: survey(job), as_json=as_json)
        except BusyError as error:
            text = f"{error}\n--listen sends nothing: it shows what nodes on the CAN bus send"
            return fail("devices", RuntimeError(text), as_json=as_json, code=FAILED)
        data = as_dict(rig.name, found)
        rendered = render(rig.name, found, all_objects=objects)
    if as_json:
        print(json.dumps(data, ensure_ascii=False))
    else:
        console.print(rendered)
    return FAILED if data["trouble"] else OK


def _with_status(console: Console, survey_wires: Callable[[], T], *, as_json: bool) -> T:
    """Return a survey; show on a terminal that it is going on."""
    if as_json or not console.is_terminal:
        return survey_wires()
    with console.status("surveying the rig's wires ..."):
        return survey_wires()
