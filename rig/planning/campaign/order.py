"""The order of the points of a matrix and their repetitions in a campaign."""

import itertools
import random
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

from rig.planning.campaign.point import Point

Order = Literal["as given", "fewest spring moves", "random"]


class PointRepetition(NamedTuple):
    """One repetition of a point."""

    point: int  # index in the order of the file
    repetition: int  # from 0


def order_points(
    points: Sequence[Point], order: Order, repeat: int, seed: int, positions: dict[float, float]
) -> tuple[PointRepetition, ...]:
    """Return the sequence in which every point is run ``repeat`` times.

    ``positions`` gives the stator position (%) of each spring rate (N/m). Repetitions stay within
    a block of one spring rate, so they add no moves of the stator; only `random` mixes all.
    """
    rates = [point.spring_rate for point in points]
    if order == "random":
        shuffled = [PointRepetition(i, r) for r in range(repeat) for i in range(len(points))]
        random.Random(seed).shuffle(shuffled)
        return tuple(shuffled)
    if order == "as given":
        blocks: Iterable[list[int]] = (
            list(block) for _, block in itertools.groupby(range(len(points)), key=rates.__getitem__)
        )
    else:
        blocks = (
            [i for i, other in enumerate(rates) if other == rate]
            for rate in least_travel(rates, positions)
        )
    return tuple(PointRepetition(i, r) for block in blocks for r in range(repeat) for i in block)


def least_travel(rates: Sequence[float], positions: dict[float, float]) -> tuple[float, ...]:
    """Return each spring rate once, in the order with the least total travel of the stator.

    The shortest path through points on a line leads from one end to the other. Both directions are
    equally long; the sequence starts at the end that is named first in the file.
    """
    path = sorted(set(rates), key=positions.__getitem__)
    if rates.index(path[-1]) < rates.index(path[0]):
        path.reverse()
    return tuple(path)
