"""Reader of Capytaine's NetCDF datasets, versions 2 and 3.

Dimensions are found by name: `omega` (or `freq`, `period`), `radiating_dof`, `influenced_dof`,
`wave_direction` (rad), and `complex` (re, im) of the forces. One of a kind may be a scalar.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_plant.modes.bem_content import BemContent, Complexes, Floats, Water, open_hdf5, stated

FREQUENCIES = ("omega", "freq", "period")
SINGLE = ("water_depth", "rho", "g", "body_name", "forward_speed")  # must not be dimensions > 1


def read(path: Path, water: Water) -> BemContent:
    """Return the content of a dataset."""
    import h5netcdf  # noqa: PLC0415  (importing HDF5 takes half a second)

    with open_hdf5(path) as hdf5, h5netcdf.File(hdf5, "r") as file:
        return _read(path, file.variables, water)


def _read(path: Path, fields: Any, water: Water) -> BemContent:
    main = _frequency_name(path, fields)
    omega = _omega(path, fields, main)
    rows, columns = _labels(path, fields, "influenced_dof"), _labels(path, fields, "radiating_dof")
    if set(rows) != set(columns):
        raise ValueError(
            f"{path}: radiating_dof ({', '.join(columns)}) and influenced_dof ({', '.join(rows)}) "
            "must be the same modes"
        )
    order = [columns.index(name) for name in rows]
    sizes = {main: omega.size, "influenced_dof": len(rows), "radiating_dof": len(rows)}
    matrix = (main, "influenced_dof", "radiating_dof")
    directions = np.atleast_1d(np.asarray(_field(path, fields, "wave_direction")[...], np.float64))
    stiffness = infinite = None
    if "hydrostatic_stiffness" in fields:
        stiffness = _array(path, fields, "hydrostatic_stiffness", matrix[1:], sizes)[:, order]
    if "Ainf" in fields:
        infinite = np.asarray(fields["Ainf"][...], np.float64)
        if infinite.size != len(rows) * len(rows):
            raise ValueError(f"{path}: Ainf has {infinite.size} values, expected {len(rows)}²")
        infinite = infinite.reshape(len(rows), len(rows))
    return BemContent(
        tuple(rows),
        omega,
        _array(path, fields, "added_mass", matrix, sizes)[:, :, order],
        _array(path, fields, "radiation_damping", matrix, sizes)[:, :, order],
        _excitation(path, fields, main, sizes | {"wave_direction": directions.size}),
        np.degrees(directions),
        infinite,
        stiffness,
        stated(path, "depth_m", _scalar(path, fields, "water_depth"), water.depth, "m"),
        stated(path, "density_kg_per_m3", _scalar(path, fields, "rho"), water.density, "kg/m3"),
        stated(path, "gravity_m_per_s2", _scalar(path, fields, "g"), water.gravity, "m/s2"),
    )


def _field(path: Path, fields: Any, name: str) -> Any:
    if name not in fields:
        raise ValueError(f"{path}: has no field {name!r}; it has {', '.join(sorted(fields))}")
    return fields[name]


def _frequency_name(path: Path, fields: Any) -> str:
    dimensions = _field(path, fields, "added_mass").dimensions
    for name in SINGLE:
        if name in dimensions and fields[name].shape[0] > 1:
            values = ", ".join(str(value) for value in np.asarray(fields[name][...]).tolist())
            raise ValueError(
                f"{path}: has several values of {name} ({values}); select one before export"
            )
    for name in FREQUENCIES:
        if name in dimensions:
            return name
    raise ValueError(
        f"{path}: added_mass has the dimensions {', '.join(dimensions) or 'none'}; one of "
        f"{', '.join(FREQUENCIES)} is needed"
    )


def _omega(path: Path, fields: Any, main: str) -> Floats:
    values = np.asarray(_field(path, fields, main)[...], np.float64)
    if main == "omega":
        return values
    with np.errstate(divide="ignore"):
        return 2.0 * np.pi * (values if main == "freq" else 1.0 / values)


def _labels(path: Path, fields: Any, name: str) -> list[str]:
    values = np.atleast_1d(np.asarray(_field(path, fields, name)[...]))
    if values.dtype.kind == "S" and values.ndim == 2:  # characters, a row for each label
        values = np.array([b"".join(row) for row in values])
    return [v.decode().rstrip("\0 ") if isinstance(v, bytes) else str(v) for v in values.tolist()]


def _scalar(path: Path, fields: Any, name: str) -> float | None:
    if name not in fields:
        return None
    values = np.asarray(fields[name][...], np.float64).ravel()
    if values.size != 1:
        raise ValueError(f"{path}: has several values of {name}: {values.tolist()}; keep one")
    return float(values[0])


def _array(
    path: Path, fields: Any, name: str, needed: tuple[str, ...], sizes: dict[str, int]
) -> NDArray[Any]:
    """Return a field with its dimensions in an order; those of length 1 may be missing."""
    field = _field(path, fields, name)
    values, dimensions = np.asarray(field[...]), list(field.dimensions)
    for extra in [d for d in dimensions if d not in needed]:
        at = dimensions.index(extra)
        if values.shape[at] != 1:
            raise ValueError(
                f"{path}: {name} has the unexpected dimension {extra} ({values.shape[at]} values); "
                f"allowed: {', '.join(needed)}"
            )
        values = values.squeeze(at)
        dimensions.remove(extra)
    for missing in [d for d in needed if d not in dimensions]:
        if sizes[missing] != 1:
            raise ValueError(
                f"{path}: {name} has the dimensions {', '.join(dimensions) or 'none'}; expected "
                f"{', '.join(needed)}"
            )
        values, dimensions = values[..., None], [*dimensions, missing]
    values = values.transpose([dimensions.index(d) for d in needed])
    expected = tuple(sizes[d] for d in needed)
    if values.shape != expected:
        raise ValueError(f"{path}: {name} has the shape {values.shape}, expected {expected}")
    return values if values.dtype.kind == "c" else values.astype(np.float64)


def _excitation(path: Path, fields: Any, main: str, sizes: dict[str, int]) -> Complexes:
    """Return the excitation force, or the sum of its two parts where the file has only these."""
    names = ["excitation_force"]
    if names[0] not in fields:
        names = ["diffraction_force", "Froude_Krylov_force"]
        if not all(name in fields for name in names):
            raise ValueError(
                f"{path}: has no field 'excitation_force' (nor 'diffraction_force' with "
                f"'Froude_Krylov_force'); it has {', '.join(sorted(fields))}"
            )
    needed = (main, "wave_direction", "influenced_dof")
    total = np.zeros([sizes[d] for d in needed], np.complex128)
    for name in names:
        if "complex" in fields[name].dimensions:
            parts = _array(path, fields, name, ("complex", *needed), sizes | {"complex": 2})
            labels = _labels(path, fields, "complex") if "complex" in fields else ["re", "im"]
            if sorted(labels) != ["im", "re"]:
                raise ValueError(f"{path}: complex is {labels}; expected re, im")
            total += parts[labels.index("re")] + 1j * parts[labels.index("im")]
        else:
            values = _array(path, fields, name, needed, sizes)
            if values.dtype.kind != "c":
                raise ValueError(f"{path}: {name} is real; the dimension 'complex' is missing")
            total += values
    return total
