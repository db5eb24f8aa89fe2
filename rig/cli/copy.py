"""`rig copy NAME`: a shipped campaign, session, rig, plant or table of faults as files to edit."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Json
from rig.cli.output import OK, input_errors, print_json
from rig.config.shipped_files import (
    CAMPAIGNS,
    FAULTS,
    PLANTS,
    RIGS,
    SESSIONS,
    copy_files,
    find_shipped,
    shipped_files,
)

_NEXT_COMMANDS = {
    CAMPAIGNS: ("rig check {}", "rig run {}"),
    SESSIONS: ("rig check {}", "rig run {}"),
    RIGS: ("rig run CAMPAIGN --rig {}",),
    PLANTS: ("rig check CAMPAIGN, with plant: {} in the campaign or its rig file",),
    FAULTS: ("rig faults {} --list", "rig faults {}"),
}
_TASKS_AND_RIGS = (CAMPAIGNS, SESSIONS, RIGS)


def command(
    name: Annotated[
        str,
        typer.Argument(help="Name of a shipped file; see `rig campaigns`."),
    ],
    folder: Annotated[Path, typer.Option("--to", help="Folder to write to.")] = Path(),
    keep_existing: Annotated[
        bool, typer.Option("--keep-existing", help="Leave files that exist as they are.")
    ] = False,
    as_json: Json = False,
) -> int:
    """Copy a shipped campaign, session, rig, plant or table of faults, and all its input files.

    The files keep their folders (campaigns, rigs, limits, plants), so that
    they refer to each other. The command never overwrites a file.
    """
    with input_errors("copy", as_json=as_json):
        # A rig and its plant may have one name; the copy of the rig has the plant, too.
        is_first = any(one.name == name for one in shipped_files(*_TASKS_AND_RIGS))
        shipped = find_shipped(name, *_TASKS_AND_RIGS, *(() if is_first else (PLANTS, FAULTS)))
        copied = copy_files(shipped.path, folder, keep_existing=keep_existing)
    if as_json:
        files = {"written": copied.written, "kept": copied.kept}
        names = {key: [str(path) for path in paths] for key, paths in files.items()}
        return print_json({"file": str(copied.main), **names})
    for path in copied.written:
        print(f"written  {path}")
    for path in copied.kept:
        print(f"kept     {path}")
    print(f"\nedit {copied.main} and the files that it names; then")
    for command in _NEXT_COMMANDS[shipped.kind]:
        print(f"  {command.format(copied.main)}")
    return OK
