"""The console for tables, and their plain form."""

import os
from typing import Any

from rich.console import Console
from rich.measure import Measurement
from rich.table import Column, Table

WIDTH = 100  # where there is no terminal


def table_console() -> Console:
    """Return a console as wide as the terminal or COLUMNS; `WIDTH` in a pipe or a file."""
    console = Console(highlight=False)
    if console.is_terminal or os.environ.get("COLUMNS"):
        return console
    return Console(highlight=False, width=WIDTH)


def whole_table(table: Table) -> Table:
    """Return a table that keeps its width on a narrow terminal: a number cut short is no number."""
    wide = Console(width=1000)
    table.width = Measurement.get(wide, wide.options, table).maximum
    return table


def plain_table(*headings: str, **style: Any) -> Table:
    """Return a table without lines; ``style`` is that of `rich.table.Table`.

    A heading that begins with ``>`` is that of a column aligned to the right. The column of one
    that ends with ``…`` folds its texts; all others keep them on one line.
    """
    columns = [
        Column(
            heading.strip(">…"),
            justify="right" if heading.startswith(">") else "left",
            overflow="fold" if heading.endswith("…") else "ellipsis",
            no_wrap=not heading.endswith("…"),
        )
        for heading in headings
    ]
    return Table(*columns, **{"box": None, "header_style": "bold", "pad_edge": False} | style)
