"""The content of a BEM file as its reader returns it, and what the readers share."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_plant.bem import open_regular_file

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

RIGID_MODES = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")


class Water(NamedTuple):
    """The water of a plant file; None for each number that the BEM file has to state."""

    density: float | None = None  # kg/m3
    gravity: float | None = None  # m/s2
    depth: float | None = None  # m
    length_scale: float | None = None  # m, ULEN of WAMIT's numeric files


class BemContent(NamedTuple):
    """All modes and directions of a file, before the choice of some; frequencies may descend."""

    modes: tuple[str, ...]
    omega: Floats  # rad/s; may contain 0 and inf
    added_mass: Floats  # (omega, n, n)
    damping: Floats
    excitation: Complexes  # (omega, directions, n)
    directions: Floats  # degrees
    infinite: Floats | None  # (n, n), where the file has it apart from `omega`
    stiffness: Floats | None
    depth: float
    density: float
    gravity: float


@contextmanager
def open_hdf5(path: Path) -> Iterator[Any]:
    """Open an HDF5 file for reading; ValueError if it is another format."""
    import h5py  # noqa: PLC0415  (importing HDF5 takes half a second; text formats do not need it)

    with open_regular_file(path) as stream:
        try:
            file = h5py.File(stream, "r")
        except OSError as error:
            message = f"{path}: is not an HDF5 file (Capytaine .nc, BEMIO .h5)"
            raise ValueError(message) from error
        with file:
            yield file


def stated(path: Path, name: str, found: float | None, given: float | None, unit: str) -> float:
    """Return a property of the water from the file or the plant; both must agree."""
    if found is None and given is None:
        raise ValueError(f"{path}: does not state {name} ({unit}); set {name} in the plant file")
    if found is not None and given is not None and abs(found - given) > 1.0e-6 * abs(found):
        raise ValueError(
            f"{path}: states {name} {found:g} {unit}, the plant file {given:g}; remove one"
        )
    value = found if found is not None else given
    assert value is not None
    if not value > 0.0:
        raise ValueError(f"{path}: {name} is {value:g} {unit}; allowed: above 0")
    return float(value)
