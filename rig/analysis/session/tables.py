"""Tables of a session as files: CSV for people, JSON and NetCDF for programs."""

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rig.analysis.session.result import Result, Table

JSON = "session.json"


def write_tables(result: Result, facts: dict[str, Any], folder: Path) -> list[Path]:
    """A CSV and a NetCDF file for each table, and everything in one JSON file."""
    made = []
    for table in result.tables:
        made += [_csv(table, folder), _netcdf(table, facts, folder)]
    path = folder / JSON
    text = json.dumps({**facts, **as_json(result)}, indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")
    return [*made, path]


def as_json(result: Result) -> dict[str, Any]:
    """Constants, comparison, notes and tables as JSON can hold them: NaN is null."""
    return {
        "constants": {
            name: {
                "value": plain(each.value),
                "uncertainty": plain(each.uncertainty),
                "unit": each.unit,
                "method": each.method,
            }
            for name, each in result.constants.items()
        },
        "compared": [each._asdict() for each in result.compared],
        "notes": list(result.notes),
        "tables": {
            table.name: {
                "title": table.title,
                "columns": [
                    {"name": c.name, "unit": c.unit, "values": [plain(v) for v in c.values]}
                    for c in table.columns
                ],
            }
            for table in result.tables
        },
    }


def plain(value: Any) -> Any:
    """A number or text without numpy, None for what is not finite."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _csv(table: Table, folder: Path) -> Path:
    path = folder / f"{table.name}.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(f"{c.name} [{c.unit}]" if c.unit else c.name for c in table.columns)
        writer.writerows(zip(*(map(plain, c.values) for c in table.columns), strict=True))
    return path


def _netcdf(table: Table, facts: dict[str, Any], folder: Path) -> Path:
    path = folder / f"{table.name}.nc"
    variables = {
        c.name.replace("/", "per"): ("point", np.array(c.values), {"units": c.unit})
        for c in table.columns
    }
    said = {key: value for key, value in facts.items() if isinstance(value, str | float | int)}
    xarray.Dataset(variables, attrs={"title": table.title, **said}).to_netcdf(
        path, engine="h5netcdf"
    )
    return path
