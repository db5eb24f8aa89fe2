"""Two identifications side by side: before and after a change of drive or of spring.

Models are paired by axis, response and amplitude, at one spring rate where both have it and else at
the nearest. A difference counts where the 95 % circles of both are apart: |Z_b - Z_a| > r_a + r_b.
"""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.identification.periods import Complexes, Floats
from rig.identification.report import JSON
from rig.recording.runs import RunError
from rig.regular_file import MAX_TABLE_BYTES, read_regular

NEAR = 0.1  # of the amplitude: farther apart, two models are no pair
RESPONSES = ("Z_i", "Z_id", "Z_d")


class SavedIdentification(NamedTuple):
    """An identification as its file says."""

    name: str
    content: dict[str, Any]


class Difference(NamedTuple):
    """One response of a pair of models, on the lines that both have."""

    response: str
    a: str  # names of the models
    b: str
    frequency: Floats  # Hz
    one: Complexes
    other: Complexes
    bands: tuple[Floats, Floats]  # 95 % radii
    apart: float  # share of lines whose bands are apart; NaN where no band is known
    median: float  # |Z_b - Z_a|/|Z_a|
    worst: float
    fits: tuple[dict[str, float], dict[str, float]]  # second order of each; empty: none


class Comparison(NamedTuple):
    """What differs between two identifications."""

    a: str
    b: str
    modes: tuple[str, str]
    differences: tuple[Difference, ...]
    unpaired: tuple[str, ...]


def read(path: Path) -> SavedIdentification:
    """An identification.json; RunError where it is none."""
    try:
        content = json.loads(read_regular(path, MAX_TABLE_BYTES))
    except (OSError, ValueError) as error:
        raise RunError(f"{path}: cannot be read: {error}") from None
    if not isinstance(content, dict) or "models" not in content:
        raise RunError(f"{path}: no {JSON} of rig identify")
    first, *more = content.get("runs", []) or [str(path)]
    return SavedIdentification(f"{first} and {len(more)} more" if more else first, content)


def compare(a: SavedIdentification, b: SavedIdentification) -> Comparison:
    """All pairs of models; RunError where there is none."""
    found: list[Difference] = []
    unpaired = []
    others = b.content["models"]
    for model in a.content["models"]:
        same = [
            each
            for each in others
            if each["axis"] == model["axis"]
            and abs(each["peak_a"] - model["peak_a"]) <= NEAR * model["peak_a"]
        ]
        near = min(
            same,
            key=lambda each: abs(each["spring_n_per_m"] - model["spring_n_per_m"]),
            default=None,
        )
        if near is None:
            unpaired.append(model["name"])
            continue
        found += [
            _difference(name, model, near)
            for name in RESPONSES
            if name in model["responses"] and name in near["responses"]
        ]
    if not found:
        raise RunError("the two identifications have no axis and amplitude in common")
    modes = (str(a.content.get("mode", "")), str(b.content.get("mode", "")))
    return Comparison(a.name, b.name, modes, tuple(found), tuple(unpaired))


def _difference(name: str, a: dict[str, Any], b: dict[str, Any]) -> Difference:
    """On the lines of ``a`` that lie within those of ``b``, whose values are put between lines."""
    own, there = np.array(a["frequency_hz"]), np.array(b["frequency_hz"])
    slack = 1e-9
    kept = (own >= there[0] * (1 - slack)) & (own <= there[-1] * (1 + slack))
    frequency = own[kept]
    one, first = _values(a["responses"][name])
    two, second = _values(b["responses"][name])
    # omega Im Z lies on a line, Im Z does not.
    other = np.interp(frequency, there, two.real) + 1j * (
        np.interp(frequency, there, two.imag * there) / frequency
    )
    bands = (first[kept], np.interp(frequency, there, second))
    off = np.abs(other - one[kept])
    told = np.isfinite(bands[0]) & np.isfinite(bands[1])
    apart = float(np.mean(off[told] > (bands[0] + bands[1])[told])) if told.any() else np.nan
    share = off / np.abs(one[kept])
    return Difference(
        name,
        a["name"],
        b["name"],
        frequency,
        np.asarray(one[kept], dtype=np.complex128),
        np.asarray(other, dtype=np.complex128),
        bands,
        apart,
        float(np.median(share)) if share.size else np.nan,
        float(share.max(initial=0.0)),
        (_second_order(a, name), _second_order(b, name)),
    )


def _values(told: dict[str, Any]) -> tuple[Complexes, Floats]:
    value = np.array(told["re"], dtype=np.float64) + 1j * np.array(told["im"], dtype=np.float64)
    noise = np.array(told["noise_band"], dtype=np.float64)  # null becomes NaN
    total = np.array(told["total_band"], dtype=np.float64)
    return value, np.where(np.isfinite(noise), noise, total)


def _second_order(model: dict[str, Any], name: str) -> dict[str, float]:
    fits = model["fits"].get(name, [])
    keys = ("mass_kg", "damping_n_s_per_m", "stiffness_n_per_m", "natural_frequency_hz")
    return {key: float(fits[0][key]) for key in keys} if fits else {}


def as_dict(told: Comparison) -> dict[str, Any]:
    """All of it as JSON values."""
    return {
        "a": told.a,
        "b": told.b,
        "unpaired": list(told.unpaired),
        "differences": [
            {
                "response": d.response,
                "a": d.a,
                "b": d.b,
                "lines": int(d.frequency.size),
                "median": _number(d.median),
                "worst": _number(d.worst),
                "share_of_lines_apart": _number(d.apart),
                "second_order": {"a": d.fits[0], "b": d.fits[1]},
            }
            for d in told.differences
        ],
    }


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def as_text(told: Comparison) -> str:
    """For people: a line for each pair, and the numbers of the second order."""
    lines = [f"A  {told.a}", f"B  {told.b}", ""]
    for d in told.differences:
        apart = "bands unknown" if np.isnan(d.apart) else f"{100 * d.apart:.0f} % of lines apart"
        lines.append(
            f"{d.response:4} {d.a}  ->  {d.b}: median {100 * d.median:.2g} %, "
            f"worst {100 * d.worst:.2g} %, {apart}"
        )
        if d.fits[0] and d.fits[1]:
            words = (
                f"{key.split('_', maxsplit=1)[0]} {d.fits[0][key]:.4g} -> {d.fits[1][key]:.4g}"
                for key in d.fits[0]
            )
            lines.append("     " + ", ".join(words))
    lines += [f"!! {name} of A has no pair in B" for name in told.unpaired]
    return "\n".join(lines)


def write(told: Comparison, folder: Path) -> list[Path]:
    """``identification_compared.json`` and a picture of it."""
    from rig.identification.pictures import write_comparison  # noqa: PLC0415  (matplotlib)

    path = folder / "identification_compared.json"
    path.write_text(json.dumps(as_dict(told), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return [path, write_comparison(told, folder / "identification_compared.png")]
