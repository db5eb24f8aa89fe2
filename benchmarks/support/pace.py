"""How fast this host runs plain Python just now: what figures of different hosts are compared by.

The same cycle takes 13 us of processor on one host and 42 on another, or on the same one when a
neighbour has its twin thread. Absolute numbers to hold are therefore held at one pace: that of a
core on which 100 NamedTuples take `STANDARD`. The figure as measured always stands beside it.
"""

from collections.abc import Iterable
from time import process_time_ns
from typing import NamedTuple

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


def at_pace(costs: Iterable[float], references: Iterable[float]) -> list[float]:
    """Costs (us) at the standard pace, each by the reference measured beside it."""
    return [cost * STANDARD / reference for cost, reference in zip(costs, references, strict=True)]
