"""The best settings for a sea: P, PI, and PI with the spring, at each power station.

Power depends on Ki and spring mostly by their difference, which the device feels as one stiffness,
so that difference is a direction of its own. A coarse grid shows where the valley is; from its best
point a quadratic is fitted to a few points around, its bottom is the next middle, and the points
move closer together.
"""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import minimize

from rig.config.rig_file import RigFile
from rig.design.recommend.trial import Bench, Gains, Tried
from rig.identification.periods import Floats
from rig.planning.campaign.stability import largest_ki

Station = Literal["mechanical_1", "ac", "dc"]
Law = Literal["P", "PI", "PI and spring"]
STATIONS: tuple[Station, ...] = ("mechanical_1", "ac", "dc")
LAWS: tuple[Law, ...] = ("P", "PI", "PI and spring")

KP = (-6000.0, -100.0)  # N s/m
REACH = (-12_000.0, 22_000.0)  # N/m, of Ki less spring rate
_STEPS = (0.35, 2500.0, 3000.0)  # log Kp, N/m, N/m: first distance of the points around
_ROUNDS = 5
_SHRINK = 0.55  # of the distance, from round to round
_PENALTY = 100.0  # W, for each time that a limit is passed by its own size

Trial = Callable[[Sequence[Gains]], list[Tried]]


class Optimum(NamedTuple):
    """The best of a law for a station."""

    station: Station
    law: Law
    best: Tried
    at_limit: bool  # a limit of the rig or of the search, and not power, ends it there


class Room(NamedTuple):
    """Where settings are looked for."""

    spring: tuple[float, float]  # N/m
    rig: RigFile

    def gains(self, place: Floats) -> Gains:
        """Settings at log(-Kp), Ki less spring rate, and spring rate, within the room."""
        rate = float(np.clip(place[2], *self.spring))
        kp = -float(np.exp(np.clip(place[0], np.log(-KP[1]), np.log(-KP[0]))))
        ki = float(np.clip(place[1], *REACH)) + rate
        return Gains(kp, min(ki, largest_ki(self.rig.stability, rate)), rate)

    def place(self, gains: Gains) -> Floats:
        """The place of settings."""
        kp, ki, rate = gains
        return np.array([np.log(max(-kp, -KP[1])), ki - rate, rate])


def room_of(bench: Bench, spring: tuple[float, float] | None = None) -> Room:
    """All that the rig's spring map holds, or the rates given (N/m)."""
    rates, _ = bench.campaign.rig.spring.by_rate()
    low, high = spring or (rates[0], rates[-1])
    return Room((max(low, rates[0]), min(high, rates[-1])), bench.campaign.rig)


def cost(one: Tried, station: Station) -> float:
    """Power of a station, with what is refused made dear."""
    beyond = [m.used - 1.0 for m in one.margins if m.broken and m.limit.effect != "warn"]
    over = sum(min(each, 3.0) for each in beyond if each > 0.0)
    return one.power(station) + _PENALTY * over


def optima(bench: Bench, quick: Bench, room: Room, held: float) -> list[Optimum]:
    """The best setting of each law for each station; P and PI have the spring at ``held`` (N/m).

    They are looked for on the ``quick`` bench and told as the other one predicts them.
    """
    grid = quick.tried(_grid(room, held))
    found = []
    for law in LAWS:
        for station in STATIONS:
            there = [one for one in grid if _belongs(one.gains, law, held)]
            start = min(there, key=lambda one: cost(one, station))
            best = descend(quick.tried, room, start, station, law)
            found.append((station, law, best.gains))
    told = bench.tried([gains for _, _, gains in found])
    return [
        Optimum(station, law, best, _ends(best, room, law))
        for (station, law, _), best in zip(found, told, strict=True)
    ]


def _grid(room: Room, held: float) -> list[Gains]:
    """A coarse grid of all directions, of Kp and Ki at the held spring, and of Kp alone."""
    kps = np.linspace(np.log(-KP[1] * 5.0), np.log(-KP[0]), 6)
    reaches = np.linspace(-6000.0, 18_000.0, 7)
    rates = np.unique([*np.linspace(*room.spring, 4), held])
    made = [
        room.gains(np.array([kp, reach, rate])) for rate in rates for reach in reaches for kp in kps
    ]
    made += [Gains(-float(np.exp(kp)), 0.0, held) for kp in kps]
    return list(dict.fromkeys(made))


def _belongs(gains: Gains, law: Law, held: float) -> bool:
    if law == "PI and spring":
        return True
    return gains.spring_rate == held and (law == "PI" or gains.ki == 0.0)


def descend(trial: Trial, room: Room, start: Tried, station: Station, law: Law) -> Tried:
    """From a start to the bottom of the valley, in the directions that a law has."""
    free = {"P": 1, "PI": 2, "PI and spring": 3}[law]
    best, steps = start, np.array(_STEPS)
    for _ in range(_ROUNDS):
        middle = room.place(best.gains)
        offsets = _around(free)
        places = middle + offsets * steps
        tried = trial([room.gains(place) for place in places])
        costs = np.array([cost(one, station) for one in tried])
        bottom = middle + _bottom(offsets[:, :free], costs) * steps
        (last,) = trial([room.gains(bottom)])
        best = min([best, *tried, last], key=lambda one: cost(one, station))
        steps = steps * _SHRINK
    return best


def _around(free: int) -> Floats:
    """Middle, ends of each axis and corners, in units of a step; directions that are held are 0."""
    corners = np.stack(np.meshgrid(*[[-1.0, 1.0]] * free, indexing="ij"), axis=-1)
    ends = np.concatenate([np.eye(free), -np.eye(free)])
    points = np.concatenate([np.zeros((1, free)), ends, corners.reshape(-1, free)])
    points = np.unique(points, axis=0)
    return np.concatenate([points, np.zeros((len(points), 3 - free))], axis=1)


def _bottom(points: Floats, costs: Floats) -> Floats:
    """Least place of the quadratic through points, within two steps; 0 in directions held."""
    free = points.shape[1]
    pairs = [(i, j) for i in range(free) for j in range(i, free)]

    def terms(at: Floats) -> Floats:
        products = [at[..., i] * at[..., j] for i, j in pairs]
        return np.stack([np.ones(at.shape[:-1]), *np.moveaxis(at, -1, 0), *products], axis=-1)

    numbers = np.linalg.lstsq(terms(points), costs, rcond=None)[0]
    reach = [(-2.0, 2.0)] * free
    found = minimize(
        lambda at: float(terms(np.asarray(at)) @ numbers), np.zeros(free), bounds=reach
    )
    return np.concatenate([found.x, np.zeros(3 - free)])


def _ends(best: Tried, room: Room, law: Law) -> bool:
    """Whether a limit, not power, ends the search."""
    gains = best.gains
    near = any(m.used > 0.98 for m in best.margins if m.limit.effect in ("stop", "unstable"))
    edge = law == "PI and spring" and min(abs(gains.spring_rate - end) for end in room.spring) < 1.0
    stiff = largest_ki(room.rig.stability, gains.spring_rate) - gains.ki < 1.0
    return near or edge or (stiff and law != "P")
