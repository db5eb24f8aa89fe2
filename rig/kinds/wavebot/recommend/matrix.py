"""The next gain matrix: the most informative rows, and the campaign file that runs them.

The first row is the best setting for the chosen station. Points around it on each axis follow, at
the distance where power is worse by about the uncertainty of the prediction; so the rows show the
sides of the valley and move closer as measurements accumulate. The optima of other stations and
laws come next, and corners around the best setting fill the remaining rows.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.config.yaml_source import load_mapping
from rig.kinds.wavebot.campaign.stability import largest_ki
from rig.kinds.wavebot.recommend.search import Optimum, SearchSpace, best_with_spring
from rig.kinds.wavebot.recommend.set_points import Gains, SetPointPrediction, SetPointPredictor
from rig.stations import Station

MIN_RISE = 0.5  # W, smallest rise of power from the best setting to the points around it
MAX_RISE = 4.0  # W, largest rise
MIN_SPACING = (20.0, 20.0, 20.0)  # N s/m, N/m, N/m: closer settings are merged into one row
_MAX_DISTANCE = (0.5, 4000.0, 4000.0)  # log Kp, N/m, N/m: of a point around the best
_AXES = ("damping", "Ki", "spring rate")
_RESOLUTION = 10.0  # N s/m, N/m: step to which gains are rounded
FORMS = ("grid", "csv", "list")
_KEYS = ("spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m")


class RecommendedRow(NamedTuple):
    """A row of the recommended matrix and the reason for it."""

    prediction: SetPointPrediction
    reason: str


def choose_rows(
    predictor: SetPointPredictor,
    space: SearchSpace,
    optima: Sequence[Optimum],
    station: Station,
    max_rows: int,
) -> list[RecommendedRow]:
    """Return the rows for a station, the best first; the optima must have intervals."""
    candidates: dict[Gains, str] = {}
    for gains, reason in _candidates(predictor.quick, space, optima, station):
        rounded = _rounded(gains, space)
        if not any(_is_same_row(rounded, other) for other in candidates):
            candidates[rounded] = reason
    pairs = zip(predictor.predict(list(candidates)), candidates.values(), strict=True)
    rows = [RecommendedRow(prediction, reason) for prediction, reason in pairs]
    return [row for row in rows if row.prediction.allowed][:max_rows]


def _candidates(
    predictor: SetPointPredictor,
    space: SearchSpace,
    optima: Sequence[Optimum],
    station: Station,
) -> Iterator[tuple[Gains, str]]:
    best = best_with_spring(optima, station)
    name = f"{station.name_in_text} power"
    yield best.gains, f"best {name}"
    rise = min(max(best.half_width[station.name], MIN_RISE), MAX_RISE)
    distances = [_distance(predictor, space, best.gains, station, axis, rise) for axis in range(3)]
    middle = space.to_coordinates(best.gains)
    for axis, step in enumerate(np.diag(distances)):
        for sign, more in ((1.0, "more"), (-1.0, "less")):
            yield space.to_gains(middle + sign * step), f"around it: {more} {_AXES[axis]}"
    for optimum in optima:
        if optimum.law == "PI and spring" and optimum.station != station:
            yield optimum.best.gains, f"best {optimum.station.name_in_text} power"
    for optimum in optima:
        if optimum.law != "PI and spring" and optimum.station == station:
            yield optimum.best.gains, f"best {name} with {optimum.law} alone"
    for corner in product((1.0, -1.0), repeat=3):
        offset = 0.7 * np.array(corner) * distances
        yield space.to_gains(middle + offset), "corner around the best"


def _distance(
    predictor: SetPointPredictor,
    space: SearchSpace,
    best: Gains,
    station: Station,
    axis: int,
    rise: float,
) -> float:
    """Return the distance along an axis at which a station's power is worse by ``rise`` (W)."""
    middle, step = space.to_coordinates(best), np.zeros(3)
    step[axis] = 0.5 * _MAX_DISTANCE[axis]
    places = [space.to_gains(middle + sign * step) for sign in (0.0, 1.0, -1.0)]
    centre, *sides = (one.power(station) for one in predictor.predict(places))
    curvature = max(float(np.mean(sides)) - centre, 1e-3) / (0.25 * _MAX_DISTANCE[axis] ** 2)
    return min(float(np.sqrt(rise / curvature)), _MAX_DISTANCE[axis])


def _rounded(gains: Gains, space: SearchSpace) -> Gains:
    """Return rounded gains within the rig's spring map and its stability limit."""
    kp, ki, rate = (_RESOLUTION * round(each / _RESOLUTION) for each in gains)
    low, high = space.spring
    rate = min(max(rate, low), high)
    max_ki = largest_ki(space.rig.stability, rate)
    return Gains(kp, min(ki, _RESOLUTION * float(np.floor(max_ki / _RESOLUTION))), rate)


def _is_same_row(one: Gains, other: Gains) -> bool:
    differences = zip(one, other, MIN_SPACING, strict=True)
    return all(abs(a - b) < spacing for a, b, spacing in differences)


def campaign_text(
    path: Path,
    base: Path,
    name: str,
    header: Sequence[str],
    comments: Mapping[Gains, str],
) -> str:
    """Return the text of a campaign file that extends ``base`` with another matrix.

    ``path`` is the path of the new file, ``header`` its comment lines at the top. The matrix has
    the gains of ``comments``, each with its comment.
    """
    mapping, _ = load_mapping(base, inline=("sea",))
    inherited = mapping.get("matrix") or {}
    text_lines = [f"# {line}" for line in header]
    text_lines += [
        f"extends: {os.path.relpath(base.resolve(), path.resolve().parent)}",
        f"name: {name}",
        "repeat: 1",
        "order: fewest spring moves",
        "matrix:",
        *(f"  {form}:" for form in FORMS[:2] if form in inherited),
        "  list:",
    ]
    settings = {_flow_mapping(gains, inherited): text for gains, text in comments.items()}
    widest = max(map(len, settings))
    text_lines += [f"    - {text:<{widest}}  # {comment}" for text, comment in settings.items()]
    return "\n".join(text_lines) + "\n"


def _flow_mapping(gains: Gains, inherited: dict[str, Any]) -> str:
    values = (gains.spring_rate, gains.kp, gains.ki)
    pairs = dict(zip(_KEYS, values, strict=True)) | _other_columns(inherited)
    return "{" + ", ".join(f"{key}: {value:.10g}" for key, value in pairs.items()) + "}"


def _other_columns(inherited: dict[str, Any]) -> dict[str, float]:
    """Return the columns other than gains and spring, with the values of the base's first row."""
    rows = inherited.get("list") or inherited.get("grid") or [{}]
    columns: dict[str, float] = {}
    for key, value in rows[0].items():
        if key in _KEYS:
            continue
        first = value["from"] if isinstance(value, dict) else value
        columns[key] = float(first[0] if isinstance(first, list) else first)
    return columns
