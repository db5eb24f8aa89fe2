"""How fast this host runs plain Python just now: what figures of different hosts are compared by.

The same cycle takes 13 us of processor on one host and 42 on another, or on the same one when a
neighbour has its twin thread. Absolute numbers to hold are therefore held at one pace: that of a
core on which 100 NamedTuples take `STANDARD`. The figure as measured always stands beside it.
"""

from time import process_time_ns
from typing import NamedTuple

from benchmarks.support.result import Figure, figure

STANDARD = 20.0  # us for 100 NamedTuples
AT_PACE = "at the standard pace"  # what such a figure's name ends with


class _Point(NamedTuple):
    a: float
    b: float
    c: float
    d: float


def reference_cost(times: int) -> float:
    """Processor time (us) of 100 NamedTuples of four in plain Python."""
    hundred = range(100)
    a, b, c, d = 1.0, 2.0, 3.0, 4.0
    began = process_time_ns()
    for _ in range(times):
        for _ in hundred:
            _Point(a, b, c, d)
    return (process_time_ns() - began) / 1e3 / times


def both(name: str, costs: list[float], references: list[float], at_most: float) -> list[Figure]:
    """Processor time (us) as measured, and at the standard pace, where it has a number to hold.

    ``references`` are the reference's cost, each measured beside the cost of its place.
    """
    held = [cost * STANDARD / each for cost, each in zip(costs, references, strict=True)]
    unit = "us of processor"
    return [figure(name, unit, costs), figure(f"{name}, {AT_PACE}", unit, held, at_most=at_most)]
