"""Power at the four stations of the MASK4 test (report, section 3.1.3), per tick and per row.

Mechanical 1 is the force of the column load cell times velocity, mechanical 2 the torque of the
shaft sensor (as a linear force) times velocity; the power analyser measures AC and DC. Absorbed
power is negative.
"""

from typing import NamedTuple

from controllers.signals import Count, Watt
from rig.realtime.sequence import MEASURE, TAIL


class Power(NamedTuple):
    """Instantaneous power, and its mean over the measured part of the row so far."""

    mechanical_1: Watt  # at the column load cell
    mechanical_2: Watt  # at the shaft torque sensor
    ac: Watt
    dc: Watt
    mean_mechanical_1: Watt
    mean_ac: Watt
    mean_dc: Watt
    samples: Count  # measured ticks in the means


def start() -> Power:
    """Return zero power and empty means."""
    return Power(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)


def step(
    previous: Power, lcb: float, trs: float, velocity: float, ac: float, dc: float, phase: int
) -> Power:
    """Return the power of this tick from forces, velocity and the power analyser.

    ``lcb`` and ``trs``: tared forces on the body (N) at the column load cell and at the shaft
    torque sensor; ``velocity`` in m/s; ``ac`` and ``dc`` in W; ``phase``: a `sequence.Phase`.
    """
    mechanical_1 = lcb * velocity
    mechanical_2 = trs * velocity
    _, _, _, _, mean_1, mean_ac, mean_dc, samples = previous
    if phase == MEASURE:
        samples = samples + 1
        mean_1 = mean_1 + (mechanical_1 - mean_1) / samples
        mean_ac = mean_ac + (ac - mean_ac) / samples
        mean_dc = mean_dc + (dc - mean_dc) / samples
    elif phase != TAIL:  # the tail keeps the row's result readable
        mean_1 = mean_ac = mean_dc = 0.0
        samples = 0
    return Power(mechanical_1, mechanical_2, ac, dc, mean_1, mean_ac, mean_dc, samples)
