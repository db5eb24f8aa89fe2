"""Reader of the folder of a Nemoh run, versions 2 and 3: `Nemoh.cal`, `results`, `mesh`.

`results/RadiationCoefficients.tec` has a block of rows for each motion, `ExcitationForce.tec` one
for each wave direction; a row is the frequency and two numbers for each force: added mass and
damping, or modulus and phase (rad). Values are dimensional, phases those of e^{-i omega t}. The
frequency may be rad/s, Hz or s: the numbers of `Nemoh.cal` decide. Stiffness comes from
`Mechanics/Kh.dat` (version 3) or `mesh/KH.dat`, inertia from `Mechanics/Inertia.dat` or
`mesh/Inertia_hull.dat`, the volume from `mesh/Hydrostatics.dat`; several bodies have `KH_0.dat`,
`KH_1.dat` and so on. Source: Nemoh 3 manual (inputs and outputs); files of versions 2.3 and 3.0.2.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim_plant.modes.bem_content import (
    MINUS,
    RIGID_MODES,
    BemContent,
    Complexes,
    Floats,
    Water,
    body_of,
    stated_water,
    text_lines,
)

CAL = "Nemoh.cal"
TEXTS = ("results/RadiationCoefficients.tec", "results/ExcitationForce.tec")
HYDROSTATIC = ("mechanics/kh.dat", "mechanics/inertia.dat", "mesh/hydrostatics*.dat",
               "mesh/kh*.dat", "mesh/inertia_hull*.dat")  # fmt: skip
SAME = 2.0e-4  # relative: the results are written with seven digits of single precision
_NUMBER = re.compile(
    r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?|[-+]?nan|[-+]?inf", re.IGNORECASE
)


class Case(NamedTuple):
    """The content of `Nemoh.cal`."""

    water: Water
    modes: tuple[str, ...]
    bodies: int
    frequencies: Floats  # as they are given
    unit: int  # of the frequencies: 1 rad/s, 2 Hz, 3 s
    directions: Floats  # degrees


def cal_path(path: Path) -> Path:
    """Return the path of `Nemoh.cal` for a folder, else the path itself."""
    return path / CAL if path.is_dir() else path


def files(path: Path) -> tuple[Path, ...]:
    """Return the existing files of a run that `read` reads."""
    cal = cal_path(path)
    others = (*TEXTS, *HYDROSTATIC)
    return (cal, *(file for name in others for file in _matching(cal.parent, name)))


def read(path: Path, water: Water) -> BemContent:
    """Return the content of a folder, or of the folder of a `Nemoh.cal`."""
    cal = cal_path(path)
    case = _read_cal(cal)
    density, gravity, depth = stated_water(cal, case.water, water)
    radiation, force = (_one_file(cal, name) for name in TEXTS)
    count = len(case.modes)
    # Blocks are motions, the columns of a row forces.
    blocks = _blocks(radiation, count, case.frequencies.size, 2 * count)
    waves = _blocks(force, case.directions.size, case.frequencies.size, 2 * count)
    omega = _omega(radiation, case, blocks[0][:, 0])
    for k, block in enumerate((*blocks, *waves)):
        if not np.allclose(block[:, 0], blocks[0][:, 0], rtol=SAME, equal_nan=True):
            name = (radiation if k < count else force).name
            raise ValueError(f"{cal.parent / name}: the blocks have different frequencies")
    matrices = np.array(blocks)[:, :, 1:]  # (motion, frequency, 2 * force)
    wave = np.array(waves)[:, :, 1:]
    excitation: Complexes = wave[:, :, 0::2] * np.exp(1j * wave[:, :, 1::2])
    order = np.argsort(omega)
    inertia, source = _inertia(cal, case)
    return BemContent(
        case.modes,
        omega[order],
        matrices[:, order, 0::2].transpose(1, 2, 0),
        matrices[:, order, 1::2].transpose(1, 2, 0),
        excitation[:, order].transpose(1, 0, 2),
        case.directions,
        None,
        _rigid_matrix(cal, case, "mechanics/kh.dat", "mesh/kh"),
        depth,
        density,
        gravity,
        "Nemoh",
        MINUS,
        _volumes(cal, case),
        inertia,
        source,
    )


def _matching(folder: Path, name: str) -> list[Path]:
    """Return the files of a name in a folder, whatever the case of its letters, in order."""
    pattern = re.compile(re.escape(name).replace(r"\*", r"[^/]*"), re.IGNORECASE)
    inside = sorted(folder.glob("*/*"))
    return [file for file in inside if pattern.fullmatch(file.relative_to(folder).as_posix())]


def _one_file(cal: Path, name: str) -> Path:
    found = _matching(cal.parent, name)
    if len(found) != 1:
        what = "has no" if not found else f"has {len(found)} times"
        raise ValueError(f"{cal}: its folder {what} {name}")
    return found[0]


def _read_cal(path: Path) -> Case:
    """Return the case; its lines are numbers in a fixed order, between lines of dashes."""
    lines = [(n, line) for n, line in enumerate(text_lines(path), 1) if line.strip()]
    left = iter([(n, line) for n, line in lines if not line.lstrip().startswith("--")])

    def numbers(what: str, least: int = 1) -> list[float]:
        number, line = next(left, (len(lines), ""))
        found = []
        for token in line.partition("!")[0].split():
            if not _NUMBER.fullmatch(token):
                break
            found.append(float(token.replace("D", "E").replace("d", "e")))
        if len(found) < least:
            raise ValueError(f"{path}:{number}: {what} expected, found {line.strip()!r}")
        return found

    density, gravity = numbers("density")[0], numbers("gravity")[0]
    depth = numbers("water depth")[0]
    place = numbers("wave measurement point", 2)[:2]
    if any(place):
        raise ValueError(
            f"{path}: the wave measurement point is ({place[0]:g}, {place[1]:g}) m; allowed: (0, 0)"
        )
    bodies = int(numbers("number of bodies")[0])
    if not 1 <= bodies <= 100:
        raise ValueError(f"{path}: has {bodies} bodies; allowed: 1 .. 100")
    modes: list[str] = []
    for body in range(1, bodies + 1):
        next(left, None)  # mesh file
        numbers("number of points and panels")
        count = int(numbers("number of degrees of freedom")[0])
        motions = [tuple(numbers("degree of freedom", 4)[:7]) for _ in range(count)]
        count = int(numbers("number of generalised forces")[0])
        forces = [tuple(numbers("generalised force", 4)[:7]) for _ in range(count)]
        for _ in range(int(numbers("number of additional lines")[0])):
            next(left, None)
        if motions != forces:
            raise ValueError(
                f"{path}: body {body} has {len(motions)} degrees of freedom and {len(forces)} "
                "forces that are not along them; both lists must be the same"
            )
        prefix = f"body{body}__" if bodies > 1 else ""
        modes += [prefix + _mode_name(motion, k) for k, motion in enumerate(motions, 1)]
    wave = numbers("number of wave frequencies", 3)
    unit = 1 if len(wave) == 3 else int(wave[0])
    size, low, high = wave[-3:] if len(wave) == 3 else wave[1:4]
    if unit not in (1, 2, 3) or not 1 <= size <= 1e5:
        raise ValueError(
            f"{path}: load cases {wave} are no unit (1, 2, 3), number, minimum, maximum"
        )
    heading = numbers("number of wave directions", 3)
    return Case(
        Water(density, gravity, math.inf if depth == 0.0 else depth),
        tuple(modes),
        bodies,
        np.linspace(low, high, int(size)),
        unit,
        np.linspace(heading[1], heading[2], int(heading[0])),
    )


def _mode_name(motion: tuple[float, ...], number: int) -> str:
    """Return the rigid mode of a translation (1) or rotation (2) along an axis, else its number."""
    kind, direction = motion[0], list(motion[1:4])
    for axis in range(3):
        if kind in (1.0, 2.0) and direction == [float(k == axis) for k in range(3)]:
            return RIGID_MODES[axis + (3 if kind == 2.0 else 0)]
    return f"mode{number}"


def _blocks(path: Path, blocks: int, rows: int, values: int) -> list[Floats]:
    """Return the blocks of rows of numbers between lines of text."""
    found: list[list[list[float]]] = []
    inside = False
    for number, line in enumerate(text_lines(path), 1):
        tokens = line.split()
        if not tokens:
            continue
        if not _NUMBER.fullmatch(tokens[0]):
            inside = False
            continue
        try:
            row = [float(token.replace("D", "E").replace("d", "e")) for token in tokens]
        except ValueError:
            raise ValueError(f"{path}:{number}: {line.strip()[:60]!r} are not numbers") from None
        if len(row) != values + 1:
            raise ValueError(
                f"{path}:{number}: has {len(row)} numbers, expected {values + 1}: the frequency "
                f"and two for each of {values // 2} forces of {CAL}"
            )
        if not inside:
            found.append([])
        inside = True
        found[-1].append(row)
    if [len(block) for block in found] != [rows] * blocks:
        lengths = ", ".join(str(len(block)) for block in found) or "none"
        raise ValueError(
            f"{path}: has blocks of {lengths} rows; {CAL} has {blocks} blocks of {rows} frequencies"
        )
    return [np.array(block) for block in found]


def _omega(path: Path, case: Case, column: Floats) -> Floats:
    """Return the angular frequencies of the results, in whichever unit they are written."""
    with np.errstate(divide="ignore"):
        expected = (
            case.frequencies,
            2.0 * np.pi * case.frequencies,
            2.0 * np.pi / case.frequencies,
        )[case.unit - 1]
        units = {"rad/s": expected, "Hz": expected / (2.0 * np.pi), "s": 2.0 * np.pi / expected}
    for values in units.values():
        if np.allclose(column, values, rtol=SAME):
            return expected
    raise ValueError(
        f"{path}: its frequencies {column[0]:g} .. {column[-1]:g} are those of {CAL}, "
        f"{expected[0]:g} .. {expected[-1]:g} rad/s, in none of the units rad/s, Hz, s"
    )


def _rigid_matrix(cal: Path, case: Case, whole: str, parts: str) -> Floats | None:
    """Return a matrix of the case's modes from one file for all bodies, or from one for each."""
    found = _matching(cal.parent, whole)
    if found:
        return _chosen(found[0], _table(found[0], 6 * case.bodies), case)
    names = (
        [f"{parts}.dat"] if case.bodies == 1 else [f"{parts}_{k}.dat" for k in range(case.bodies)]
    )
    files_found = [file for name in names for file in _matching(cal.parent, name)]
    if len(files_found) != case.bodies:
        return None
    total = np.zeros((6 * case.bodies, 6 * case.bodies))
    for k, file in enumerate(files_found):
        total[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = _table(file, 6)
    return _chosen(files_found[0], total, case)


def _chosen(path: Path, matrix: Floats, case: Case) -> Floats:
    """Return the rows and columns of the case's modes out of six for each body."""
    places = []
    for mode in case.modes:
        body = int(body_of(mode)[4:] or 1)
        name = mode.rpartition("__")[2]
        if name not in RIGID_MODES:
            raise ValueError(f"{path}: has no row of {mode}, which is no motion along an axis")
        places.append(6 * (body - 1) + RIGID_MODES.index(name))
    return matrix[np.ix_(places, places)]


def _table(path: Path, size: int) -> Floats:
    rows = [line.split() for line in text_lines(path) if line.strip()]
    try:
        table = np.array([[float(each) for each in row] for row in rows])
    except ValueError:
        table = np.zeros((0, 0))
    if table.shape != (size, size):
        raise ValueError(f"{path}: is no matrix of {size} x {size} numbers")
    return table


def _inertia(cal: Path, case: Case) -> tuple[Floats | None, str]:
    """Return the inertia of the modes (NaN: not stated), and its source."""
    whole = _matching(cal.parent, "mechanics/inertia.dat")
    if whole:
        return _chosen(whole[0], _table(whole[0], 6 * case.bodies), case), "Mechanics/Inertia.dat"
    hull = _matching(cal.parent, "mesh/inertia_hull.dat")
    if not hull or case.bodies > 1:
        return None, ""
    matrix = np.full((6, 6), np.nan)
    matrix[3:, 3:] = _table(hull[0], 3)
    return _chosen(hull[0], matrix, case), "Inertia_hull.dat: mass spread evenly over the hull"


def _volumes(cal: Path, case: Case) -> tuple[float | None, ...]:
    """Return the displaced volume of each mode's body, m3."""
    volumes: list[float | None] = []
    for body in range(case.bodies):
        name = "mesh/hydrostatics.dat" if case.bodies == 1 else f"mesh/hydrostatics_{body}.dat"
        text = "\n".join(line for file in _matching(cal.parent, name) for line in text_lines(file))
        found = re.search(r"Displacement\s*=\s*(\S+)", text)
        volumes.append(float(found[1]) if found and float(found[1]) > 0.0 else None)
    return tuple(volumes[int(body_of(mode)[4:] or 1) - 1] for mode in case.modes)
