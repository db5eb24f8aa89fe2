"""`rig devices RIG`."""

import json
from contextlib import ExitStack
from pathlib import Path

from rig import cli
from rig.cli.console import table_console
from rig.cli.devices_view import as_dict, drawn
from rig.cli.failure import fail
from rig.cli.refusal import REFUSED, refuse
from rig.config import RigFile, load
from rig.hardware.job import job_of
from rig.hardware.survey import survey
from rig.runs import create


def main(path: Path, *, anyway: bool, objects: bool, as_json: bool) -> int:
    """Look at every wire and say who answers; 0 if all do and agree with the rig file."""
    try:
        rig, _ = load(path, RigFile)
        job = job_of(rig)
    except REFUSED as error:
        return refuse("devices", error, as_json=as_json)
    with ExitStack() as held:
        try:
            held.enter_context(create.hold_realtime("rig devices"))
        except create.BusyError as error:
            if not anyway:
                text = f"{error}; --anyway looks all the same"
                return fail("devices", RuntimeError(text), as_json=as_json, code=cli.FAILED)
        console = table_console()
        if not as_json and console.is_terminal:
            with console.status("looking at the rig's wires ..."):
                found = survey(job)
        else:
            found = survey(job)
    if as_json:
        print(json.dumps(as_dict(rig.name, found), ensure_ascii=False))
    else:
        console.print(drawn(rig.name, found, every_object=objects))
    return cli.FAILED if found.trouble else cli.OK
