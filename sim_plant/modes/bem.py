"""Hydrodynamic coefficients of coupled modes, from the files of boundary-element (BEM) programs.

`read_modes` reads Capytaine NetCDF (`.nc`), WAMIT (`.out`, or `.1` with `.3` and `.hst` of the same
name), WEC-Sim BEMIO (`.h5`) and Nemoh (a folder, or its `Nemoh.cal`). All results are dimensional,
with the phases of Capytaine and Nemoh: a quantity is Re(X e^{-i omega t}). WAMIT and BEMIO write
e^{+i omega t}; their readers take the conjugate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim_plant.bem import Bem
from sim_plant.modes import bemio, capytaine, nemoh, wamit
from sim_plant.modes.bem_content import (
    BemContent,
    Centres,
    Complexes,
    Floats,
    Water,
    rotates,
)

MAX_ASYMMETRY = 0.15  # of the diagonal's geometric mean: more is no radiation problem at rest
MAX_NEGATIVE = 0.2  # of the sum of positive damping: more is no rounding or irregular frequency
SMALL_DAMPING = 0.02  # of the impedance of A_inf: the accuracy of the damping of a deep body
SUFFIXES = (".nc", ".h5", ".out", *wamit.NUMERIC_SUFFIXES, ".cal")


class BemModes(NamedTuple):
    """Coefficients of n modes over frequency; matrices are symmetric, [influenced, radiating]."""

    modes: tuple[str, ...]
    frequency: Floats  # Hz, ascending, finite, positive
    added_mass: Floats  # (frequencies, n, n), kg, kg m or kg m2
    damping: Floats  # (frequencies, n, n), N s/m, N s or N m s
    excitation: Complexes  # (frequencies, n), N or N m per metre of wave amplitude, e^{-i omega t}
    added_mass_infinite: Floats  # (n, n), at infinite frequency
    infinite_method: str  # where `added_mass_infinite` comes from
    stiffness: Floats | None  # (n, n), hydrostatic; None: not in the file
    depth: float  # m, inf for deep water
    density: float  # kg/m3
    gravity: float  # m/s2
    direction: float  # degrees, 0: waves travel to +x
    source: str  # program and format of the file
    phase: str  # the file's own convention
    volume: tuple[float | None, ...]  # m3, displaced by the body of each mode; None: not stated
    inertia: Floats | None  # (n, n), kg, kg m or kg m2; NaN: not stated
    inertia_source: str
    centres: tuple[Centres | None, ...]  # of each mode's body; None: not stated


class UnknownModesError(ValueError):
    """Modes were requested that a BEM file lacks; `modes` are those, `known` the file's."""

    def __init__(self, message: str, modes: Sequence[str], known: Sequence[str]) -> None:
        super().__init__(message)
        self.modes, self.known = tuple(modes), tuple(known)


def read_modes(
    path: Path,
    modes: Sequence[str] | None = None,
    *,
    direction: float | None = None,
    water: Water | None = None,
) -> BemModes:
    """Return the coefficients of some modes (all without `modes`), in the order requested.

    `direction` (degrees) chooses one of several wave directions. `water` completes what the file
    does not state. Raises ValueError that names file, field, value and the allowed ones
    (`UnknownModesError` for modes that the file lacks), OSError for a file that cannot be read.
    """
    return choose(path, read_content(path, water or Water()), modes, direction)


def read_content(path: Path, water: Water) -> BemContent:
    """Return all modes and directions of a file; raises as `read_modes`."""
    readers = {
        ".nc": capytaine.read, ".h5": bemio.read, ".out": wamit.read_out, ".cal": nemoh.read
    }  # fmt: skip
    suffix = nemoh.cal_path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(
            f"{path}: unknown type of BEM file {path.suffix!r}; allowed: {', '.join(SUFFIXES)}, "
            "or the folder of a Nemoh run"
        )
    return readers.get(suffix, wamit.read_numeric)(path, water)


def bem_files(path: Path) -> tuple[Path, ...]:
    """Return the existing files that `read_modes` reads, the one of the path first."""
    suffix = nemoh.cal_path(path).suffix.lower()
    if suffix == ".cal":
        return nemoh.files(path)
    if suffix not in wamit.NUMERIC_SUFFIXES:
        return (path,)
    parts = (path.with_suffix(suffix) for suffix in wamit.NUMERIC_SUFFIXES)
    return tuple(each for each in parts if each.exists())


def stated_mass(bem: BemModes | BemContent, mode: int) -> tuple[float | None, str]:
    """Return the mass (kg) or moment of inertia (kg m2) of a mode as the file states it, and how.

    That is its inertia or, for a translation, the mass of the displaced water; None without.
    """
    if bem.inertia is not None and bem.inertia[mode, mode] > 0.0:
        return float(bem.inertia[mode, mode]), bem.inertia_source
    volume = bem.volume[mode]
    if volume is None or rotates(bem.modes[mode]):
        return None, ""
    return bem.density * volume, f"displaced: {bem.density:g} kg/m3 * {volume:.5g} m3"


def mode_bem(bem: BemModes, mode: int) -> Bem:
    """Return the diagonal coefficients of one mode, for the sea's excitation table."""
    stiffness = 0.0 if bem.stiffness is None else float(bem.stiffness[mode, mode])
    return Bem(
        bem.frequency,
        bem.added_mass[:, mode, mode],
        bem.damping[:, mode, mode],
        bem.excitation[:, mode],
        float(bem.added_mass_infinite[mode, mode]),
        stiffness,
        bem.depth,
    )


def axis_damping(bem: BemModes, factors: Floats) -> Floats:
    """Return the radiation damping of an axis over frequency, N s/m or N m s.

    That is the one of the modes moving by `factors` (modes) while the axis moves by 1.
    """
    damping: Floats = np.einsum("i,fij,j->f", factors, bem.damping, factors)
    return damping


def impedance(bem: BemModes) -> Complexes:
    """Return K_r = B + i omega (A - A_inf) on the file's grid, for e^{+i omega t}; (n_f, n, n)."""
    omega = 2.0 * np.pi * bem.frequency[:, None, None]
    return bem.damping + 1j * omega * (bem.added_mass - bem.added_mass_infinite)


def open_choices(
    content: BemContent, modes: Sequence[str] | None, direction: float | None
) -> Iterator[str]:
    """Yield what has to be chosen, or cannot be, before the content has one meaning."""
    yield from content.problems
    names = content.modes
    if len(set(names)) != len(names):
        yield f"a mode appears twice: {', '.join(names)}"
    for name in modes or ():
        if name not in names:
            yield f"has no mode {name!r}; it has {', '.join(names)}"
    directions = content.directions
    listed = ", ".join(f"{d:g}" for d in directions)
    if directions.size == 0:
        yield "has no wave direction: excitation is missing"
    elif direction is None and directions.size > 1:
        yield (
            f"has several wave directions: {listed} degrees; choose one with --direction, or "
            "wave_direction_deg in the plant file"
        )
    elif direction is not None and _turns(directions, direction).min() > 1.0e-3:
        yield f"has no wave direction of {direction:g} degrees; it has {listed}"


def _turns(directions: Floats, requested: float) -> Floats:
    """Return the angles between directions and the requested one, degrees."""
    angles: Floats = np.abs((directions - requested + 180.0) % 360.0 - 180.0)
    return angles


def choose(
    path: Path, content: BemContent, modes: Sequence[str] | None, direction: float | None
) -> BemModes:
    """Return the requested modes of one direction on ascending finite frequencies."""
    problems = [f"{path}: {each}" for each in open_choices(content, modes, direction)]
    names = content.modes
    unknown = [name for name in modes or () if name not in names]
    if unknown:
        raise UnknownModesError("\n".join(problems), unknown, names)
    if problems:
        raise ValueError("\n".join(problems))
    kept = [names.index(name) for name in (names if modes is None else modes)]
    content = _ascending(content)
    grid = np.ix_(range(content.omega.size), kept, kept)
    added_mass, damping = content.added_mass[grid], content.damping[grid]
    turns = _turns(content.directions, content.directions[0] if direction is None else direction)
    wave = int(turns.argmin())
    excitation = content.excitation[:, wave][:, kept]
    omega = content.omega
    if np.any(np.isnan(omega)) or np.any(omega < 0.0):
        raise ValueError(f"{path}: frequencies must be numbers of 0 rad/s and above")
    finite = np.isfinite(omega) & (omega > 0.0)
    used = omega[finite]
    if used.size < 8:
        raise ValueError(f"{path}: has {used.size} frequencies; at least 8 are needed")
    if not np.all(np.diff(used) > 0.0):
        at = int(np.argmax(np.diff(used) <= 0.0))
        raise ValueError(
            f"{path}: frequencies must ascend; {used[at]:g} rad/s is followed by "
            f"{used[at + 1]:g} rad/s"
        )
    fields = {"added mass": added_mass[finite], "damping": damping[finite]}
    for field, values in (*fields.items(), ("excitation", excitation[finite])):
        if not np.all(np.isfinite(values)):
            bad = used[int(np.argwhere(~np.isfinite(values))[0][0])]
            raise ValueError(f"{path}: {field} is not finite at {bad:g} rad/s")
    for field, values in fields.items():
        _check_symmetry(path, field, values, [names[k] for k in kept])
    infinite, method = _infinite(path, content, kept, used, fields)
    _check_damping(path, used, fields["damping"], infinite, [names[k] for k in kept])
    stiffness = content.stiffness
    if stiffness is not None:
        stiffness = stiffness[np.ix_(kept, kept)]
        if not np.all(np.isfinite(stiffness)):
            raise ValueError(f"{path}: hydrostatic stiffness is not finite")
    return BemModes(
        tuple(names[k] for k in kept),
        used / (2.0 * np.pi),
        _symmetric(fields["added mass"]),
        _symmetric(fields["damping"]),
        excitation[finite],
        _symmetric(infinite),
        method,
        stiffness,
        content.depth,
        content.density,
        content.gravity,
        float(content.directions[wave]),
        content.source,
        content.phase,
        tuple(content.volume[k] for k in kept),
        None if content.inertia is None else content.inertia[np.ix_(kept, kept)],
        content.inertia_source,
        tuple(content.centres[k] if content.centres else None for k in kept),
    )


def _ascending(content: BemContent) -> BemContent:
    """Return the content with frequencies that descend throughout, as over periods, turned."""
    if not np.all(np.diff(content.omega) < 0.0):
        return content
    return content._replace(
        omega=content.omega[::-1],
        added_mass=content.added_mass[::-1],
        damping=content.damping[::-1],
        excitation=content.excitation[::-1],
    )


def _check_symmetry(path: Path, field: str, values: Floats, names: Sequence[str]) -> None:
    """Raise ValueError where [i, j] and [j, i] differ: at rest the two are equal."""
    peak = np.abs(values).max(axis=0)
    scale = np.sqrt(np.outer(np.diag(peak), np.diag(peak)))
    gap = np.abs(values - values.swapaxes(1, 2)).max(axis=0)
    for i, j in np.argwhere(gap > MAX_ASYMMETRY * scale + 1.0e-9 * peak.max()):
        raise ValueError(
            f"{path}: {field} of ({names[i]}, {names[j]}) and ({names[j]}, {names[i]}) differ by "
            f"{gap[i, j] / max(scale[i, j], 1e-300):.1%} of their diagonals; allowed: "
            f"{MAX_ASYMMETRY:.0%} (is the body at rest, and the file complete?)"
        )


def _check_damping(
    path: Path, omega: Floats, damping: Floats, infinite: Floats, names: Sequence[str]
) -> None:
    """Raise ValueError for a mode with notable negative damping: waves only take energy away."""
    rounding = 1.0e-9 * np.abs(damping).max()
    for k, name in enumerate(names):
        own = damping[:, k, k]
        least = SMALL_DAMPING * omega * abs(infinite[k, k]) + rounding
        negative = float(own[own < -least].sum())
        if -negative > MAX_NEGATIVE * float(own[own > 0.0].sum()):
            worst = int(own.argmin())
            unit = "N*m*s" if rotates(name) else "N*s/m"
            raise ValueError(
                f"{path}: radiation damping of {name} is negative: {own[worst]:.4g} {unit} at "
                f"{omega[worst] / (2.0 * np.pi):.4g} Hz; waves only take energy away (is the sign "
                "of the file's damping reversed?)"
            )


def _symmetric(values: Floats) -> Floats:
    mean: Floats = 0.5 * (values + values.swapaxes(-1, -2))
    return mean


def _infinite(
    path: Path, content: BemContent, kept: list[int], omega: Floats, fields: dict[str, Floats]
) -> tuple[Floats, str]:
    """Return A_inf from the file or, where it has none, by Ogilvie's relation."""
    at_infinity = np.flatnonzero(np.isposinf(content.omega))
    infinite = content.infinite
    if infinite is None and at_infinity.size:
        infinite = content.added_mass[at_infinity[0]]
    if infinite is not None:
        infinite = infinite[np.ix_(kept, kept)]
        if not np.all(np.isfinite(infinite)):
            raise ValueError(f"{path}: added mass at infinite frequency is not finite")
        return infinite, "file"
    return ogilvie(omega, fields["added mass"], fields["damping"]), "Ogilvie's relation"


def ogilvie(omega: Floats, added_mass: Floats, damping: Floats) -> Floats:
    """Return A_inf = A(w) + 1/w int_0^inf K(t) sin(w t) dt, K(t) = 2/pi int_0^inf B cos(w t) dw.

    Mean over the upper half of the grid. B is zero at w = 0, and beyond the grid it falls with
    w^-4 from its last value. Source: T. F. Ogilvie, 5th Symposium on Naval Hydrodynamics, 1964.
    """
    last = omega[-1]
    fine = np.linspace(0.0, 4.0 * last, 4001)
    nodes = np.concatenate([[0.0], omega])
    values = np.concatenate([np.zeros((1, *damping.shape[1:])), damping])
    within = fine <= last
    spectrum = np.zeros((fine.size, *damping.shape[1:]))
    for i, j in np.ndindex(*damping.shape[1:]):
        spectrum[within, i, j] = np.interp(fine[within], nodes, values[:, i, j])
    spectrum[~within] = damping[-1] * ((last / fine[~within]) ** 4)[:, None, None]
    # Both integrals over t at once: int K sin(wt) dt / w = 2/pi PV int B(v) / (w2 - v2) dv, and
    # PV int dv / (w2 - v2) over the half axis is 0, so B(w) may be subtracted.
    estimates = []
    for k in np.flatnonzero(omega >= 0.5 * last)[:-1]:
        w = omega[k]
        gap = w * w - fine * fine
        regular = np.abs(gap) > 1.0e-9 * w * w
        integrand = np.zeros_like(spectrum)
        at_w = np.array([[np.interp(w, fine, spectrum[:, i, j]) for j in range(damping.shape[2])]
                         for i in range(damping.shape[1])])  # fmt: skip
        integrand[regular] = (spectrum - at_w)[regular] / gap[regular][:, None, None]
        tail = at_w * np.log((fine[-1] + w) / (fine[-1] - w)) / (2.0 * w)
        integral = np.trapezoid(integrand, fine, axis=0) + tail
        estimates.append(added_mass[k] + 2.0 / np.pi * integral)
    mean: Floats = np.mean(estimates, axis=0)
    return mean
