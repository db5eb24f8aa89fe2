"""Quadratic drag of the hull, from what experiments of different motion leave of one impedance.

In calm water the column load cell pushes the hull alone:

    F_LCB = Z_i v + c |v| v

At each line, experiments of other amplitude or phases differ in the share of the line of |v| v,
which is computed from the measured motion; c is what explains the differences, least squares over
all lines. Where it is not sure, it is zero and stands in the linear damping, as it always did.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.identification.experiments import LCB, VELOCITY, Experiment
from rig.identification.periods import Complexes, Floats, analysed, synthesised

SURE = 3.0  # standard deviations from which a quadratic drag is believed


class Found(NamedTuple):
    """A drag coefficient as its lines tell it."""

    value: float  # N s^2/m^2; 0 where it is not believed
    deviation: float  # its standard deviation; 0 where nothing tells it
    told: bool  # whether the lines could tell it at all


class Drag(NamedTuple):
    """The hull's drag, and its impedance without it."""

    coefficient: float  # N s^2/m^2
    frequency: Floats  # Hz
    impedance: Complexes  # N s/m there, Z_i without drag


def lines_of_drag(velocity: Complexes) -> Complexes:
    """Lines of |v| v (m^2/s^2) of a motion, as many as it has itself (m/s)."""
    v = synthesised(velocity)
    return analysed(np.abs(v) * v, len(velocity))


def along(force: Complexes, velocity: Complexes) -> Complexes:
    """Least-squares factor of velocity in force at each line, over the rows."""
    square = np.sum(np.abs(velocity) ** 2, axis=0)
    return np.asarray(np.sum(force * np.conj(velocity), axis=0) / square, dtype=np.complex128)


def coefficient(velocity: Complexes, force: Complexes, drag: Complexes) -> Found:
    """Drag from what velocity alone does not explain of force; arrays of rows by lines."""
    left = force - along(force, velocity) * velocity
    other = drag - along(drag, velocity) * velocity
    square = float(np.sum(np.abs(other) ** 2))
    count = 2 * (velocity.shape[0] - 1) * velocity.shape[1] - 1
    if count < 1 or square < 1e-9 * float(np.sum(np.abs(drag) ** 2)):
        return Found(0.0, 0.0, told=False)
    found = float(np.sum((left * np.conj(other)).real)) / square
    rest = left - found * other
    deviation = float(np.sqrt(np.sum(np.abs(rest) ** 2) / count / square))
    return Found(0.0 if found < SURE * deviation else found, deviation, told=True)


def drag_of(experiments: Sequence[Experiment]) -> Drag | None:
    """The hull's drag by its experiments in calm water, those of the most common lines.

    None where there are no two of them, or where they show none.
    """
    calm = [one for one in experiments if one.sea is None and one.axis == "heave"]
    calm = [one for one in calm if LCB in one.channels]
    sets: dict[tuple[float, tuple[int, ...]], list[Experiment]] = {}
    for one in calm:
        sets.setdefault((one.period, one.lines), []).append(one)
    used = max(sets.values(), key=len, default=[])
    if len(used) < 2:
        return None
    lines = np.flatnonzero(np.all([one.excited for one in used], axis=0))
    moved = [one.channels[VELOCITY].mean(axis=0) for one in used]
    velocity = np.array([each[lines] for each in moved])
    force = np.array([one.channels[LCB].mean(axis=0)[lines] for one in used])
    drag = np.array([lines_of_drag(each)[lines] for each in moved])
    if lines.size == 0:
        return None
    found = coefficient(velocity, force, drag)
    if found.value == 0.0:
        return None
    linear = np.asarray(force - found.value * drag, dtype=np.complex128)
    return Drag(found.value, used[0].frequency[lines], along(linear, velocity))
