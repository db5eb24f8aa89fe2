"""Tables of results as CSV files."""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any


def write_table(columns: Mapping[str, Iterable[Any]], path: Path, line_end: str = "\r\n") -> Path:
    """Write columns of equal length below their names; numbers read back exactly."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator=line_end)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return path
