"""Tables of a session as files: CSV for people, JSON and NetCDF for programs."""

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rig.kinds.oswec_bench.products.result import Result, Table

JSON = "session.json"


def write_tables(result: Result, facts: dict[str, Any], folder: Path) -> list[Path]:
    """Write a CSV and a NetCDF file for each table, and everything in one JSON file. Return the
    paths.
    """
    paths = []
    for table in result.tables:
        paths += [_write_csv(table, folder), _write_netcdf(table, facts, folder)]
    path = folder / JSON
    text = json.dumps({**facts, **result_as_dict(result)}, indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")
    return [*paths, path]


def result_as_dict(result: Result) -> dict[str, Any]:
    """Return constants, comparisons, notes and tables in the form of JSON: NaN is null."""
    return {
        "constants": {
            name: {
                "value": to_json_value(each.value),
                "uncertainty": to_json_value(each.uncertainty),
                "unit": each.unit,
                "method": each.method,
            }
            for name, each in result.constants.items()
        },
        "comparisons": [each._asdict() for each in result.comparisons],
        "notes": list(result.notes),
        "tables": {
            table.name: {
                "title": table.title,
                "columns": [
                    {"name": c.name, "unit": c.unit, "values": [to_json_value(v) for v in c.values]}
                    for c in table.columns
                ],
            }
            for table in result.tables
        },
    }


def to_json_value(value: Any) -> Any:
    """Return a number or text without numpy types; None for a number that is not finite."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _write_csv(table: Table, folder: Path) -> Path:
    path = folder / f"{table.name}.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(f"{c.name} [{c.unit}]" if c.unit else c.name for c in table.columns)
        writer.writerows(zip(*(map(to_json_value, c.values) for c in table.columns), strict=True))
    return path


def _write_netcdf(table: Table, facts: dict[str, Any], folder: Path) -> Path:
    path = folder / f"{table.name}.nc"
    variables = {
        c.name.replace("/", "per"): ("point", np.array(c.values), {"units": c.unit})
        for c in table.columns
    }
    attributes = {
        key: value for key, value in facts.items() if isinstance(value, str | float | int)
    }
    xarray.Dataset(variables, attrs={"title": table.title, **attributes}).to_netcdf(
        path, engine="h5netcdf"
    )
    return path
