"""Hydrodynamic coefficients of one hull in heave, from a boundary-element (BEM) file.

Phase convention of capytaine, kept everywhere in sim_plant: a quantity is Re(X e^{-i omega t}).
WAMIT writes e^{+i omega t}, so its phases have the other sign.
"""

from __future__ import annotations

import os
import stat
from errno import EINVAL
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class Bem(NamedTuple):
    """Heave coefficients over frequency."""

    frequency: Floats  # Hz, ascending
    added_mass: Floats  # kg
    damping: Floats  # N s/m
    excitation: Complexes  # N per metre of wave amplitude, e^{-i omega t}
    added_mass_infinite: float  # kg, at infinite frequency
    stiffness: float  # N/m, hydrostatic
    depth: float  # m, inf for deep water


def read_bem(path: Path) -> Bem:
    """Read a capytaine heave result from `.npz` (numpy only, 2 ms) or `.nc` (needs h5py).

    Raises ValueError for another suffix or missing fields, OSError if unreadable.
    """
    readers = {".npz": _read_npz, ".nc": _read_netcdf}
    if path.suffix not in readers:
        raise ValueError(f"{path}: a BEM file is .npz or .nc")
    try:
        bem = readers[path.suffix](path)
    except KeyError as missing:
        raise ValueError(f"{path}: no field {missing}") from missing
    if not np.all(np.diff(bem.frequency) > 0.0) or not np.all(np.isfinite(bem.excitation)):
        raise ValueError(f"{path}: frequencies must ascend and excitation must be finite")
    return bem


def radiation_impedance(bem: Bem) -> Complexes:
    """Give K_r = B + i omega (A - A_inf) on the file's grid, N s/m, as seen by e^{+i omega t}."""
    omega = 2.0 * np.pi * bem.frequency
    return bem.damping + 1j * omega * (bem.added_mass - bem.added_mass_infinite)


def excitation_at(bem: Bem, frequency: Floats) -> Complexes:
    """Give the excitation coefficient at any frequencies (Hz), N/m, e^{-i omega t}.

    Magnitude and unwrapped phase are interpolated linearly and held below the grid: a straight
    line between complex values would cut the corner of a phase that turns 12 degrees per bin at
    1 Hz (0.5 % of magnitude), the two apart are good to 0.2 % over 0.2-1 Hz.
    Zero above the grid.
    """
    phase = np.unwrap(np.angle(bem.excitation))
    magnitude = np.interp(frequency, bem.frequency, np.abs(bem.excitation), right=0.0)
    turned: Complexes = magnitude * np.exp(1j * np.interp(frequency, bem.frequency, phase))
    return turned


def _regular(path: Path) -> BinaryIO:
    """The file, open; OSError for a FIFO or device, which would be waited for."""
    fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    if not stat.S_ISREG(os.fstat(fd).st_mode):
        os.close(fd)
        raise OSError(EINVAL, "not a regular file", str(path))
    return open(fd, "rb")


def _read_npz(path: Path) -> Bem:
    with _regular(path) as opened, np.load(opened) as file:
        return Bem(
            np.asarray(file["f_hz"], dtype=np.float64),
            np.asarray(file["A"], dtype=np.float64),
            np.asarray(file["B"], dtype=np.float64),
            np.asarray(file["Fe_complex"], dtype=np.complex128),
            float(file["Ainf"]),
            float(file["K_h"]),
            float(file["depth"]),
        )


def _read_netcdf(path: Path) -> Bem:
    import h5netcdf  # noqa: PLC0415  (half a second of HDF5 that the .npz does without)

    with _regular(path) as opened, h5netcdf.File(opened, "r") as file:
        fields: Any = file.variables
        parts = np.asarray(fields["excitation_force"], dtype=np.float64)[:, :, 0, 0]
        return Bem(
            np.asarray(fields["freq"], dtype=np.float64),
            np.asarray(fields["added_mass"], dtype=np.float64)[:, 0, 0],
            np.asarray(fields["radiation_damping"], dtype=np.float64)[:, 0, 0],
            parts[0] + 1j * parts[1],
            float(fields["Ainf"][()]),
            float(fields["K_h"][()]),
            float(fields["water_depth"][()]),
        )
