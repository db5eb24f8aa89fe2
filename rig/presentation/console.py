"""The console for tables."""

import os

from rich.console import Console

WIDTH = 100  # where there is no terminal


def table_console() -> Console:
    """Return a console as wide as the terminal or COLUMNS; `WIDTH` in a pipe or a file."""
    console = Console(highlight=False)
    if console.is_terminal or os.environ.get("COLUMNS"):
        return console
    return Console(highlight=False, width=WIDTH)
