"""`rig devices RIG`."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from rig import cli
from rig.cli.command_error import fail
from rig.cli.console import table_console
from rig.cli.devices_view import as_dict, heard_as_dict, render, render_heard
from rig.cli.file_problems import INPUT_ERRORS, refuse
from rig.cli.input_files import RIGS, input_file
from rig.kinds.rig_file import load_rig
from rig.recording.runs.create import BusyError
from rig.wires import locks as wire_locks
from rig.wires.listen import listen
from rig.wires.survey import survey

T = TypeVar("T")


def main(path: Path, *, only_listen: bool, objects: bool, as_json: bool) -> int:
    """Survey every wire of a rig, print the result, and return the exit code.

    The code is 0 if all devices answer and agree with the rig file.
    """
    try:
        rig, _, kind = load_rig(input_file(path, RIGS))
        job = kind.room("hardware.job").build_job(rig)
    except INPUT_ERRORS as error:
        return refuse("devices", error, as_json=as_json)
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
            return fail("devices", RuntimeError(text), as_json=as_json, code=cli.FAILED)
        data = as_dict(rig.name, found)
        rendered = render(rig.name, found, all_objects=objects)
    if as_json:
        print(json.dumps(data, ensure_ascii=False))
    else:
        console.print(rendered)
    return cli.FAILED if data["trouble"] else cli.OK


def _with_status(console: Console, survey_wires: Callable[[], T], *, as_json: bool) -> T:
    """Return a survey; show on a terminal that it is going on."""
    if as_json or not console.is_terminal:
        return survey_wires()
    with console.status("surveying the rig's wires ..."):
        return survey_wires()
