"""The pictures and tables that the analysis of a run has written into its folder."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rig.api.named_values import NamedValues

if TYPE_CHECKING:
    import pandas
    import xarray


class Picture:
    """A picture of a run, which a notebook shows.

    Attributes:
        path: The PNG file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def __repr__(self) -> str:
        return f"<picture {self.path}>"

    def _repr_png_(self) -> bytes:
        return self.path.read_bytes()


class Pictures(NamedValues[Picture]):
    """The pictures (PNG) in the folder of a run by name, also as attributes."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._found = {path.stem: Picture(path) for path in sorted(folder.glob("*.png"))}

    def __getitem__(self, name: str) -> Picture:
        if name not in self._found:
            listed = ", ".join(self._found) or "none; rig plot draws them"
            raise KeyError(f"{self._folder}: no picture {name}; there are: {listed}")
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def __repr__(self) -> str:
        return f"<pictures: {', '.join(self._found) or 'none'}>"


def read_tables(
    folder: Path, *, leave_out: Iterable[str]
) -> "dict[str, pandas.DataFrame | xarray.Dataset]":
    """Return the tables (NetCDF) in a folder by name, with the units of their columns.

    A table of more than one dimension is a Dataset.
    """
    import xarray

    found: dict[str, pandas.DataFrame | xarray.Dataset] = {}
    for path in sorted(folder.glob("*.nc")):
        if path.name in set(leave_out):
            continue
        with xarray.open_dataset(path, engine="h5netcdf", decode_times=False) as stored:
            table = stored.load()
        if len(table.sizes) != 1:  # as a DataFrame it would have every combination of lines
            found[path.stem] = table
            continue
        frame = table.to_dataframe()
        frame.attrs["units"] = {
            str(name): str(variable.attrs["units"])
            for name, variable in table.variables.items()
            if variable.attrs.get("units")
        }
        found[path.stem] = frame
    return found
