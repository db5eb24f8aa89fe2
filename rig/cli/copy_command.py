"""`rig copy NAME`: a shipped campaign, session or rig as files to edit."""

import json
from pathlib import Path

from rig import cli
from rig.cli.file_problems import INPUT_ERRORS, refuse
from rig.config.shipped_copy import copy_files
from rig.config.shipped_files import CAMPAIGNS, RIGS, SESSIONS, find_shipped

_NEXT_COMMANDS = {
    CAMPAIGNS: ("rig check {}", "rig run {}"),
    SESSIONS: ("rig check {}", "rig bench {}"),
    RIGS: ("rig run CAMPAIGN --rig {}",),
}


def main(name: str, folder: Path, *, keep_existing: bool, as_json: bool) -> int:
    """Copy a shipped file and its input files, print their names, and return the exit code."""
    try:
        shipped = find_shipped(name, CAMPAIGNS, SESSIONS, RIGS)
        copied = copy_files(shipped.path, folder, keep_existing=keep_existing)
    except INPUT_ERRORS as error:
        return refuse("copy", error, as_json=as_json)
    if as_json:
        report = {
            "file": str(copied.main),
            "written": [str(path) for path in copied.written],
            "kept": [str(path) for path in copied.kept],
        }
        print(json.dumps(report))
        return cli.OK
    for path in copied.written:
        print(f"written  {path}")
    for path in copied.kept:
        print(f"kept     {path}")
    print(f"\nedit {copied.main} and the files that it names; then")
    for command in _NEXT_COMMANDS[shipped.kind]:
        print(f"  {command.format(copied.main)}")
    return cli.OK
