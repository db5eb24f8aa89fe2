"""Reader of the HDF5 files of WEC-Sim's BEMIO: `simulation_parameters`, `body1`, `body2`, ...

Unless `simulation_parameters/scaled` is 1, values are normalised as WAMIT's: added mass by rho,
damping by rho omega, forces and stiffness by rho g. Phases are those of e^{+i omega t}. Arrays are
(modes of the body, modes of all bodies, frequencies), forces (modes, directions, frequencies).
Source: WEC-Sim, writeBEMIOH5.m, readBEMIOH5.m and normalizeBEM.m.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from sim_plant.modes.bem_content import PLUS, BemContent, Floats, Water, open_hdf5, stated_water
from sim_plant.modes.wamit import mode_names


def read(path: Path, water: Water) -> BemContent:
    """Return the content of a BEMIO file of any number of bodies."""
    with open_hdf5(path) as file:
        return _read(path, file, water)


def _read(path: Path, file: Any, water: Water) -> BemContent:
    bodies = sorted((n for n in file if n.startswith("body")), key=lambda n: int(n[4:] or 0))
    if not bodies:
        raise ValueError(f"{path}: has no group 'body1'; it has {', '.join(sorted(file))}")
    omega = _values(path, file, "simulation_parameters/w").ravel()
    directions = _values(path, file, "simulation_parameters/wave_dir").ravel()
    water_of_file = Water(*(_scalar(file, name) for name in ("rho", "g", "water_depth")))
    density, gravity, depth = stated_water(path, water_of_file, water)
    scaled = _scalar(file, "scaled") == 1.0
    mass = 1.0 if scaled else density
    force = 1.0 if scaled else density * gravity
    sizes = [_values(path, file, f"{body}/hydro_coeffs/excitation/re").shape[0] for body in bodies]
    total, waves = sum(sizes), directions.size
    rows: dict[str, list[Any]] = {name: [] for name in ("A", "B", "inf", "re", "im")}
    stiffness = np.zeros((total, total))
    first = 0
    for body, size in zip(bodies, sizes, strict=True):
        group = f"{body}/hydro_coeffs"
        expected = {
            "A": ("added_mass/all", (size, total, omega.size)),
            "B": ("radiation_damping/all", (size, total, omega.size)),
            "inf": ("added_mass/inf_freq", (size, total)),
            "re": ("excitation/re", (size, waves, omega.size)),
            "im": ("excitation/im", (size, waves, omega.size)),
        }
        for name, (field, shape) in expected.items():
            rows[name].append(_values(path, file, f"{group}/{field}", shape))
        own = _values(path, file, f"{group}/linear_restoring_stiffness", (size, size))
        stiffness[first : first + size, first : first + size] = own
        first += size
    added_mass, damping, infinite, re, im = (np.concatenate(rows[name]) for name in rows)
    with np.errstate(invalid="ignore"):
        damping = damping * (1.0 if scaled else mass * omega)
    return BemContent(
        _names(sizes),
        omega,
        np.moveaxis(added_mass, 2, 0) * mass,
        np.moveaxis(damping, 2, 0),
        np.moveaxis(re - 1j * im, 0, 2).swapaxes(0, 1) * force,
        directions,
        infinite * mass,
        stiffness * force,
        depth,
        density,
        gravity,
        "WEC-Sim BEMIO .h5",
        PLUS,
        tuple(
            _volume(file, body)
            for body, size in zip(bodies, sizes, strict=True)
            for _ in range(size)
        ),
        scaling="dimensional, SI" if scaled else "normalised by density and gravity",
    )


def _volume(file: Any, body: str) -> float | None:
    """Return the displaced volume of a body, m3."""
    name = f"{body}/properties/disp_vol"
    value = float(np.ravel(file[name][()])[0]) if name in file else 0.0
    return value if value > 0.0 else None


def _names(sizes: list[int]) -> tuple[str, ...]:
    """Return the names of the modes; those beyond the six rigid ones are numbered."""
    if all(size == 6 for size in sizes):
        return mode_names(6 * len(sizes))
    rigid = mode_names(6)
    prefixes = [f"body{k}__" if len(sizes) > 1 else "" for k in range(1, len(sizes) + 1)]
    return tuple(
        prefix + (rigid[k] if k < 6 else f"mode{k + 1}")
        for prefix, size in zip(prefixes, sizes, strict=True)
        for k in range(size)
    )


def _values(path: Path, file: Any, name: str, shape: tuple[int, ...] | None = None) -> Floats:
    if name not in file:
        raise ValueError(f"{path}: has no field {name!r}")
    values = np.asarray(file[name][...], np.float64)
    if shape is not None and values.shape != shape:
        raise ValueError(f"{path}: {name} has the shape {values.shape}, expected {shape}")
    return values


def _scalar(file: Any, name: str) -> float | None:
    """Return a simulation parameter; infinite depth is written as text."""
    name = f"simulation_parameters/{name}"
    if name not in file:
        return None
    value = file[name][()]
    if isinstance(value, bytes | str):
        text = value.decode() if isinstance(value, bytes) else value
        return math.inf if text.strip("\0 ").lower() == "infinite" else None
    numbers = np.asarray(value, np.float64).ravel()
    return float(numbers[0]) if numbers.size == 1 else None
