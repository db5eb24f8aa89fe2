"""Where tables are printed."""

import os

from rich.console import Console

WIDTH = 100  # where there is no terminal


def table_console() -> Console:
    """As wide as the terminal, or as COLUMNS says; into a pipe or a file `WIDTH`."""
    found = Console(highlight=False)
    if found.is_terminal or os.environ.get("COLUMNS"):
        return found
    return Console(highlight=False, width=WIDTH)
