"""Excitation by a boundary-element method, for comparison: capytaine files, `.npz` or `.nc`.

capytaine's amplitudes are those of e^{-i omega t}; this package uses e^{+i omega t}, so the reader
conjugates them. (WAMIT writes e^{+i omega t} itself.)
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray

from rig.regular_file import MAX_TABLE_BYTES, open_regular
from rig.spectra.periods import Complexes, Floats


class Bem(NamedTuple):
    """Excitation coefficient over frequency."""

    name: str
    frequency: Floats  # Hz, increasing
    excitation: Complexes  # N/m, e^{+i omega t}


def read_bem(path: Path) -> Bem:
    """Read a file; raises ValueError for another file type or missing fields."""
    try:
        if path.suffix == ".npz":
            with open_regular(path, MAX_TABLE_BYTES) as file, np.load(file) as data:
                frequency, force = np.array(data["f_hz"]), np.array(data["Fe_complex"])
        elif path.suffix == ".nc":
            frequency, force = _from_netcdf(path)
        else:
            raise ValueError(f"{path}: not a BEM file: its suffix must be .npz or .nc")
    except KeyError as missing:
        raise ValueError(f"{path}: no field {missing}") from None
    return Bem(path.name, frequency.astype(np.float64), np.conj(force).astype(np.complex128))


def excitation_at(bem: Bem, frequency: Floats) -> Complexes:
    """Return the coefficient at frequencies (Hz), N/m; NaN outside the file's range.

    Magnitude and phase are interpolated linearly.
    """
    magnitude = np.interp(frequency, bem.frequency, np.abs(bem.excitation), np.nan, np.nan)
    phase = np.interp(frequency, bem.frequency, np.unwrap(np.angle(bem.excitation)))
    return np.asarray(magnitude * np.exp(1j * phase), dtype=np.complex128)


def _from_netcdf(path: Path) -> tuple[Floats, Complexes]:
    with (
        open_regular(path, MAX_TABLE_BYTES) as file,
        xarray.open_dataset(file, engine="h5netcdf") as data,
    ):
        omega = data["omega"].values
        parts = data["excitation_force"].squeeze()
        force = parts.sel(complex="re").values + 1j * parts.sel(complex="im").values
    kept = np.isfinite(omega) & (omega > 0.0)
    order = np.argsort(omega[kept])
    return omega[kept][order] / (2.0 * np.pi), force[kept][order]
