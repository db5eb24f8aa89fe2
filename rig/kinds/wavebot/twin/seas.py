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
from rig.kinds.wavebot.twin.group import Group
from rig.kinds.wavebot.twin.hull import Hull
from rig.kinds.wavebot.twin.records import Record
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
    candidates = [
        excitation
        for excitation in excitations
        if excitation.axis == "heave" and excitation.good.sum() > 3
    ]
    if not candidates:
        return bem
    best = max(candidates, key=lambda excitation: int(excitation.good.sum()))
    identified_frequency = best.frequency[best.good]
    identified_value = np.conj(best.value[best.good])
    frequency = np.union1d(bem.frequency, identified_frequency)
    in_band = (frequency >= identified_frequency[0]) & (frequency <= identified_frequency[-1])
    bem_value = _interpolate(frequency, bem.frequency, bem.excitation)
    merged = np.where(
        in_band, _interpolate(frequency, identified_frequency, identified_value), bem_value
    )
    source = (
        f"{best.experiments} experiments in waves from {identified_frequency[0]:.3g} "
        f"to {identified_frequency[-1]:.3g} Hz, "
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
        return Group(
            (SCALE,),
            (1.0,),
            np.array([[deviation_without_waves * deviation_without_waves]]),
            source,
        )
    mean = float(np.mean(ratios))
    deviation = float(np.std(ratios, ddof=1)) if len(ratios) > 1 else 0.01
    source = f"{len(ratios)} rows in waves against {coefficient.source}"
    return Group((SCALE,), (mean,), np.array([[deviation * deviation]]), source)


def _ratio(record: Record, hull: Hull, coefficient: Coefficient) -> float:
    """Return the ratio of measured to expected excitation force over the sea's strong lines."""
    assert record.sea is not None
    lines = np.flatnonzero(record.excited)
    omega = record.omega[lines]
    drag = drag_spectrum(record.velocity)[lines]
    z = _hull_impedance(hull, omega)
    force = z * record.velocity[lines] + hull.quadratic.values[0] * drag - record.lcb[lines]
    magnitude = np.interp(
        omega / (2.0 * np.pi), coefficient.frequency, np.abs(coefficient.excitation)
    )
    amplitude = np.zeros(len(record.velocity))
    number = np.rint(np.array(record.sea["cycles"]) * record.period / record.sea["repeat_s"])
    for line_number, amplitude_m in zip(number.astype(int), record.sea["amplitude_m"], strict=True):
        if 1 <= line_number <= amplitude.size:
            amplitude[line_number - 1] += amplitude_m
    expected = magnitude * amplitude[lines]
    return float(np.sum(np.abs(force) * expected) / np.sum(expected * expected))


def _hull_impedance(hull: Hull, omega: Floats) -> Complexes:
    """Return Z_i of the fitted hull model at any angular frequency (rad/s)."""
    mass, damping, stiffness = hull.linear.values
    s = 1j * omega
    denominator = np.polyval([1.0, *hull.radiation.denominator], s)
    memory = np.polyval([*hull.radiation.numerator, 0.0], s) / denominator
    return np.asarray(mass * s + damping + stiffness / s + memory, dtype=np.complex128)
