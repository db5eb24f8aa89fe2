"""Masses that a BEM file states: a matrix of inertia, or the displaced volume of a body."""

import re
from pathlib import Path

import h5py
import numpy as np
import xarray

from rig.regular_file import MAX_TABLE_BYTES, open_regular, read_regular

_TRANSLATIONS = ("Surge", "Sway", "Heave")
_VOLUMES = re.compile(rb"Volumes \(VOLX,VOLY,VOLZ\):\s+(\S+)\s+(\S+)\s+(\S+)")


def stated_mass(path: Path, dof: str, density: float) -> tuple[float | None, str]:
    """Return the mass (kg) or moment of inertia (kg*m2) of a mode, and its source.

    None if the file states neither an inertia nor, for a translation, the displaced volume.
    """
    suffix = path.suffix.lower()
    if suffix == ".nc":
        inertia = _capytaine_inertia(path, dof)
        if inertia is not None:
            return inertia, "inertia_matrix of the BEM file"
    volume = None
    if dof.rpartition("__")[2].capitalize() in _TRANSLATIONS:
        volume = _VOLUME_READERS.get(suffix, _no_volume)(path, dof)
    if volume is None or not volume > 0.0:
        return None, ""
    return density * volume, f"displaced: {density:g} kg/m3 * {volume:.5g} m3"


def _capytaine_inertia(path: Path, dof: str) -> float | None:
    with (
        open_regular(path, MAX_TABLE_BYTES) as file,
        xarray.open_dataset(file, engine="h5netcdf") as data,
    ):
        if "inertia_matrix" not in data:
            return None
        matrix = data["inertia_matrix"].squeeze()
        if matrix.ndim:
            matrix = matrix.sel(influenced_dof=dof, radiating_dof=dof)
        value = float(matrix)
    return value if np.isfinite(value) and value > 0.0 else None


def _capytaine_volume(path: Path, dof: str) -> float | None:
    with (
        open_regular(path, MAX_TABLE_BYTES) as file,
        xarray.open_dataset(file, engine="h5netcdf") as data,
    ):
        if "displaced_volume" not in data or data["displaced_volume"].size != 1:
            return None
        return float(data["displaced_volume"])


def _bemio_volume(path: Path, dof: str) -> float | None:
    body = dof.partition("__")[0] if "__" in dof else "body1"
    with open_regular(path, MAX_TABLE_BYTES) as stream, h5py.File(stream, "r") as file:
        field = f"{body}/properties/disp_vol"
        return float(np.ravel(file[field][()])[0]) if field in file else None


def _wamit_volume(path: Path, dof: str) -> float | None:
    found = _VOLUMES.findall(read_regular(path, MAX_TABLE_BYTES))
    if len(found) != 1:  # of several bodies: whose volume is not stated next to it
        return None
    return float(np.median([float(each) for each in found[0]]))


def _no_volume(path: Path, dof: str) -> float | None:
    return None


_VOLUME_READERS = {".nc": _capytaine_volume, ".h5": _bemio_volume, ".out": _wamit_volume}
