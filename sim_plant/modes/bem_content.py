"""The content of a BEM file as its reader returns it, and what the readers share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
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


class Centres(NamedTuple):
    """Point about which the rotations of a body turn, and its centre of mass; x, y, z, m."""

    rotation: tuple[float, ...]
    mass: tuple[float, ...]

    def lever(self, rotation: str) -> Floats:
        """Return the motion of the centre of mass per angle of a rotation, x, y, z, m/rad."""
        turned = np.eye(3)[_degree(rotation) - 3]
        motion: Floats = np.cross(turned, np.subtract(self.mass, self.rotation))
        return motion

    def text(self, rotation: str) -> str:
        """Return the two points of a rotation, for messages."""
        turning, mass = (
            ", ".join(f"{each:g}" for each in point) for point in (self.rotation, self.mass)
        )
        return f"{rotation} turns about ({turning}) m, but the centre of mass is ({mass}) m"


class BemContent(NamedTuple):
    """All modes and directions of a file, before the choice of some; frequencies may descend.

    Phases are those of e^{-i omega t} whatever `phase` the file has.
    """

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
    source: str  # program and format
    phase: str  # the file's own: e^{-i omega t} or e^{+i omega t}
    volume: tuple[float | None, ...]  # m3, displaced by the body of each mode; None: not stated
    inertia: Floats | None = None  # (n, n), kg, kg m or kg m2; NaN: not stated
    inertia_source: str = ""
    problems: tuple[str, ...] = ()  # what has to be chosen before the content means anything
    scaling: str = "dimensional, SI"  # the file's own; the values here are dimensional
    centres: tuple[Centres | None, ...] = ()  # of each mode's body; empty or None: not stated


MINUS, PLUS = "e^{-i omega t}", "e^{+i omega t}"
WATER = {
    "density": ("density_kg_per_m3", "kg/m3"),
    "gravity": ("gravity_m_per_s2", "m/s2"),
    "depth": ("depth_m", "m"),
}
ALLOWED = {
    "density_kg_per_m3": (500.0, 2000.0),
    "gravity_m_per_s2": (9.0, 10.5),
    "depth_m": (1.0e-3, math.inf),
}
DEEPEST = 2.0e4  # m, the largest depth that a plant file may have: infinite for any wave


class OpenWaterError(ValueError):
    """Problems with the water of a BEM file; `fields` are those of `Water` that it lacks."""

    def __init__(self, problems: Iterable[str], fields: Iterable[str]) -> None:
        super().__init__("\n".join(problems))
        self.fields = tuple(fields)


@contextmanager
def open_hdf5(path: Path) -> Iterator[Any]:
    """Open an HDF5 file for reading; ValueError if it is another format."""
    import h5py  # noqa: PLC0415  (importing HDF5 takes half a second; text formats do not need it)

    with open_regular_file(path) as stream:
        try:
            file = h5py.File(stream, "r")
        except OSError as error:
            reason = "is empty" if path.stat().st_size == 0 else f"is no whole HDF5 file ({error})"
            raise ValueError(f"{path}: {reason}") from error
        with file:
            yield file


def text_lines(path: Path) -> list[str]:
    """Return the lines of a text file; ValueError if it is binary or empty."""
    with open_regular_file(path) as stream:
        content = stream.read()
    if not content.strip():
        raise ValueError(f"{path}: is empty")
    if b"\0" in content[:4096]:
        raise ValueError(f"{path}: is a binary file, not the text of a BEM program")
    return content.decode("latin-1").splitlines()


def body_of(mode: str) -> str:
    """Return the name of the body of a mode: `float` for `float__Heave`, else empty."""
    return mode.rpartition("__")[0]


def rotates(mode: str) -> bool:
    """Return whether a mode, by its name, is an angle."""
    return _degree(mode) >= RIGID_MODES.index("Roll")


def direction_of(mode: str) -> int | None:
    """Return the direction in which a mode moves its body, 0: x, 1: y, 2: z; None of others."""
    degree = _degree(mode)
    return degree if 0 <= degree < RIGID_MODES.index("Roll") else None


def _degree(mode: str) -> int:
    """Return the place of a mode among the `RIGID_MODES`; -1: it is another one."""
    name = mode.rpartition("__")[2].capitalize()
    return RIGID_MODES.index(name) if name in RIGID_MODES else -1


def stated_water(path: Path, found: Water, given: Water) -> tuple[float, float, float]:
    """Return density, gravity and depth from the file or the plant.

    What both state must agree; what lies outside `ALLOWED` has other units. Raises
    `OpenWaterError` with all problems.
    """
    problems, missing = [], []
    values = {}
    for field, (name, unit) in WATER.items():
        in_file, own = getattr(found, field), getattr(given, field)
        option = f"give --{field}, or {name} in the plant file"
        if in_file is None and own is None:
            missing.append(field)
            problems.append(f"does not state {name} ({unit}); {option}")
            continue
        if in_file is not None and own is not None and not math.isclose(in_file, own, rel_tol=1e-6):
            deep = own >= DEEPEST and in_file == math.inf
            if not deep:
                problems.append(
                    f"states {name} {in_file:g} {unit}, the plant file {own:g}; remove one"
                )
        value = own if in_file is None else in_file
        low, high = ALLOWED[name]
        if not low <= value <= high:
            problems.append(f"{name} is {value:g} {unit}; allowed: {low:g} .. {high:g}")
        values[field] = float(value)
    if problems:
        raise OpenWaterError((f"{path}: {each}" for each in problems), missing)
    return values["density"], values["gravity"], values["depth"]
