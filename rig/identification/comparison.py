"""Comparison of two identifications, for example before and after a change of drive or spring.

Models are paired by axis, response and amplitude, at equal or nearest spring rate. A difference is
significant where the 95 % circles do not overlap: |Z_b - Z_a| > r_a + r_b.
"""

import json
import textwrap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.identification.frf import band_radius
from rig.identification.impedances import interpolate_impedance
from rig.identification.report import JSON, NOT_CONSTANTS, with_interval
from rig.presentation.json_values import json_value
from rig.recording.runs import RunError
from rig.regular_file import MAX_TABLE_BYTES, read_regular
from rig.spectra.periods import Complexes, Floats

AMPLITUDE_TOLERANCE = 0.1  # relative difference of amplitude up to which two models are a pair
RESPONSES = ("Z_i", "Z_id", "Z_d")


class SavedIdentification(NamedTuple):
    """An identification read from its file."""

    name: str
    content: dict[str, Any]


class Difference(NamedTuple):
    """One response of a pair of models, on their common lines."""

    response: str
    a: str  # names of the models
    b: str
    frequency: Floats  # Hz
    values_a: Complexes
    values_b: Complexes
    bands: tuple[Floats, Floats]  # 95 % radii
    share_apart: float  # share of lines whose bands do not overlap; NaN without bands
    median: float  # |Z_b - Z_a|/|Z_a|
    worst: float
    fits: tuple[dict[str, float], dict[str, float]]  # second-order fit of each; empty: none
    intervals: tuple[dict[str, float], dict[str, float]]  # 95 % half-widths; those that are known


class Comparison(NamedTuple):
    """Differences between two identifications."""

    a: str
    b: str
    modes: tuple[str, str]
    differences: tuple[Difference, ...]
    unpaired: tuple[str, ...]


def read_identification(path: Path) -> SavedIdentification:
    """Read an identification.json; raises RunError for any other file."""
    try:
        content = json.loads(read_regular(path, MAX_TABLE_BYTES))
    except (OSError, ValueError) as error:
        raise RunError(f"{path}: cannot be read: {error}") from None
    if not isinstance(content, dict) or "models" not in content:
        raise RunError(f"{path}: not an {JSON} written by rig identify")
    first, *more = content.get("runs", []) or [str(path)]
    return SavedIdentification(f"{first} and {len(more)} more" if more else first, content)


def compare(a: SavedIdentification, b: SavedIdentification) -> Comparison:
    """Compare all pairs of models; raises RunError if there is none."""
    differences: list[Difference] = []
    unpaired = []
    for model_a in a.content["models"]:
        spring_rate, peak = _spring_rate(model_a), model_a["peak_a"]
        candidates = [
            model
            for model in b.content["models"]
            if model["axis"] == model_a["axis"]
            and abs(model["peak_a"] - peak) <= AMPLITUDE_TOLERANCE * peak
        ]
        distances = [abs(_spring_rate(model) - spring_rate) for model in candidates]
        partner = candidates[int(np.argmin(distances))] if candidates else None
        if partner is None:
            unpaired.append(model_a["name"])
            continue
        differences += [
            _difference(name, model_a, partner)
            for name in RESPONSES
            if name in model_a["responses"] and name in partner["responses"]
        ]
    if not differences:
        raise RunError("the two identifications have no axis and amplitude in common")
    modes = (str(a.content.get("mode", "")), str(b.content.get("mode", "")))
    return Comparison(a.name, b.name, modes, tuple(differences), tuple(unpaired))


def _difference(name: str, a: dict[str, Any], b: dict[str, Any]) -> Difference:
    """Compare on the lines of ``a`` within the range of ``b``; interpolates ``b``."""
    frequency_a, frequency_b = np.array(a["frequency_hz"]), np.array(b["frequency_hz"])
    values_a, band_a = _values(a["responses"][name])
    values_b, band_b = _values(b["responses"][name])
    interpolated, common = interpolate_impedance(frequency_b, values_b, frequency_a)
    frequency, values_a, interpolated = frequency_a[common], values_a[common], interpolated[common]
    bands = (band_a[common], np.interp(frequency, frequency_b, band_b))
    distance = np.abs(interpolated - values_a)
    known = np.isfinite(bands[0]) & np.isfinite(bands[1])
    share_apart = (
        float(np.mean(distance[known] > (bands[0] + bands[1])[known])) if known.any() else np.nan
    )
    relative_distance = distance / np.abs(values_a)
    return Difference(
        name,
        a["name"],
        b["name"],
        frequency,
        values_a,
        interpolated,
        bands,
        share_apart,
        float(np.median(relative_distance)) if relative_distance.size else np.nan,
        float(relative_distance.max(initial=0.0)),
        (_second_order(a, name), _second_order(b, name)),
        (_intervals(a, name), _intervals(b, name)),
    )


def _values(response: dict[str, Any]) -> tuple[Complexes, Floats]:
    # A null of the file becomes NaN.
    real, imaginary, noise, total = (
        np.array(response[part], dtype=np.float64)
        for part in ("re", "im", "noise_band", "total_band")
    )
    systematic, rounding = (  # runs before 2027 have none
        np.array(response.get(part, 0.0), dtype=np.float64)
        for part in ("systematic_band", "rounding_band")
    )
    return real + 1j * imaginary, band_radius(noise, total, systematic, rounding)


def _spring_rate(model: dict[str, Any]) -> float:
    """Return the spring rate of a model; its key ends with the unit of the axis."""
    return float(next(value for key, value in model.items() if key.startswith("spring_")))


def _second_order(model: dict[str, Any], name: str) -> dict[str, float]:
    fits = model["fits"].get(name, [])
    names = ("mass_", "damping_", "stiffness_", "natural_frequency_")
    return (
        {key: float(value) for key, value in fits[0].items() if key.startswith(names)}
        if fits
        else {}
    )


def _intervals(model: dict[str, Any], name: str) -> dict[str, float]:
    """Return the known half-widths of the second-order fit; files before 2027 have none."""
    fits = model["fits"].get(name, [])
    found = fits[0].get("intervals_95", {}) if fits else {}
    return {key: float(value) for key, value in found.items() if value is not None}


def as_dict(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison as JSON values."""
    content: dict[str, Any] = json_value(
        {
            "a": comparison.a,
            "b": comparison.b,
            "unpaired": comparison.unpaired,
            "differences": [
                {
                    "response": difference.response,
                    "a": difference.a,
                    "b": difference.b,
                    "lines": int(difference.frequency.size),
                    "median": difference.median,
                    "worst": difference.worst,
                    "share_of_lines_apart": difference.share_apart,
                    "second_order": {"a": difference.fits[0], "b": difference.fits[1]},
                    "intervals_95": {"a": difference.intervals[0], "b": difference.intervals[1]},
                }
                for difference in comparison.differences
            ],
        }
    )
    return content


def as_text(comparison: Comparison) -> str:
    """Return a text report: one line per pair, and the changes of the second-order fits."""
    lines = [f"A  {comparison.a}", f"B  {comparison.b}", ""]
    for difference in comparison.differences:
        bands_text = (
            "bands unknown"
            if np.isnan(difference.share_apart)
            else f"bands separate on {100 * difference.share_apart:.0f} % of lines"
        )
        lines.append(
            f"{difference.response:4} {difference.a}  ->  {difference.b}: "
            f"median {100 * difference.median:.2g} %, worst {100 * difference.worst:.2g} %, "
            f"{bands_text}"
        )
        if difference.fits[0] and difference.fits[1]:
            changes = (
                f"{key.split('_', maxsplit=1)[0]} " + " -> ".join(_shown(difference, key))
                for key in difference.fits[0]
            )
            lines.append("     " + ", ".join(changes))
    if any(difference.fits[0] and difference.fits[1] for difference in comparison.differences):
        lines += textwrap.wrap(NOT_CONSTANTS, 98)
    lines += [f"!! {name} of A has no matching model in B" for name in comparison.unpaired]
    return "\n".join(lines)


def _shown(difference: Difference, key: str) -> list[str]:
    """Return a number of both fits as text; all but the natural frequency have intervals."""
    if key.startswith("natural_frequency_"):
        return [f"{fit[key]:.4g}" for fit in difference.fits]
    pairs = zip(difference.fits, difference.intervals, strict=True)
    return [with_interval(fit[key], known.get(key, np.nan)) for fit, known in pairs]
