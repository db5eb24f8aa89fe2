"""Writer of the row table's files."""

import csv
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray


def write_rows(table: "xarray.Dataset", folder: Path) -> list[Path]:
    """Write ``rows.csv`` (units in the header) and ``rows.nc`` (units in the attributes)."""
    names = [str(name) for name in table.variables]
    units = [table[name].attrs.get("units") for name in names]
    text, binary = folder / "rows.csv", folder / "rows.nc"
    with text.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(f"{n} [{u}]" if u else n for n, u in zip(names, units, strict=True))
        writer.writerows(zip(*(table[name].values.tolist() for name in names), strict=True))
    table.to_netcdf(binary, engine="h5netcdf")
    return [text, binary]
