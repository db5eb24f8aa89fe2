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
        raise ValueError(f"{path}: unknown BEM file type {path.suffix!r}; expected .npz or .nc")
    try:
        bem = readers[path.suffix](path)
    except KeyError as error:
        raise ValueError(f"{path}: no field {error}") from error
    if not np.all(np.diff(bem.frequency) > 0.0) or not np.all(np.isfinite(bem.excitation)):
        raise ValueError(f"{path}: frequencies must ascend and excitation must be finite")
    return bem


def radiation_impedance(bem: Bem) -> Complexes:
    """Return K_r = B + i omega (A - A_inf) on the file's grid, N s/m, for e^{+i omega t}."""
    omega = 2.0 * np.pi * bem.frequency
    return bem.damping + 1j * omega * (bem.added_mass - bem.added_mass_infinite)


def excitation_at(bem: Bem, frequency: Floats) -> Complexes:
    """Return the excitation coefficient at any frequencies (Hz), N/m, e^{-i omega t}.

    Magnitude and unwrapped phase are interpolated linearly and kept constant below the grid; above
    the grid the coefficient is zero. Interpolating the complex values instead would lose 0.5 % of
    the magnitude at 1 Hz, where the phase turns 12 degrees per bin; separate interpolation is
    accurate to 0.2 % over 0.2-1 Hz.
    """
    phase = np.unwrap(np.angle(bem.excitation))
    magnitude = np.interp(frequency, bem.frequency, np.abs(bem.excitation), right=0.0)
    coefficient: Complexes = magnitude * np.exp(1j * np.interp(frequency, bem.frequency, phase))
    return coefficient


def open_regular_file(path: Path) -> BinaryIO:
    """Open a regular file. Raises OSError for a FIFO or device, whose reading could block."""
    fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    if not stat.S_ISREG(os.fstat(fd).st_mode):
        os.close(fd)
        raise OSError(EINVAL, "not a regular file", str(path))
    return open(fd, "rb")


def _read_npz(path: Path) -> Bem:
    with open_regular_file(path) as stream, np.load(stream) as file:
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
    import h5netcdf  # noqa: PLC0415  (importing HDF5 takes half a second; .npz files do not need it)

    with open_regular_file(path) as stream, h5netcdf.File(stream, "r") as file:
        fields: Any = file.variables
        modes = fields["added_mass"].shape[1:]
        if modes != (1, 1):
            raise ValueError(f"{path}: has {modes[0]} modes; expected heave alone")
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
