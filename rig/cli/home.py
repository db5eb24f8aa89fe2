"""`rig home RIG`."""

import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.input_files import RIGS, input_file
from rig.cli.options import WIRED_RIG_HELP, Json
from rig.cli.output import BAD_INPUT, FAILED, OK, STOPPED, fail, input_errors, print_json
from rig.cli.stop_signals import stop_signals
from rig.kinds.rig_file import load_rig
from rig.presentation.json_values import json_value
from rig.processes import wire_locks
from rig.recording.runs.create import BusyError
from rig.wires.actuator_homing import Homing, actuator_nodes, home_actuators

EXIT_CODES = """\
Exit codes: 0 all actuators are homed; 1 one is not, or the wires are in use; 2 bad input; \
3 stopped by Ctrl-C."""


def command(
    path: Annotated[Path, typer.Argument(metavar="RIG", help=WIRED_RIG_HELP)],
    actuators: Annotated[
        list[str] | None, typer.Argument(metavar="[ACTUATOR]...", help="Default: all.")
    ] = None,
    repeat: Annotated[
        bool, typer.Option("--repeat", help="Restart drives first, so that homed ones home anew.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask: nobody is at the rig.")] = False,
    as_json: Json = False,
) -> int:
    """Home the actuators of a rig, outside a run: they move, and Ctrl-C removes their power."""
    with input_errors("home", as_json=as_json):
        rig, _, kind = load_rig(input_file(path, RIGS))
        job = kind.room("hardware.job").build_job(rig)
        nodes = actuator_nodes(job)
        known = [node["name"] for node in nodes]
        if unknown := [name for name in actuators or () if name not in known]:
            have = f"its actuators are {', '.join(known)}" if known else "it has no actuator"
            raise ValueError(f"{path}: {', '.join(unknown)} cannot home; {have}")
        nodes = tuple(node for node in nodes if not actuators or node["name"] in actuators)
        if not nodes:
            raise ValueError(f"{path}: the rig has no actuator that homes")
    if not yes and not _confirmed(", ".join(node["name"] for node in nodes)):
        text = "not confirmed; --yes says that nobody is at the rig"
        return fail("home", RuntimeError(text), as_json=as_json, code=BAD_INPUT)
    with stop_signals() as stopped:
        try:
            with wire_locks.acquire(wire_locks.wires_in(rig), "rig home"):
                found = home_actuators(
                    job, nodes, repeat=repeat, stopped=stopped,
                    on_begin=lambda name: _note(f"{name} homes ...", quiet=as_json),
                )  # fmt: skip
        except (BusyError, OSError) as error:
            return fail("home", error, as_json=as_json, code=FAILED)
        was_stopped = stopped()
    if as_json:
        print_json({"rig": rig.name, "actuators": json_value(found), "stopped": was_stopped})
    else:
        print("\n".join(map(_text, found)))
    complete = len(found) == len(nodes) and all(each.homed for each in found)
    return OK if complete else STOPPED if was_stopped else FAILED


def _confirmed(names: str) -> bool:
    """Return whether a person at a terminal confirms the motion."""
    if not sys.stdin.isatty():
        return False
    answer = ""
    with suppress(EOFError, KeyboardInterrupt):
        answer = input(f"{names} will move. Is everybody away from the rig? Type yes: ")
    return answer.strip().lower() == "yes"


def _note(text: str, *, quiet: bool) -> None:
    if not quiet:
        print(text, file=sys.stderr, flush=True)


def _text(homing: Homing) -> str:
    if homing.problem:
        return f"{homing.name}: {homing.problem}"
    if not homing.moved:
        return f"{homing.name}: was homed already since it was switched on; --repeat homes it anew"
    return f"{homing.name}: homed in {homing.duration_s:.1f} s"
