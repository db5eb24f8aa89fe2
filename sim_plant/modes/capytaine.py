"""Reader of Capytaine's NetCDF datasets, versions 2 and 3; NetCDF-4 and NetCDF-3.

Dimensions are found by name: `omega` (or `freq`, `period`, `wavenumber`, `wavelength`),
`radiating_dof`, `influenced_dof`, `wave_direction` (rad), and `complex` (re, im) of the forces. One
of a kind may be a scalar. Of several depths, densities or gravities the given water chooses one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_plant.bem import open_regular_file
from sim_plant.modes.bem_content import (
    MINUS,
    BemContent,
    Centres,
    Complexes,
    Floats,
    Water,
    body_of,
    open_hdf5,
    stated_water,
)

FREQUENCIES = ("omega", "freq", "period", "wavenumber", "wavelength")
WATERS = {"water_depth": "depth", "rho": "density", "g": "gravity"}
SINGLE = (*WATERS, "body_name", "forward_speed")  # must not be dimensions > 1
NETCDF3 = b"CDF"


class Field(NamedTuple):
    """A variable of a file."""

    dimensions: tuple[str, ...]
    values: NDArray[Any]


Fields = dict[str, Field]


def read(path: Path, water: Water) -> BemContent:
    """Return the content of a dataset."""
    with _open_variables(path) as (variables, version):
        fields = {
            name: Field(tuple(each.dimensions), np.asarray(each[...]))
            for name, each in variables.items()
        }
    return _read(path, fields, water, version)


@contextmanager
def _open_variables(path: Path) -> Iterator[tuple[Any, str]]:
    """Open the variables of a file, with the version of Capytaine that wrote it."""
    with open_regular_file(path) as stream:
        is_netcdf3 = stream.read(3) == NETCDF3
        stream.seek(0)
        if is_netcdf3:
            from scipy.io import netcdf_file  # noqa: PLC0415  (few files are)

            try:
                old = netcdf_file(stream, "r", mmap=False)
            except (ValueError, TypeError, IndexError, EOFError) as error:
                raise ValueError(f"{path}: is no whole NetCDF-3 file ({error})") from error
            yield old.variables, getattr(old, "capytaine_version", b"").decode()
            return
    import h5netcdf  # noqa: PLC0415  (importing HDF5 takes half a second)

    with open_hdf5(path) as hdf5, h5netcdf.File(hdf5, "r") as file:
        yield file.variables, str(file.attrs.get("capytaine_version", ""))


def _read(path: Path, fields: Fields, water: Water, version: str) -> BemContent:
    fields, problems = _one_water(fields, water)
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
    directions = _directions(path, fields)
    infinite = None
    if "Ainf" in fields:
        infinite = fields["Ainf"].values.astype(np.float64)
        if infinite.size != len(rows) * len(rows):
            raise ValueError(f"{path}: Ainf has {infinite.size} values, expected {len(rows)}²")
        infinite = infinite.reshape(len(rows), len(rows))
    of_file = Water(**{own: _scalar(path, fields, name) for name, own in WATERS.items()})
    density, gravity, depth = stated_water(path, of_file, water)
    stiffness = inertia = None
    if "hydrostatic_stiffness" in fields:
        stiffness = _array(path, fields, "hydrostatic_stiffness", matrix[1:], sizes)[:, order]
    elif "waterplane_area" in fields and len(rows) == 1 and rows[0].endswith("Heave"):
        stiffness = density * gravity * fields["waterplane_area"].values.reshape(1, 1)
    if "inertia_matrix" in fields:
        inertia = _array(path, fields, "inertia_matrix", matrix[1:], sizes)[:, order]
    return BemContent(
        tuple(rows),
        omega,
        _array(path, fields, "added_mass", matrix, sizes)[:, :, order],
        _array(path, fields, "radiation_damping", matrix, sizes)[:, :, order],
        _excitation(path, fields, main, sizes | {"wave_direction": directions.size}),
        np.degrees(directions),
        infinite,
        stiffness,
        depth,
        density,
        gravity,
        f"Capytaine {version} NetCDF".replace("  ", " "),
        MINUS,
        tuple(_volumes(fields, rows, density)),
        inertia,
        "inertia_matrix of the BEM file",
        problems,
        centres=tuple(_centres(fields, rows)),
    )


def _one_water(fields: Fields, water: Water) -> tuple[Fields, tuple[str, ...]]:
    """Return the fields at the given water where the file has several, and what stays open."""
    problems, fields = [], dict(fields)
    for name in SINGLE:
        if name not in fields or fields[name].values.size < 2 or fields[name].values.ndim != 1:
            continue
        values, own = fields[name].values, WATERS.get(name)
        given = None if own is None else getattr(water, own)
        chosen = 0
        if given is not None and np.any(np.isclose(values, given, rtol=1e-6)):
            chosen = int(np.argmax(np.isclose(values, given, rtol=1e-6)))
        else:
            listed = ", ".join(str(value) for value in values.tolist())
            advice = "select one before export" if own is None else f"choose one with --{own}"
            problems.append(f"has several values of {name} ({listed}); {advice}")
            if given is not None:
                del fields[name]  # the given value is none of the file's
        fields = {
            key: Field(
                tuple(d for d in each.dimensions if d != name),
                each.values.take(chosen, each.dimensions.index(name)),
            )
            if name in each.dimensions
            else each
            for key, each in fields.items()
        }
    return fields, tuple(problems)


def _directions(path: Path, fields: Fields) -> Floats:
    directions = np.atleast_1d(_field(path, fields, "wave_direction").values.astype(np.float64))
    if np.any(np.abs(directions) > 2.0 * np.pi + 1.0e-6):
        worst = directions[np.argmax(np.abs(directions))]
        raise ValueError(f"{path}: wave_direction is {worst:g} rad; allowed: -6.283 .. 6.283")
    return directions


def _volumes(fields: Fields, modes: list[str], density: float) -> Iterator[float | None]:
    """Yield the displaced volume of each mode's body (m3): the file's only one, or by its name."""
    names = ("displaced_volume", "disp_volume", "disp_mass")
    field = next((name for name in names if name in fields), None)
    for mode in modes:
        if field is None:
            yield None
            continue
        volumes = fields[field].values.ravel() / (density if field == "disp_mass" else 1.0)
        if volumes.size == 1:
            yield float(volumes[0]) if volumes[0] > 0.0 else None
            continue
        found = [
            v for v, body in zip(volumes, _bodies(fields), strict=False) if body == body_of(mode)
        ]
        yield float(found[0]) if found and found[0] > 0.0 else None


def _bodies(fields: Fields) -> list[str]:
    """Return the names of the bodies."""
    return [
        each.decode() if isinstance(each, bytes) else str(each)
        for key in ("body", "body_name")
        if key in fields
        for each in np.atleast_1d(fields[key].values).tolist()
    ]


def _centres(fields: Fields, modes: list[str]) -> Iterator[Centres | None]:
    """Yield the centres of each mode's body, where the file states both as finite numbers."""
    for mode in modes:
        found = []
        for name in ("rotation_center", "center_of_mass"):
            points = fields[name].values.reshape(-1, 3) if name in fields else np.empty((0, 3))
            bodies = _bodies(fields) if len(points) > 1 else [body_of(mode)]
            own = [p for p, body in zip(points, bodies, strict=False) if body == body_of(mode)]
            found += [tuple(map(float, p)) for p in own[:1] if np.all(np.isfinite(p))]
        yield Centres(*found) if len(found) == len(Centres._fields) else None


def _field(path: Path, fields: Fields, name: str) -> Field:
    if name not in fields:
        raise ValueError(f"{path}: has no field {name!r}; it has {', '.join(sorted(fields))}")
    return fields[name]


def _frequency_name(path: Path, fields: Fields) -> str:
    dimensions = _field(path, fields, "added_mass").dimensions
    for name in FREQUENCIES:
        if name in dimensions:
            return name
    raise ValueError(
        f"{path}: added_mass has the dimensions {', '.join(dimensions) or 'none'}; one of "
        f"{', '.join(FREQUENCIES)} is needed"
    )


def _omega(path: Path, fields: Fields, main: str) -> Floats:
    """Return the frequencies, rad/s, by a coordinate of the main dimension."""
    name = next((n for n in FREQUENCIES[:3] if n in fields and fields[n].dimensions == (main,)), "")
    if not name:
        raise ValueError(f"{path}: has no omega, freq or period over the dimension {main}")
    values = fields[name].values.astype(np.float64)
    if name == "omega":
        return values
    with np.errstate(divide="ignore"):
        return 2.0 * np.pi * (values if name == "freq" else 1.0 / values)


def _labels(path: Path, fields: Fields, name: str) -> list[str]:
    values = np.atleast_1d(_field(path, fields, name).values)
    if values.dtype.kind == "S" and values.ndim == 2:  # characters, a row for each label
        values = np.array([b"".join(row) for row in values])
    return [v.decode().rstrip("\0 ") if isinstance(v, bytes) else str(v) for v in values.tolist()]


def _scalar(path: Path, fields: Fields, name: str) -> float | None:
    if name not in fields:
        return None
    values = fields[name].values.astype(np.float64).ravel()
    if values.size != 1:
        raise ValueError(f"{path}: has several values of {name}: {values.tolist()}; keep one")
    return float(values[0])


def _array(
    path: Path, fields: Fields, name: str, needed: tuple[str, ...], sizes: dict[str, int]
) -> NDArray[Any]:
    """Return a field with its dimensions in an order; those of length 1 may be missing."""
    field = _field(path, fields, name)
    values, dimensions = field.values, list(field.dimensions)
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


def _excitation(path: Path, fields: Fields, main: str, sizes: dict[str, int]) -> Complexes:
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
