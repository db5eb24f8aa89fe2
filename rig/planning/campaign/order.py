"""The order in which the points of a matrix are run, with their repetitions."""

import itertools
import random
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

from rig.planning.campaign.point import Point

Order = Literal["as given", "fewest spring moves", "random"]


class Turn(NamedTuple):
    """A point's turn to be run."""

    point: int  # index into the points as the file gives them
    repetition: int  # from 0


def turns(
    points: Sequence[Point], order: Order, repeat: int, seed: int, positions: dict[float, float]
) -> tuple[Turn, ...]:
    """Every point ``repeat`` times.

    ``positions`` gives the stator position (%) of each spring rate (N/m). Repetitions stay within
    a stretch of one spring rate, so they add no moves of the stator; only `random` mixes all.
    """
    rates = [point.spring_rate for point in points]
    if order == "random":
        mixed = [Turn(i, r) for r in range(repeat) for i in range(len(points))]
        random.Random(seed).shuffle(mixed)
        return tuple(mixed)
    if order == "as given":
        stretches: Iterable[list[int]] = (
            list(stretch)
            for _, stretch in itertools.groupby(range(len(points)), key=rates.__getitem__)
        )
    else:
        stretches = (
            [i for i, other in enumerate(rates) if other == rate]
            for rate in least_travel(rates, positions)
        )
    return tuple(Turn(i, r) for stretch in stretches for r in range(repeat) for i in stretch)


def least_travel(rates: Sequence[float], positions: dict[float, float]) -> tuple[float, ...]:
    """Each spring rate once, in the order in which the stator travels least in total.

    From end to end of a line is the shortest way past all its points, and as long back as forth:
    the end that the file names first begins.
    """
    line = sorted(set(rates), key=positions.__getitem__)
    if rates.index(line[-1]) < rates.index(line[0]):
        line.reverse()
    return tuple(line)
