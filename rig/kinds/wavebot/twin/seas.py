"""Wave excitation of the twin: identified or from BEM, and its scale in the measured rows.

The excitation force in a measured row is the remainder of motion and load cell,

    F_exc = Z_i v + c |v| v - F_LCB

Its ratio to |F_BEM| times the commanded wave amplitude gives one factor, which includes the errors
of both wave maker and hull model. Phases do not affect power.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.identification.drag import drag_spectrum
from rig.identification.excitation import Excitation
from rig.kinds.wavebot.twin.group import Group, single_value
from rig.kinds.wavebot.twin.hull import Hull
from rig.kinds.wavebot.twin.records import Record, sea_lines
from rig.spectra.periods import Complexes, Floats

SCALE = "excitation_scale"
BEM_DEVIATION = 0.03  # engineering choice: uncertainty of a BEM excitation without a measurement


class Coefficient(NamedTuple):
    """Excitation over frequency, of e^{-i omega t} as in the BEM files of plants."""

    frequency: Floats  # Hz
    excitation: Complexes  # N/m
    source: str


def merge_identified(bem: Coefficient, excitations: Sequence[Excitation]) -> Coefficient:
    """Return the BEM coefficient, replaced by the identified values on the good lines.

    The identified lines are added to the frequencies. On the BEM's own frequencies, the outermost
    lines would be interpolated half from BEM values, and the scale factor of all lines would
    compensate for that.
    """
    candidates = [one for one in excitations if one.axis == "heave" and one.good.sum() > 3]
    if not candidates:
        return bem
    best = max(candidates, key=lambda one: int(one.good.sum()))
    measured = best.frequency[best.good]
    low, high = measured[0], measured[-1]
    frequency = np.union1d(bem.frequency, measured)
    merged = np.where(
        (frequency >= low) & (frequency <= high),
        _interpolate(frequency, measured, np.conj(best.value[best.good])),
        _interpolate(frequency, bem.frequency, bem.excitation),
    )
    source = (
        f"{best.experiments} experiments in waves from {low:.3g} to {high:.3g} Hz, "
        f"eta from {best.probe}; beyond: {bem.source}"
    )
    return Coefficient(frequency, np.asarray(merged, dtype=np.complex128), source)


def _interpolate(frequency: Floats, known_frequency: Floats, value: Complexes) -> Complexes:
    """Interpolate magnitude and phase linearly, like the readers of BEM files."""
    magnitude = np.interp(frequency, known_frequency, np.abs(value))
    phase = np.interp(frequency, known_frequency, np.unwrap(np.angle(value)))
    return np.asarray(magnitude * np.exp(1j * phase), dtype=np.complex128)


def excitation_scale(
    records: Sequence[Record], hull: Hull, coefficient: Coefficient, deviation_without_waves: float
) -> Group:
    """Estimate the factor on the coefficient in the measured seas.

    Without rows in waves it is 1 with standard deviation ``deviation_without_waves``.
    """
    ratios = [_ratio(record, hull, coefficient) for record in records if record.sea is not None]
    if not ratios:
        source = f"not measured; {coefficient.source}"
        return single_value(SCALE, 1.0, deviation_without_waves, source)
    deviation = float(np.std(ratios, ddof=1)) if len(ratios) > 1 else 0.01
    source = f"{len(ratios)} rows in waves against {coefficient.source}"
    return single_value(SCALE, float(np.mean(ratios)), deviation, source)


def _ratio(record: Record, hull: Hull, coefficient: Coefficient) -> float:
    """Return the ratio of measured to expected excitation force over the sea's strong lines."""
    assert record.sea is not None
    lines = np.flatnonzero(record.excited)
    omega = record.omega[lines]
    drag = drag_spectrum(record.velocity)[lines]
    linear_force = hull.impedance_at(omega) * record.velocity[lines]
    force = linear_force + hull.quadratic.values[0] * drag - record.lcb[lines]
    frequency = omega / (2.0 * np.pi)
    magnitude = np.interp(frequency, coefficient.frequency, np.abs(coefficient.excitation))
    number, amplitude = sea_lines(record.sea, record.period, len(record.velocity))
    by_line = np.bincount(number - 1, amplitude, minlength=len(record.velocity))
    expected = magnitude * by_line[lines]
    return float(np.sum(np.abs(force) * expected) / np.sum(expected * expected))
