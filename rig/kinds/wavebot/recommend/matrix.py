"""The next gain matrix: the most informative rows, and the campaign file that runs them.

The first row is the best setting for the chosen station. Points around it on each axis follow, at
the distance where power is worse by about the uncertainty of the prediction; so the rows show the
sides of the valley and move closer as measurements accumulate. The optima of other stations and
laws come next, and corners around the best setting fill the remaining rows.
"""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.config.yaml_source import load_mapping
from rig.kinds.wavebot.recommend.search import Optimum, SearchSpace
from rig.kinds.wavebot.recommend.trial import Gains, SetPointPrediction, SetPointPredictor
from rig.planning.campaign.stability import largest_ki
from rig.stations import Station

MIN_RISE = 0.5  # W, smallest rise of power from the best setting to the points around it
MAX_RISE = 4.0  # W, largest rise
MIN_SPACING = (20.0, 20.0, 20.0)  # N s/m, N/m, N/m: closer settings are merged into one row
_MAX_DISTANCE = (
    0.5,
    4000.0,
    4000.0,
)  # log Kp, N/m, N/m: largest distance of a point around the best
_RESOLUTION = 10.0  # N s/m, N/m: step to which gains are rounded
FORMS = ("grid", "csv", "list")


class MatrixOptions(NamedTuple):
    """Options of the matrix."""

    space: SearchSpace
    station: Station
    max_rows: int


class RecommendedRow(NamedTuple):
    """A row of the recommended matrix and the reason for it."""

    prediction: SetPointPrediction
    reason: str


def choose_rows(
    predictor: SetPointPredictor,
    quick_predictor: SetPointPredictor,
    optima: Sequence[Optimum],
    options: MatrixOptions,
    half_width: float,
) -> list[RecommendedRow]:
    """Return the rows, the best first.

    ``half_width`` (W) is that of the confidence interval at the best setting.
    """
    space, station, max_rows = options
    best = next(
        optimum
        for optimum in optima
        if optimum.station == station and optimum.law == "PI and spring"
    ).best
    rise = min(max(half_width, MIN_RISE), MAX_RISE)
    candidates: dict[Gains, str] = {}
    for gains, reason in _candidates(quick_predictor, space, optima, best, station, rise):
        rounded = _rounded(gains, space)
        if not any(_is_same_row(rounded, other) for other in candidates):
            candidates[rounded] = reason
    pairs = zip(predictor.predict(list(candidates)), candidates.values(), strict=True)
    return [
        RecommendedRow(prediction, reason) for prediction, reason in pairs if prediction.allowed
    ][:max_rows]


def _candidates(
    quick_predictor: SetPointPredictor,
    space: SearchSpace,
    optima: Sequence[Optimum],
    best: SetPointPrediction,
    station: Station,
    rise: float,
) -> Iterator[tuple[Gains, str]]:
    name = f"{station.name_in_text} power"
    yield best.gains, f"best {name}"
    distances = [
        _distance(quick_predictor, space, best.gains, station, axis, rise) for axis in range(3)
    ]
    middle = space.to_coordinates(best.gains)
    for axis, step in enumerate(distances):
        for sign in (1.0, -1.0):
            place = middle.copy()
            place[axis] += sign * step
            yield (
                space.to_gains(place),
                f"around it: {'more' if sign > 0.0 else 'less'} {_AXES[axis]}",
            )
    for optimum in optima:
        if optimum.law == "PI and spring" and optimum.station != station:
            yield optimum.best.gains, f"best {optimum.station.name_in_text} power"
    for optimum in optima:
        if optimum.law != "PI and spring" and optimum.station == station:
            yield optimum.best.gains, f"best {name} with {optimum.law} alone"
    for corner in np.stack(np.meshgrid(*[[1.0, -1.0]] * 3, indexing="ij"), -1).reshape(-1, 3):
        yield space.to_gains(middle + 0.7 * corner * distances), "corner around the best"


_AXES = ("damping", "Ki", "spring rate")


def _distance(
    quick_predictor: SetPointPredictor,
    space: SearchSpace,
    best: Gains,
    station: Station,
    axis: int,
    rise: float,
) -> float:
    """Return the distance along an axis at which a station's power is worse by ``rise`` (W)."""
    middle, step = space.to_coordinates(best), np.zeros(3)
    step[axis] = 0.5 * _MAX_DISTANCE[axis]
    centre, *sides = quick_predictor.predict(
        [space.to_gains(middle + sign * step) for sign in (0.0, 1.0, -1.0)]
    )
    rise_at_step = float(np.mean([one.power(station) for one in sides])) - centre.power(station)
    curvature = max(rise_at_step, 1e-3) / (0.25 * _MAX_DISTANCE[axis] ** 2)
    return min(float(np.sqrt(rise / curvature)), _MAX_DISTANCE[axis])


def _rounded(gains: Gains, space: SearchSpace) -> Gains:
    """Return rounded gains within the rig's spring map and its stability limit."""
    kp, ki, rate = gains
    low, high = space.spring
    rounded_rate = min(max(_RESOLUTION * round(rate / _RESOLUTION), low), high)
    max_ki = largest_ki(space.rig.stability, rounded_rate)
    rounded_max_ki = _RESOLUTION * float(np.floor(max_ki / _RESOLUTION))
    return Gains(
        _RESOLUTION * round(kp / _RESOLUTION),
        min(_RESOLUTION * round(ki / _RESOLUTION), rounded_max_ki),
        rounded_rate,
    )


def _is_same_row(one: Gains, other: Gains) -> bool:
    differences = zip(one, other, MIN_SPACING, strict=True)
    return all(abs(a - b) < spacing for a, b, spacing in differences)


def campaign_text(
    path: Path,
    base: Path,
    name: str,
    header: Sequence[str],
    rows: Sequence[RecommendedRow],
    comments: Sequence[str],
) -> str:
    """Return the text of a campaign file that extends ``base`` with another matrix.

    ``path`` is the path of the new file, ``header`` its comment lines at the top, ``comments`` the
    comment of each row.
    """
    mapping, _ = load_mapping(base, inline=("sea",))
    inherited = mapping.get("matrix") or {}
    text_lines = [f"# {line}" for line in header]
    text_lines += [
        f"extends: {_relative_path(base, path)}",
        f"name: {name}",
        "repeat: 1",
        "order: fewest spring moves",
        "matrix:",
        *(f"  {form}:" for form in FORMS[:2] if form in inherited),
        "  list:",
    ]
    settings = [_flow_mapping(row.prediction.gains, inherited, mapping) for row in rows]
    widest = max(len(text) for text in settings)
    text_lines += [
        f"    - {settings_text:<{widest}}  # {comment}"
        for settings_text, comment in zip(settings, comments, strict=True)
    ]
    return "\n".join(text_lines) + "\n"


def _flow_mapping(gains: Gains, inherited: dict[str, Any], mapping: dict[str, Any]) -> str:
    pairs = {
        "spring_n_per_m": gains.spring_rate, "kp_n_s_per_m": gains.kp, "ki_n_per_m": gains.ki,
        **_other_columns(inherited),
    }  # fmt: skip
    return "{" + ", ".join(f"{key}: {value:.10g}" for key, value in pairs.items()) + "}"


def _other_columns(inherited: dict[str, Any]) -> dict[str, float]:
    """Return the columns other than gains and spring, with the values of the base's first row."""
    rows = inherited.get("list") or inherited.get("grid") or [{}]
    columns: dict[str, float] = {}
    for key, value in rows[0].items():
        if key in ("spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m"):
            continue
        first = value["from"] if isinstance(value, dict) else value
        columns[key] = float(first[0] if isinstance(first, list) else first)
    return columns


def _relative_path(base: Path, path: Path) -> str:
    return os.path.relpath(base.resolve(), path.resolve().parent)
