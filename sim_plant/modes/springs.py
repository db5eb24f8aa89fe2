"""The springs of a plant's axes as numbers in flat arrays, and their forces.

The functions take the arrays that they read and run compiled, as those of `plant`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.magnetic_spring import Table, rate_at, slope_at
from sim_plant.parts import spring
from sim_plant.parts.spring import MagneticForces, MagneticParams, SpringParams

Numbers = Sequence[float]


class StatorParams(NamedTuple):
    """Stator of a magnetic spring; its positions, then as many rates stand behind all springs."""

    axis: float  # that moves the stator; NO_AXIS: it stands
    position: float  # m, where that axis is at 0
    first: float  # entry of the springs' numbers where the table starts
    entries: float  # of positions; 0: the spring has no magnetic part


# Numbers of a spring: the axis that it acts on, then the parts in this order.
SPRING_PARTS = (SpringParams, MagneticParams, StatorParams)
LINEAR = 1
MAGNETIC = LINEAR + len(SpringParams._fields)
STATOR = MAGNETIC + len(MagneticParams._fields)
SPRING_PARAM_COUNT = STATOR + len(StatorParams._fields)
NO_AXIS = -1


def axis_of(springs: Numbers, index: int) -> int:
    """Return the axis that a spring acts on."""
    return int(springs[index * SPRING_PARAM_COUNT])


def stator_axis(springs: Numbers, index: int) -> int:
    """Return the axis that moves the stator of a spring, or NO_AXIS."""
    return int(springs[index * SPRING_PARAM_COUNT + STATOR])


def forces(springs: Numbers, index: int, position: float, travel: float) -> MagneticForces:
    """Return the forces of a spring on its axis and on the axis of its stator.

    `position` is that of the axis and `travel` that of the stator's axis. Beyond its table the rate
    is constant, so that the stator's force is that of the energy there as well.
    """
    at = index * SPRING_PARAM_COUNT
    line, own, place = at + LINEAR, at + MAGNETIC, at + STATOR
    linear = spring.force(SpringParams(springs[line], springs[line + 1]), position)
    first, count = int(springs[place + 2]), int(springs[place + 3])
    if count == 0:
        return MagneticForces(linear, 0.0)
    table, stator = Table(first, count, first + count - 1), springs[place + 1] + travel
    slope = 0.0
    if springs[table.first] <= stator <= springs[table.last]:
        slope = slope_at(springs, springs, table, stator)
    magnetic = MagneticParams(springs[own], springs[own + 1], springs[own + 2])
    rate = rate_at(springs, springs, table, stator)
    both = spring.magnetic_forces(magnetic, rate, slope, position)
    return MagneticForces(linear + both.axis, both.stator)
