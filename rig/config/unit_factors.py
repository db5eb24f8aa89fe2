"""Factors between a unit that a file names and the unit that it should have, for error messages.

Files are in SI units, and no value is converted: a message says by which factor people convert it.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

_PREFIXES = {"": 1.0, "G": 1e9, "M": 1e6, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "µ": 1e-6}
_BASES: dict[str, tuple[float, dict[str, int]]] = {
    **{name: (1.0, {name: 1}) for name in ("m", "s", "A", "rad", "%", "counts")},
    "g": (1e-3, {"kg": 1}),
    "N": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "J": (1.0, {"kg": 1, "m": 2, "s": -2}),
    "W": (1.0, {"kg": 1, "m": 2, "s": -3}),
    "Pa": (1.0, {"kg": 1, "m": -1, "s": -2}),
    "Hz": (1.0, {"s": -1}),
    "V": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "ohm": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
    "H": (1.0, {"kg": 1, "m": 2, "s": -2, "A": -2}),
    "F": (1.0, {"kg": -1, "m": -2, "s": 4, "A": 2}),
    "C": (1.0, {"A": 1, "s": 1}),
}
_WHOLE: dict[str, tuple[float, dict[str, int]]] = {  # without prefixes
    "1": (1.0, {}),
    "deg": (math.pi / 180.0, {"rad": 1}),
    "rpm": (2.0 * math.pi / 60.0, {"rad": 1, "s": -1}),
    "t": (1e3, {"kg": 1}),
    "min": (60.0, {"s": 1}),
    "h": (3600.0, {"s": 1}),
    "in": (0.0254, {"m": 1}),
    "ft": (0.3048, {"m": 1}),
    "lbf": (4.4482216152605, {"kg": 1, "m": 1, "s": -2}),
    "kgf": (9.80665, {"kg": 1, "m": 1, "s": -2}),
}
_KEY_PARTS = {
    **{part.lower(): part for part in ("kN", "kW", "kV", "mm", "cm", "km", "ms", "kJ", "kHz")},
    **{part: part for part in ("deg", "rpm", "t", "min", "h", "in", "ft", "lbf", "kgf", "kg")},
    **{part.lower(): part for part in ("N", "m", "s", "A", "V", "W", "Hz", "rad", "ohm", "g")},
    **{f"{part}{n}": f"{part}^{n}" for part in ("m", "s", "mm", "cm", "rad") for n in (2, 3)},
}
"""Parts of a unit at the end of a key, which is in lower case."""
_FACTOR = re.compile(r"([*/]?)([A-Za-zµ%1]+?)(?:\^?(-?\d))?(?=[*/]|$)")


class _Unit(NamedTuple):
    factor: float  # to SI
    dimensions: dict[str, int]  # exponents of base units


def factor_note(unit: str, allowed: Iterable[str]) -> str:
    """Return how people write a value of a unit in one that is allowed; empty if none is alike.

    For example "write the value in N/m, 1 kN/m = 1000 N/m".
    """
    given = _parse(unit)
    for each in allowed if given is not None else ():
        known = _parse(each)
        if given is None or known is None or given.dimensions != known.dimensions:
            continue
        ratio = given.factor / known.factor
        if math.isclose(ratio, 1.0, rel_tol=1e-12):
            return f"write {each}" if each != unit else ""
        return f"write the value in {each}, 1 {unit} = {ratio:.10g} {each}"
    return ""


def key_note(key: str, known: Iterable[str]) -> str:
    """Return how a key with another unit is written; empty if no known key has its stem.

    For example "write spring_n_per_m, 1 kN/m = 1000 N/m".
    """
    for stem, unit in _splits(key):
        for each in known:
            for other, known_unit in _splits(each):
                if other == stem and (note := factor_note(unit, [known_unit])):
                    return f"write {each}, {note.partition(', ')[2]}" if ", " in note else ""
    return ""


def key_unit(key: str) -> str:
    """Return the unit at the end of a key, also with a prefix; empty without one."""
    return next((unit for _, unit in _splits(key)), "")


def si_unit(unit: str) -> str:
    """Return a unit without the prefixes of its parts, which are in SI: N*s/m of kN*s/mm."""

    def without_prefix(match: re.Match[str]) -> str:
        name = match[0]
        has_prefix = name not in {*_BASES, *_WHOLE, "kg"} and _single(name) is not None
        return "kg" if name == "g" else name[1:].replace("g", "kg") if has_prefix else name

    return re.sub(r"[A-Za-zµ%]+", without_prefix, unit)


def _splits(key: str) -> list[tuple[str, str]]:
    """Return stem and unit of a key, the longest unit first."""
    parts = key.split("_")
    return [
        ("_".join(parts[:start]), unit)
        for start in range(1, len(parts))
        if (unit := _joined(parts[start:]))
    ]


def _joined(parts: list[str]) -> str:
    """Return the unit of the last parts of a key; empty if they are none."""
    text, sign = "", ""
    for part in parts:
        if part == "per":
            sign = "/"
        elif part not in _KEY_PARTS:
            return ""
        else:
            text += (sign if text else "") + _KEY_PARTS[part]
            sign = "/" if "/" in text else "*"
    return text if parts[0] != "per" and parts[-1] != "per" else ""


def _parse(unit: str) -> _Unit | None:
    """Return the meaning of a unit; None for one that is not known."""
    text = unit.strip().replace("²", "^2").replace("³", "^3")
    text = re.sub(r"\s*[·*]\s*|\s+", "*", text)
    factor, dimensions, end = 1.0, Counter[str](), 0
    for match in _FACTOR.finditer(text):
        found = _single(match[2])
        if found is None or match.start() != end:
            return None
        power = int(match[3] or 1) * (-1 if match[1] == "/" else 1)
        factor *= found.factor**power
        for name, exponent in found.dimensions.items():
            dimensions[name] += power * exponent
        end = match.end()
    exponents = {name: exponent for name, exponent in dimensions.items() if exponent}
    return _Unit(factor, exponents) if text and end == len(text) else None


def _single(name: str) -> _Unit | None:
    if name in _WHOLE:
        return _Unit(*_WHOLE[name])
    if name in _BASES:
        return _Unit(*_BASES[name])
    if name[:1] in _PREFIXES and name[1:] in _BASES:
        base = _BASES[name[1:]]
        return _Unit(_PREFIXES[name[0]] * base[0], base[1])
    return None
