"""The order of the points of a matrix and their repetitions in a campaign."""

import itertools
import random
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

Order = Literal["as given", "least travel", "random"]


class PointRepetition(NamedTuple):
    """One repetition of a point."""

    point: int  # index in the order of the file
    repetition: int  # from 0


def order_points(
    places: Sequence[float], order: Order, repeat: int, seed: int
) -> tuple[PointRepetition, ...]:
    """Return the sequence in which every point is run ``repeat`` times.

    ``places`` has, for each point, the place of the part that moves between rows. Repetitions stay
    within a block of one place, so they add no moves; only `random` mixes all.
    """
    if order == "random":
        shuffled = [PointRepetition(i, r) for r in range(repeat) for i in range(len(places))]
        random.Random(seed).shuffle(shuffled)
        return tuple(shuffled)
    if order == "as given":
        blocks: Iterable[list[int]] = (
            list(block)
            for _, block in itertools.groupby(range(len(places)), key=places.__getitem__)
        )
    else:
        blocks = (
            [i for i, other in enumerate(places) if other == place]
            for place in least_travel(places)
        )
    return tuple(PointRepetition(i, r) for block in blocks for r in range(repeat) for i in block)


def least_travel(places: Sequence[float]) -> tuple[float, ...]:
    """Return each place once, in the order with the least total travel.

    The shortest path through points on a line leads from one end to the other. Both directions are
    equally long; the sequence starts at the end that is named first in the file.
    """
    path = sorted(set(places))
    if places.index(path[-1]) < places.index(path[0]):
        path.reverse()
    return tuple(path)
