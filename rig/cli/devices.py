"""`rig devices RIG`."""

import json
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Group

from rig import cli
from rig.cli import bench_devices_view
from rig.cli.command_error import fail
from rig.cli.console import table_console
from rig.cli.devices_view import as_dict, drawn, heard_dict, heard_drawn
from rig.cli.file_problems import REFUSED, refuse
from rig.config.any_rig_file import AnyRigFile, load_rig
from rig.config.bench_rig_file import BenchRigFile
from rig.config.rig_file import RigFile
from rig.execution.hardware.bench_job import job_of_bench
from rig.execution.hardware.bench_survey import survey_bench
from rig.execution.hardware.job import job_of
from rig.execution.hardware.listen import listen
from rig.execution.hardware.survey import survey
from rig.processes import wire_locks
from rig.recording.runs.create import BusyError


def main(path: Path, *, only_listen: bool, objects: bool, as_json: bool) -> int:
    """Look at every wire and say who answers; 0 if all do and agree with the rig file."""
    try:
        rig, _ = load_rig(path)
        look = _bench(rig) if isinstance(rig, BenchRigFile) else _wavebot(rig, objects)
    except REFUSED as error:
        return refuse("devices", error, as_json=as_json)
    with ExitStack() as held:
        if only_listen:
            look = _listening(rig)
        else:
            try:
                held.enter_context(wire_locks.hold(wire_locks.wires_of(rig), "rig devices"))
            except BusyError as error:
                text = (
                    f"{error}\n--listen looks without sending: at what the CAN bus says by itself"
                )
                return fail("devices", RuntimeError(text), as_json=as_json, code=cli.FAILED)
        console = table_console()
        if not as_json and console.is_terminal:
            with console.status("looking at the rig's wires ..."):
                seen = look()
        else:
            seen = look()
    if as_json:
        print(json.dumps(seen.told, ensure_ascii=False))
    else:
        console.print(seen.drawn)
    return cli.FAILED if seen.trouble else cli.OK


class _Seen(NamedTuple):
    """What a look found, for programs and for people."""

    told: dict[str, Any]
    drawn: Group
    trouble: tuple[str, ...]


def _wavebot(rig: RigFile, objects: bool) -> Callable[[], _Seen]:
    job = job_of(rig)

    def look() -> _Seen:
        found = survey(job)
        shown = drawn(rig.name, found, every_object=objects)
        return _Seen(as_dict(rig.name, found), shown, found.trouble)

    return look


def _bench(rig: BenchRigFile) -> Callable[[], _Seen]:
    job = job_of_bench(rig)

    def look() -> _Seen:
        found = survey_bench(job)
        told = bench_devices_view.as_dict(rig.name, found)
        return _Seen(told, bench_devices_view.drawn(rig.name, found), found.trouble)

    return look


def _listening(rig: AnyRigFile) -> Callable[[], _Seen]:
    def look() -> _Seen:
        found = listen(rig)
        return _Seen(heard_dict(rig.name, found), heard_drawn(rig.name, found), found.trouble)

    return look
