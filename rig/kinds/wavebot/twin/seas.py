"""Wave excitation of the twin: identified or from BEM, and its scale in the measured rows.

The excitation force in a measured row is the remainder of motion and load cell,

    F_exc = Z_i v + c |v| v - F_LCB

Its ratio to |F_BEM| times the commanded wave amplitude gives one factor, which includes the errors
of both wave maker and hull model. Phases do not affect power.

At frequencies that no row in waves had, the excitation of a BEM file has the standard deviation by
which an identification in a tank differed from BEM: see `BEM_DEVIATION`.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rig.identification.drag import drag_spectrum
from rig.identification.excitation import Excitation
from rig.kinds.wavebot.twin.group import Group, single_value
from rig.kinds.wavebot.twin.hull import Hull
from rig.kinds.wavebot.twin.records import Record, sea_lines
from rig.spectra.periods import Complexes, Floats

SCALE = "excitation_scale"
BEM_ERROR = "bem_error"  # of a BEM excitation, in standard deviations
BEM_DEVIATION = ((0.2, 0.08), (0.4, 0.04), (0.5, 0.10), (0.65, 0.25), (1.0, 0.37))
"""Hz and relative standard deviation of a BEM excitation that was not measured.

The greater of |BEM/tank - 1| and |tank/BEM - 1| of an earlier WaveBot: waveBot_heaveModel.mat of
the public fbWecCntrl repository has 21 880, 12 504, 8976, 5136 and 2948 N/m there, capytaine
20 275, 12 981, 9887, 6425 and 2152 N/m. One device in one tank: an engineering choice for others.
"""
MARGIN = 0.02  # Hz around measured lines, in which that deviation changes by 0.02

Band = tuple[float, float]
"""Lowest and highest frequency, Hz."""


class Coefficient(NamedTuple):
    """Excitation over frequency, of e^{-i omega t} as in the BEM files of plants."""

    frequency: Floats  # Hz
    excitation: Complexes  # N/m
    source: str
    measured: tuple[Band, ...] = ()  # where it is identified; elsewhere it is from BEM


def measured_bands(
    records: Sequence[Record], coefficient: Coefficient, predicted: Mapping[str, Any] | None = None
) -> tuple[Band, ...]:
    """Return where excitation was measured: identified, or in rows in waves, by strong lines.

    Rows in a sea of many frequencies give one factor for all of them, which holds in that sea
    only: they count if it is the ``predicted`` one (commanded lines, as in a record).
    """
    bands = set(coefficient.measured)
    for sea in (record.sea for record in records if record.sea is not None):
        amplitude, cycles = np.array(sea["amplitude_m"]), np.array(sea["cycles"])
        strong = cycles[amplitude > 0.1 * amplitude.max(initial=0.0)] / float(sea["repeat_s"])
        if strong.size and (sea == predicted or np.ptp(strong) <= MARGIN):
            bands.add((float(strong.min()), float(strong.max())))
    return tuple(sorted(bands))


def bem_deviation(frequency: Floats, measured: Sequence[Band]) -> Floats:
    """Return the relative standard deviation of excitation at frequencies (Hz) by `BEM_DEVIATION`.

    It is 0 in the measured bands, where the factor's own deviation holds.
    """
    deviation = np.interp(frequency, *np.transpose(BEM_DEVIATION))
    for low, high in measured:
        deviation[(frequency >= low - MARGIN) & (frequency <= high + MARGIN)] = 0.0
    return np.asarray(deviation, dtype=np.float64)


def merge_identified(
    bem: Coefficient, excitations: Sequence[Excitation], lag: float
) -> Coefficient:
    """Return the BEM coefficient, replaced by the identified values on the good lines.

    ``lag`` is the time constant (s) of the measured forces, which the identified values contain.
    The identified lines are added to the frequencies. On the BEM's own frequencies, the outermost
    lines would be interpolated half from BEM values, and the scale factor of all lines would
    compensate for that.
    """
    candidates = [one for one in excitations if one.axis == "heave" and one.good.sum() > 3]
    if not candidates:
        return bem
    best = max(candidates, key=lambda one: int(one.good.sum()))
    measured = best.frequency[best.good]
    value = (best.value * (1.0 + 2j * np.pi * best.frequency * lag))[best.good]
    low, high = measured[0], measured[-1]
    frequency = np.union1d(bem.frequency, measured)
    merged = np.where(
        (frequency >= low) & (frequency <= high),
        _interpolate(frequency, measured, np.conj(value)),
        _interpolate(frequency, bem.frequency, bem.excitation),
    )
    source = (
        f"{best.experiments} experiments in waves from {low:.3g} to {high:.3g} Hz, "
        f"eta from {best.probe}; beyond: {bem.source}"
    )
    band = (float(low), float(high))
    return Coefficient(frequency, np.asarray(merged, dtype=np.complex128), source, (band,))


def _interpolate(frequency: Floats, known_frequency: Floats, value: Complexes) -> Complexes:
    """Interpolate magnitude and phase linearly, like the readers of BEM files."""
    magnitude = np.interp(frequency, known_frequency, np.abs(value))
    phase = np.interp(frequency, known_frequency, np.unwrap(np.angle(value)))
    return np.asarray(magnitude * np.exp(1j * phase), dtype=np.complex128)


def excitation_scale(records: Sequence[Record], hull: Hull, coefficient: Coefficient) -> Group:
    """Estimate the factor on the coefficient in the measured seas; 1 without rows in waves."""
    ratios = [_ratio(record, hull, coefficient) for record in records if record.sea is not None]
    if not ratios:
        source = f"not measured; {coefficient.source}"
        return single_value(SCALE, 1.0, 0.0, source)
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
