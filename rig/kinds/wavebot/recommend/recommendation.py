"""Recommendation of gains: the best settings, and the most informative rows to run next.

The first row is the best setting for the chosen station. Points around it on each axis follow, at
the distance where power is worse by about the uncertainty of the prediction; so the rows show the
sides of the valley and move closer as measurements accumulate. The optima of other stations and
laws come next, and corners around the best setting fill the remaining rows.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.kinds.wavebot.campaign import Campaign
from rig.kinds.wavebot.recommend.search import (
    Optimum,
    SearchSpace,
    best_with_spring,
    find_optima,
    search_space,
)
from rig.kinds.wavebot.recommend.set_points import (
    STATIONS,
    Gains,
    RowComparison,
    SetPointPrediction,
    SetPointPredictor,
    open_on_twin,
)
from rig.kinds.wavebot.twin import needed_runs, plant_file
from rig.kinds.wavebot.twin.estimate import Twin, identify_twin
from rig.recording.runs import RunError, run_info
from rig.stations import Station

MIN_RISE = 0.5  # W, smallest rise of power from the best setting to the points around it
MAX_RISE = 4.0  # W, largest rise
MIN_SPACING = (20.0, 20.0, 20.0)  # N s/m, N/m, N/m: closer settings are merged into one row
_MAX_DISTANCE = (0.5, 4000.0, 4000.0)  # log Kp, N/m, N/m: of a point around the best
_AXES = ("damping", "Ki", "spring rate")
_RESOLUTION = 10.0  # N s/m, N/m: step to which gains are rounded


class RecommendedRow(NamedTuple):
    """A row of the recommended matrix and the reason for it."""

    prediction: SetPointPrediction
    reason: str


def choose_rows(
    space: SearchSpace, optima: Sequence[Optimum], station: Station, max_rows: int
) -> list[RecommendedRow]:
    """Return the rows for a station, the best first; the optima must have intervals."""
    candidates: dict[Gains, str] = {}
    for gains, reason in _candidates(space, optima, station):
        rounded = _rounded(gains, space)
        distances = (np.abs(np.subtract(rounded, other)) for other in candidates)
        if not any(np.all(distance < MIN_SPACING) for distance in distances):
            candidates[rounded] = reason
    pairs = zip(space.predictor.predict(list(candidates)), candidates.values(), strict=True)
    rows = [RecommendedRow(prediction, reason) for prediction, reason in pairs]
    return [row for row in rows if row.prediction.allowed][:max_rows]


def _candidates(
    space: SearchSpace, optima: Sequence[Optimum], station: Station
) -> Iterator[tuple[Gains, str]]:
    best = best_with_spring(optima, station)
    name = f"{station.name_in_text} power"
    yield best.gains, f"best {name}"
    rise = min(max(best.half_width[station.name], MIN_RISE), MAX_RISE)
    distances = [_distance(space, best.gains, station, axis, rise) for axis in range(3)]
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


def _distance(space: SearchSpace, best: Gains, station: Station, axis: int, rise: float) -> float:
    """Return the distance along an axis at which a station's power is worse by ``rise`` (W)."""
    middle, step = space.to_coordinates(best), np.zeros(3)
    step[axis] = 0.5 * _MAX_DISTANCE[axis]
    places = [space.to_gains(middle + sign * step) for sign in (0.0, 1.0, -1.0)]
    centre, *sides = (one.power(station) for one in space.predictor.quick.predict(places))
    curvature = max(float(np.mean(sides)) - centre, 1e-3) / (0.25 * _MAX_DISTANCE[axis] ** 2)
    return min(float(np.sqrt(rise / curvature)), _MAX_DISTANCE[axis])


def _rounded(gains: Gains, space: SearchSpace) -> Gains:
    """Return rounded gains within the rig's spring map and its stability limit."""
    kp, ki, rate = (_RESOLUTION * round(each / _RESOLUTION) for each in gains)
    low, high = space.spring
    rate = min(max(rate, low), high)
    max_ki = _RESOLUTION * float(np.floor(space.largest_ki(rate) / _RESOLUTION))
    return Gains(kp, min(ki, max_ki), rate)


class RecommendOptions(NamedTuple):
    """Options of a recommendation."""

    campaign: Path | None = None  # base campaign; None: that of the last run in waves
    station: Station = STATIONS[-1]
    rows: int = 12
    spring: tuple[float, float] | None = None  # N/m, range; None: the whole spring map
    plant: Path | None = None  # replaces the plant file that the first run names
    probe: str = ""  # name of the probe in wave calibrations
    incomplete_rows: bool = False  # also use rows with missing ticks


class Recommendation(NamedTuple):
    """A recommendation: optima and rows, with their confidence intervals."""

    options: RecommendOptions
    base: Path  # the base campaign
    predictor: SetPointPredictor  # of the base campaign on the twin
    optima: tuple[Optimum, ...]
    rows: tuple[RecommendedRow, ...]
    measured: tuple[RowComparison, ...]  # measured rows of the same sea, with their prediction

    @property
    def campaign(self) -> Campaign:
        """The base campaign on the twin."""
        return self.predictor.campaign

    @property
    def twin(self) -> Twin:
        """The identified twin."""
        return self.predictor.twin

    @property
    def best(self) -> SetPointPrediction:
        """The best setting for the chosen station."""
        return best_with_spring(self.optima, self.options.station)


def recommend(runs: Sequence[Path], options: RecommendOptions, folder: Path) -> Recommendation:
    """Return the recommendation; writes the twin into ``folder``.

    Raises RunError, ValueError or `ConfigError`, as `identify_twin` and `open_campaign` do.
    """
    twin = identify_twin(
        runs, options.plant, options.probe, incomplete_rows=options.incomplete_rows
    )
    base = options.campaign or _last_campaign_in_waves(runs)
    plant, *_ = plant_file.write(twin, folder / plant_file.FOLDER)
    predictor = SetPointPredictor(open_on_twin(base, plant), twin)
    space = search_space(predictor, options.spring)
    optima = find_optima(space)
    measured = predictor.compare_rows()
    with_intervals = predictor.with_intervals([optimum.best for optimum in optima], measured)
    optima = [
        optimum._replace(best=best) for optimum, best in zip(optima, with_intervals, strict=True)
    ]
    rows = choose_rows(space, optima, options.station, options.rows)
    if not rows:
        message = "no setting near the best is allowed by the limits of the rig"
        needed = "a campaign with a smaller sea (--campaign FILE), or another range of --spring"
        raise RunError(f"{message}; allowed {needed}")
    with_intervals = predictor.with_intervals([row.prediction for row in rows], measured)
    rows = [row._replace(prediction=one) for row, one in zip(rows, with_intervals, strict=True)]
    return Recommendation(options, base, predictor, tuple(optima), tuple(rows), tuple(measured))


def _last_campaign_in_waves(runs: Sequence[Path]) -> Path:
    """The campaign file of the last run in waves."""
    for run in reversed(runs):
        run_facts = run_info(run)
        if (run_facts.plan.get("sea") or {}).get("kind") in ("calm", None):
            continue
        if run_facts.plan.get("device") == "absent" or run_facts.plan.get("reference"):
            continue
        if (path := needed_runs.campaign_of(run_facts)) is not None:
            return path
    needed = needed_runs.in_waves_text([run_info(run) for run in runs])
    raise RunError(f"no run in waves whose campaign file still exists; {needed}")
