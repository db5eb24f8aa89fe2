"""`rig new kind`: a kind of rig in a package of its own.

A kind adds commands to this group by names that begin with `new` (`rig.cli.app`).
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Json
from rig.cli.output import OK, input_errors, print_json
from rig.kinds.new_kind import write_kind

EXIT_CODES = "Exit codes: 0 written; 2 bad input, and nothing is written."

Folder = Annotated[Path, typer.Option("--folder", help="Folder to write to.")]

command = typer.Typer(no_args_is_help=True)


@command.command(epilog=EXIT_CODES)
def kind(
    name: Annotated[str, typer.Argument(help=r"Name of the kind: \[a-z]\[a-z0-9_]*.")],
    folder: Folder = Path(),
    as_json: Json = False,
) -> int:
    """Write a kind of rig as a package of its own, wec_NAME: a small complete example to change.

    It has every room of a kind, a control law, a simulated plant, rig, limits and plant files,
    tests, and a workflow that runs them. The command never overwrites a file.
    """
    with input_errors("new kind", as_json=as_json):
        written = write_kind(name, folder)
    package = folder / f"wec_{name}"
    commands = (
        f"pip install -e {package}",
        "rig kinds",
        f"rig check {package / 'configs' / 'holds.yaml'}",
        f"rig run {package / 'configs' / 'holds.yaml'}",
    )
    return report_written(written, commands, f"{package / 'README.md'} explains the files", as_json)


def report_written(
    written: Iterable[Path], commands: Iterable[str], text: str, as_json: bool
) -> int:
    """Print the written files and the next commands; return the exit code."""
    files = list(map(str, written))
    if as_json:
        return print_json({"written": files, "commands": list(commands)})
    print("\n".join(f"written  {file}" for file in files))
    print("\n".join([f"\n{text}; then", *(f"  {each}" for each in commands)]))
    return OK
