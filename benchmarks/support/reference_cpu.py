"""Current speed of plain Python on this host, which makes figures of different hosts comparable.

The same cycle takes 13 us of processor time on one host and 42 us on another, or on the same host
while another virtual machine uses the second hardware thread of the core. Absolute targets
therefore apply to figures normalised to a reference CPU: a core on which 100 NamedTuples take
`REFERENCE_CPU_US`. The raw figure always stands first, the normalised one next to it.
"""

from time import process_time_ns
from typing import NamedTuple

from benchmarks.support.result import Figure, figure

REFERENCE_CPU_US = 20.0  # us for 100 NamedTuples
NORMALISED = "normalised to the reference CPU"  # ends the name of such a figure


class _Point(NamedTuple):
    a: float
    b: float
    c: float
    d: float


def reference_cost(times: int) -> float:
    """Measure the processor time (us) of 100 NamedTuples of four fields in plain Python."""
    hundred = range(100)
    a, b, c, d = 1.0, 2.0, 3.0, 4.0
    began = process_time_ns()
    for _ in range(times):
        for _ in hundred:
            _Point(a, b, c, d)
    return (process_time_ns() - began) / 1e3 / times


def raw_and_normalised(
    name: str, costs: list[float], references: list[float], at_most: float
) -> list[Figure]:
    """Return the processor time (us) as measured, and normalised, with ``at_most`` as target.

    Each of ``references`` is the cost of the reference, measured next to the cost of that index.
    """
    normalised = [
        cost * REFERENCE_CPU_US / each for cost, each in zip(costs, references, strict=True)
    ]
    unit = "us of processor"
    return [
        figure(name, unit, costs),
        figure(f"{name}, {NORMALISED}", unit, normalised, at_most=at_most),
    ]
