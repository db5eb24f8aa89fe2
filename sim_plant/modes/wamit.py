"""Readers of WAMIT's output: the formatted `.out`, or the numeric `.1`, `.3` and `.hst`.

WAMIT writes e^{+i omega t} and values without dimension, by the length scale L (ULEN):
A = A'/(rho L^k) and B = B'/(rho omega L^k), k = 3, 4 or 5 for 0, 1 or 2 rotations in (i, j);
X = X'/(rho g L^m) per metre of wave amplitude with m = 2 or 3; C = C'/(rho g L^k) with k = 2, 3, 4.
In the numeric files a period of 0 is an infinite frequency, one of -1 the frequency zero.
Source: WAMIT user manual 7.4, sections 3.1 to 3.3 and 5.2.

Modes 1 to 6 of body 1 are Surge to Yaw; with several bodies they are body1__Surge and so on.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim_plant.modes.bem_content import (
    PLUS,
    RIGID_MODES,
    BemContent,
    Complexes,
    Floats,
    Water,
    stated_water,
    text_lines,
)

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?"


class Entries(NamedTuple):
    """Dimensionless entries by angular frequency (rad/s) and number of the mode (from 1)."""

    added_mass: dict[tuple[float, int, int], float]
    damping: dict[tuple[float, int, int], float]
    force: dict[tuple[float, float, int], complex]  # by frequency, direction (degrees), mode
    stiffness: dict[tuple[int, int], float]


NUMERIC_SUFFIXES = (".1", ".3", ".hst")  # radiation, wave force, hydrostatic stiffness


def mode_names(count: int) -> tuple[str, ...]:
    """Return the names of the first `count` rigid modes of one or several bodies."""
    if count <= 6:
        return RIGID_MODES[:count]
    bodies = range(1, -(-count // 6) + 1)
    return tuple(f"body{body}__{mode}" for body in bodies for mode in RIGID_MODES)


def read_numeric(path: Path, water: Water) -> BemContent:
    """Return the content of `.1`, `.3` and, if it exists, `.hst`; `path` is any of them."""
    radiation, wave, hydrostatic = (path.with_suffix(suffix) for suffix in NUMERIC_SUFFIXES)
    for needed in (radiation, wave):
        if not needed.exists():
            raise ValueError(f"{path}: {needed.name} is missing; WAMIT's .1 and .3 are both needed")
    found = Entries({}, {}, {}, {})
    for line, row in _rows(radiation, (4, 5)):
        omega = _omega(line, row[0])
        key = (omega, _index(line, row[1]), _index(line, row[2]))
        _store(line, found.added_mass, key, row[3])
        if len(row) == 5:
            found.damping[key] = row[4]
        elif 0.0 < omega < math.inf:
            raise ValueError(f"{line}: the damping is missing")
    for line, row in _rows(wave, (7,)):
        _store(
            line,
            found.force,
            (_omega(line, row[0]), row[1], _index(line, row[2])),
            complex(*row[5:]),
        )
    if hydrostatic.exists():
        for line, row in _rows(hydrostatic, (3,)):
            found.stiffness[_index(line, row[0]), _index(line, row[1])] = row[2]
    return _content(path, found, water, Water(), WamitFile("WAMIT .1, .3 and .hst", []))


def read_out(path: Path, water: Water) -> BemContent:
    """Return the content of the formatted output file of one run."""
    lines = text_lines(path)
    volumes: list[float] = []
    found = Entries({}, {}, {}, {})
    gravity = length = depth = None
    section, omega, heading, body = "", math.nan, math.nan, 0
    haskind: dict[tuple[float, float, int], complex] = {}
    for number, line in enumerate(lines, 1):
        place = f"{path}:{number}"
        numbers = [float(n.replace("D", "E").replace("d", "e")) for n in _tokens(line)]
        if line.strip().startswith("Gravity:"):
            gravity, length = (*numbers, None, None)[:2]
        elif line.strip().startswith("Water depth:"):
            depth = numbers[0] if numbers else math.inf
        elif line.strip().startswith("Volumes (VOLX"):
            volumes.append(float(np.median(numbers)) if len(numbers) == 3 else 0.0)
        elif line.strip().startswith("C(") and ":" in line:
            entries = line[: line.index(":")].count("C(")
            first = int(line[line.index("C(") + 2])
            body += first == 3
            values = [float(n) for n in _tokens(line[line.index(":") :])]
            if len(values) != entries:
                raise ValueError(f"{place}: {entries} restoring coefficients expected")
            for k, value in enumerate(values):
                i, j = 6 * (body - 1) + first, 6 * (body - 1) + max(first, 3) + k
                found.stiffness[i, j] = value
                if j % 6 != 0:  # C(4,6) and C(5,6) have no mirror image
                    found.stiffness[j, i] = value
        elif "Wave period" in line and "=" in line:
            section, omega = "", _period(place, line)
        elif "ADDED-MASS" in line:
            section = "radiation"
        elif "EXCITING FORCES AND MOMENTS" in line:
            section = "haskind" if "HASKIND" in line else "force"
        elif "Wave Heading" in line:
            heading = numbers[-1]
        elif "****" in line or re.search("[A-Z]{4}", line):
            section = ""  # another table
        elif section == "radiation" and len(numbers) in (3, 4) and _starts_with_number(line):
            key = (omega, _index(place, numbers[0]), _index(place, numbers[1]))
            _store(place, found.added_mass, key, numbers[2])
            if len(numbers) == 4:
                found.damping[key] = numbers[3]
        elif section in ("force", "haskind") and len(numbers) == 3 and _starts_with_number(line):
            wave = numbers[1] * np.exp(1j * np.radians(numbers[2]))
            target = found.force if section == "force" else haskind
            _store(place, target, (omega, heading, _index(place, abs(numbers[0]))), complex(wave))
    for name, missing in (("Gravity", gravity is None), ("Water depth", depth is None)):
        if missing:
            raise ValueError(f"{path}: has no line '{name}:'; is it the output file of WAMIT?")
    if not found.force:
        found = found._replace(force=haskind)
    own = Water(None, gravity, depth, length)
    return _content(path, found, water, own, WamitFile("WAMIT .out", volumes))


def _tokens(line: str) -> list[str]:
    return re.findall(rf"(?<![\w.(,]){_NUMBER}(?![\w(,])", line)


def _starts_with_number(line: str) -> bool:
    return re.match(rf"\s*{_NUMBER}\s", line) is not None


def _rows(path: Path, lengths: tuple[int, ...]) -> list[tuple[str, list[float]]]:
    """Return the rows of numbers of a file, each with its place; a first line of text is left."""
    rows = []
    for number, line in enumerate(text_lines(path), 1):
        parts = line.replace("D", "E").split()
        if not parts:
            continue
        try:
            row = [float(part) for part in parts]
        except ValueError:
            if number == 1:
                continue  # the optional header
            raise ValueError(f"{path}:{number}: {line.strip()!r} are not numbers") from None
        if len(row) not in lengths:
            allowed = " or ".join(map(str, lengths))
            raise ValueError(f"{path}:{number}: has {len(row)} numbers, expected {allowed}")
        rows.append((f"{path}:{number}", row))
    return rows


def _omega(place: str, period: float) -> float:
    if period == 0.0:
        return math.inf
    if period == -1.0:
        return 0.0
    if not period > 0.0:
        raise ValueError(
            f"{place}: the period is {period:g} s; allowed: above 0, 0 for an infinite frequency, "
            "-1 for the frequency 0"
        )
    return 2.0 * math.pi / period


def _period(place: str, line: str) -> float:
    value = line.split("=")[1].split(maxsplit=1)[0]
    if value in ("infinite", "zero"):
        return 0.0 if value == "infinite" else math.inf
    if not re.fullmatch(_NUMBER, value):
        raise ValueError(f"{place}: {value!r} is not a wave period")
    return _omega(place, float(value))


def _index(place: str, value: float) -> int:
    if value != round(value) or not 1 <= value <= 600:
        raise ValueError(f"{place}: {value:g} is no mode; modes are numbered from 1")
    return int(value)


def _store(place: str, entries: dict, key: tuple, value: complex) -> None:  # type: ignore[type-arg]
    if key in entries:
        raise ValueError(f"{place}: the entry of this frequency and mode appears twice")
    entries[key] = value


class WamitFile(NamedTuple):
    """Format of a file, and the displaced volume of each body where it has them (m3)."""

    source: str
    volumes: list[float]


def _content(
    path: Path, found: Entries, water: Water, of_file: Water, file: WamitFile
) -> BemContent:
    """Return the entries as dimensional arrays on the ascending frequencies of the forces."""
    if not found.added_mass:
        raise ValueError(f"{path}: has no added mass")
    if not found.force:
        raise ValueError(f"{path}: has no exciting forces")
    density, gravity, depth = stated_water(path, of_file, water)
    length = _length_scale(path, of_file.length_scale, water.length_scale)
    modes = sorted({i for _, *pair in found.added_mass for i in pair})
    names = mode_names(-(-modes[-1] // 6) * 6)
    rotates = np.array([(mode - 1) % 6 > 2 for mode in modes], np.int64)
    rotations = rotates[:, None] + rotates[None, :]
    omega = np.array(sorted({key[0] for key in found.damping}))
    waves = {key[0] for key in found.force}
    for missing in sorted(set(omega) ^ waves)[:1]:
        field = "exciting force" if missing not in waves else "added mass and damping"
        raise ValueError(f"{path}: {field} is missing at {2.0 * math.pi / missing:g} s")
    directions = sorted({key[1] for key in found.force})
    for i, j in sorted({(i, j) for _, i, j in found.damping}):
        for w in omega.tolist():
            if (w, i, j) not in found.damping:
                period = 2.0 * math.pi / w
                raise ValueError(f"{path}: added mass and damping ({i}, {j}) miss at {period:g} s")
    place = {mode: k for k, mode in enumerate(modes)}
    added_mass, damping = np.zeros((2, omega.size, len(modes), len(modes)))
    row = {w: k for k, w in enumerate(omega.tolist())}
    infinite: Floats | None = None
    for (w, i, j), value in found.added_mass.items():
        if w == math.inf:
            infinite = np.zeros((len(modes), len(modes))) if infinite is None else infinite
            infinite[place[i], place[j]] = value
        elif w > 0.0:
            added_mass[row[w], place[i], place[j]] = value
            damping[row[w], place[i], place[j]] = found.damping[w, i, j]
    force: Complexes = np.full((omega.size, len(directions), len(modes)), np.nan, np.complex128)
    for (w, heading, i), wave in found.force.items():
        if i in place:
            force[row[w], directions.index(heading), place[i]] = wave
    mass_scale = density * length ** (3.0 + rotations)
    stiffness = None
    if found.stiffness:
        values = [[found.stiffness.get((i, j), 0.0) for j in modes] for i in modes]
        stiffness = np.array(values) * density * gravity * length ** (2.0 + rotations)
    return BemContent(
        tuple(names[mode - 1] for mode in modes),
        omega,
        added_mass * mass_scale,
        damping * mass_scale * omega[:, None, None],
        np.conj(force) * density * gravity * length ** (2.0 + rotates),
        np.array(directions),
        None if infinite is None else infinite * mass_scale,
        stiffness,
        depth,
        density,
        gravity,
        file.source,
        PLUS,
        tuple(_volume(file.volumes, mode) for mode in modes),
        scaling=f"normalised by density, gravity and a length of {length:g} m",
    )


def _volume(volumes: list[float], mode: int) -> float | None:
    """Return the displaced volume of the body of a numbered mode, None if not stated."""
    body = (mode - 1) // 6
    return volumes[body] if body < len(volumes) and volumes[body] > 0.0 else None


def _length_scale(path: Path, found: float | None, given: float | None) -> float:
    """Return ULEN, m: of the file, else the given one, else 1."""
    if found is not None and given is not None and not math.isclose(found, given, rel_tol=1e-6):
        raise ValueError(
            f"{path}: states length_scale_m {found:g} m, the plant file {given:g}; remove one"
        )
    length = found if given is None else given
    if length is not None and not length > 0.0:
        raise ValueError(f"{path}: length_scale_m is {length:g} m; allowed: above 0")
    return 1.0 if length is None else length
