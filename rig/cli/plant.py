"""`rig plant`: plant files. Kinds of rig add the commands, by names that begin with `plant`."""

import typer

command = typer.Typer(no_args_is_help=True)


@command.callback()
def plant() -> None:
    """Write the files of simulated plants."""
