"""Search for the best P, PI, and PI-and-spring settings of a sea, for each power station.

Power depends on Ki and spring rate mostly through their difference, the effective stiffness, so the
search uses that difference as a coordinate. A coarse grid locates the valley, from whose best point
the search descends (`rig.design.descent`).
"""

from collections.abc import Iterable
from typing import Literal, NamedTuple

import numpy as np

from rig.design.descent import descend
from rig.kinds.wavebot.campaign.stability import largest_ki
from rig.kinds.wavebot.recommend.set_points import (
    STATIONS,
    Gains,
    SetPointPrediction,
    SetPointPredictor,
)
from rig.spectra.periods import Floats
from rig.stations import Station

Law = Literal["P", "PI", "PI and spring"]
LAWS: tuple[Law, ...] = ("P", "PI", "PI and spring")

KP_RANGE = (-6000.0, -100.0)  # N s/m
STIFFNESS_RANGE = (-12_000.0, 22_000.0)  # N/m, range of Ki minus spring rate
_STEPS = (0.35, 2500.0, 3000.0)  # log Kp, N/m, N/m: initial distance of the points
_ITERATIONS = 5
_PENALTY = 100.0  # W per relative excess over a limit


class Optimum(NamedTuple):
    """The best setting of a law for a station."""

    station: Station
    law: Law
    best: SetPointPrediction
    at_limit: bool  # True if a limit of the rig or the search ends the search there


class SearchSpace(NamedTuple):
    """Range of the settings in the search, and their predictor."""

    spring: tuple[float, float]  # N/m
    predictor: SetPointPredictor

    def largest_ki(self, rate: float) -> float:
        """Return the largest stable Ki (N/m) at a spring rate (N/m)."""
        return largest_ki(self.predictor.campaign.rig.stability, rate)

    def to_gains(self, coordinates: Floats) -> Gains:
        """Return the gains at (log(-Kp), Ki - spring rate, spring rate), clipped to the space."""
        rate = float(np.clip(coordinates[2], *self.spring))
        kp = -float(np.exp(np.clip(coordinates[0], np.log(-KP_RANGE[1]), np.log(-KP_RANGE[0]))))
        ki = float(np.clip(coordinates[1], *STIFFNESS_RANGE)) + rate
        return Gains(kp, min(ki, self.largest_ki(rate)), rate)

    def to_coordinates(self, gains: Gains) -> Floats:
        """Return the coordinates of gains."""
        kp, ki, rate = gains
        return np.array([np.log(max(-kp, -KP_RANGE[1])), ki - rate, rate])


def search_space(
    predictor: SetPointPredictor, spring: tuple[float, float] | None = None
) -> SearchSpace:
    """Return the search space: the rig's spring map, or the given range of rates (N/m)."""
    rates, _ = predictor.campaign.rig.spring.by_rate()
    low, high = spring or (rates[0], rates[-1])
    return SearchSpace((max(low, rates[0]), min(high, rates[-1])), predictor)


def cost(prediction: SetPointPrediction, station: Station) -> float:
    """Return the power of a station (W) plus a penalty for exceeded limits."""
    excess = [m.used - 1.0 for m in prediction.margins if m.exceeded and m.limit.effect != "warn"]
    penalty = sum(min(each, 3.0) for each in excess if each > 0.0)
    return prediction.power(station) + _PENALTY * penalty


def find_optima(space: SearchSpace) -> list[Optimum]:
    """Return the best setting of each law for each station.

    P and PI use the spring rate of the campaign's first row. The search uses the quick predictor;
    the results are predictions of the predictor itself.
    """
    predictor = space.predictor
    spring_rate = min(max(predictor.first_gains.spring_rate, space.spring[0]), space.spring[1])
    grid = predictor.quick.predict(_grid(space, spring_rate))
    optima = []
    for law in LAWS:
        candidates = grid
        if law != "PI and spring":
            candidates = [one for one in grid if one.gains.spring_rate == spring_rate]
        if law == "P":
            candidates = [one for one in candidates if one.gains.ki == 0.0]
        for station in STATIONS:
            start = min(candidates, key=lambda one: cost(one, station))
            optima.append((station, law, _descend(space, start, station, law)))
    predictions = predictor.predict([gains for *_, gains in optima])
    return [
        Optimum(station, law, best, _is_at_limit(best, space, law))
        for (station, law, _), best in zip(optima, predictions, strict=True)
    ]


def best_with_spring(optima: Iterable[Optimum], station: Station) -> SetPointPrediction:
    """Return the best setting for a station with PI and spring."""
    return next(one.best for one in optima if (one.station, one.law) == (station, LAWS[-1]))


def _grid(space: SearchSpace, spring_rate: float) -> list[Gains]:
    """Return a coarse grid in all coordinates, in Kp and Ki at the spring rate, and in Kp only."""
    log_kps = np.linspace(np.log(-KP_RANGE[1] * 5.0), np.log(-KP_RANGE[0]), 6)
    stiffnesses = np.linspace(-6000.0, 18_000.0, 7)
    spring_rates = np.unique([*np.linspace(*space.spring, 4), spring_rate])
    points = [
        space.to_gains(np.array([log_kp, stiffness, rate]))
        for rate in spring_rates
        for stiffness in stiffnesses
        for log_kp in log_kps
    ]
    points += [Gains(-float(np.exp(log_kp)), 0.0, spring_rate) for log_kp in log_kps]
    return list(dict.fromkeys(points))


def _descend(space: SearchSpace, start: SetPointPrediction, station: Station, law: Law) -> Gains:
    """Return the best gains found from a start, in the coordinates that the law varies."""
    steps = np.where(np.arange(3) <= LAWS.index(law), _STEPS, 0.0)

    def costs(points: Floats) -> Floats:
        predictions = space.predictor.quick.predict([space.to_gains(point) for point in points])
        return np.array([cost(one, station) for one in predictions])

    def project(point: Floats) -> Floats:
        return space.to_coordinates(space.to_gains(point))

    first = space.to_coordinates(start.gains)
    return space.to_gains(descend(costs, first, steps, _ITERATIONS, project))


def _is_at_limit(best: SetPointPrediction, space: SearchSpace, law: Law) -> bool:
    """Return True if a limit, not power, determines the optimum."""
    _, ki, rate = best.gains
    near_limit = any(m.used > 0.98 for m in best.margins if m.limit.effect in ("stop", "unstable"))
    at_spring_end = law == "PI and spring" and min(abs(rate - end) for end in space.spring) < 1.0
    at_max_ki = law != "P" and space.largest_ki(rate) - ki < 1.0
    return near_limit or at_spring_end or at_max_ki
