"""Wave excitation: as identified, as a BEM file says, and how large it is in the rows measured.

What pushes the hull in a measured row is what its motion and load cell leave,

    F_exc = Z_i v + c |v| v - F_LCB

and beside |F_BEM| times the amplitude that was asked of the wave maker it gives one factor, which
holds wave maker and hull alike. Phases do not enter power.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.identification.drag import lines_of_drag
from rig.identification.excitation import Excitation
from rig.identification.periods import Complexes, Floats
from rig.identification.twin.group import Group
from rig.identification.twin.hull import Hull
from rig.identification.twin.records import Record

SCALE = "excitation_scale"
BEM_DEVIATION = 0.03  # engineering choice: of a BEM excitation that nothing was measured against


class Coefficient(NamedTuple):
    """Excitation over frequency, e^{-i omega t} as plant files' BEM files have it."""

    frequency: Floats  # Hz
    excitation: Complexes  # N/m
    source: str


def identified(bem: Coefficient, found: Sequence[Excitation]) -> Coefficient:
    """The BEM coefficient with what was identified in its place, on the lines that are good.

    Those lines become frequencies of it: between BEM's own the outermost would be half BEM's, and
    the factor of all lines would make up for them.
    """
    kept = [one for one in found if one.axis == "heave" and one.good.sum() > 3]
    if not kept:
        return bem
    best = max(kept, key=lambda one: int(one.good.sum()))
    inside, value = best.frequency[best.good], np.conj(best.value[best.good])
    frequency = np.union1d(bem.frequency, inside)
    within = (frequency >= inside[0]) & (frequency <= inside[-1])
    known = _turning(frequency, bem.frequency, bem.excitation)
    made = np.where(within, _turning(frequency, inside, value), known)
    source = (
        f"{best.experiments} experiments in waves from {inside[0]:.3g} to {inside[-1]:.3g} Hz, "
        f"eta from {best.probe}; beyond: {bem.source}"
    )
    return Coefficient(frequency, np.asarray(made, dtype=np.complex128), source)


def _turning(frequency: Floats, known: Floats, value: Complexes) -> Complexes:
    """Magnitude and phase each on a straight line, as readers of BEM files go."""
    size = np.interp(frequency, known, np.abs(value))
    phase = np.interp(frequency, known, np.unwrap(np.angle(value)))
    return np.asarray(size * np.exp(1j * phase), dtype=np.complex128)


def scale(records: Sequence[Record], hull: Hull, coefficient: Coefficient, doubt: float) -> Group:
    """Factor on the coefficient in the seas that were measured, 1 with ``doubt`` where none was."""
    ratios = [_ratio(one, hull, coefficient) for one in records if one.sea is not None]
    if not ratios:
        source = f"not measured; {coefficient.source}"
        return Group((SCALE,), (1.0,), np.array([[doubt * doubt]]), source)
    mean = float(np.mean(ratios))
    deviation = float(np.std(ratios, ddof=1)) if len(ratios) > 1 else 0.01
    source = f"{len(ratios)} rows in waves against {coefficient.source}"
    return Group((SCALE,), (mean,), np.array([[deviation * deviation]]), source)


def _ratio(record: Record, hull: Hull, coefficient: Coefficient) -> float:
    """Size of the force that drives a row over the one expected, over the sea's strong lines."""
    assert record.sea is not None
    lines = np.flatnonzero(record.excited)
    omega = record.omega[lines]
    drag = lines_of_drag(record.velocity)[lines]
    z = _hull_impedance(hull, omega)
    force = z * record.velocity[lines] + hull.quadratic.values[0] * drag - record.lcb[lines]
    size = np.interp(omega / (2.0 * np.pi), coefficient.frequency, np.abs(coefficient.excitation))
    amplitude = np.zeros(len(record.velocity))
    number = np.rint(np.array(record.sea["cycles"]) * record.period / record.sea["repeat_s"])
    for at, metres in zip(number.astype(int), record.sea["amplitude_m"], strict=True):
        if 1 <= at <= amplitude.size:
            amplitude[at - 1] += metres
    expected = size * amplitude[lines]
    return float(np.sum(np.abs(force) * expected) / np.sum(expected * expected))


def _hull_impedance(hull: Hull, omega: Floats) -> Complexes:
    """Z_i at any frequency: the model outside the lines, the lines themselves between them."""
    mass, damping, stiffness = hull.linear.values
    s = 1j * omega
    below = np.polyval([1.0, *hull.radiation.denominator], s)
    memory = np.polyval([*hull.radiation.numerator, 0.0], s) / below
    return np.asarray(mass * s + damping + stiffness / s + memory, dtype=np.complex128)
