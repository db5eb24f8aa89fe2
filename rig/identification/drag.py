"""Quadratic drag of the hull, from experiments with different motions.

In calm water the sensor at the body measures the force on the hull alone:

    F_body = Z_i v + c |v| v

At each line, experiments with different amplitudes or phases differ in the line of |v| v, which is
computed from the measured motion. c is the least-squares coefficient that explains the differences
over all lines. If c is not significant, it is set to zero; the drag is then part of the linear
damping.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.identification.experiments import BODY, VELOCITY, Experiment
from rig.spectra.periods import Complexes, Floats, analyse, synthesise

MIN_SIGNIFICANCE = 3.0  # standard deviations above which a quadratic drag is significant


class DragEstimate(NamedTuple):
    """Estimate of a drag coefficient."""

    value: float  # N s^2/m^2; 0 if not significant
    deviation: float  # standard deviation; 0 if not observable
    observable: bool  # True if the lines can determine it


class Drag(NamedTuple):
    """The hull's drag, and its impedance without drag."""

    coefficient: float  # N s^2/m^2
    frequency: Floats  # Hz
    impedance: Complexes  # N s/m, Z_i without drag, at these frequencies


def drag_spectrum(velocity: Complexes) -> Complexes:
    """Return the lines of |v| v (m^2/s^2) of a motion (m/s), as many as the motion has."""
    v = synthesise(velocity)
    return analyse(np.abs(v) * v, len(velocity))


def fit_impedance(force: Complexes, velocity: Complexes) -> Complexes:
    """Return the least-squares factor of velocity in force at each line, over the rows."""
    square = np.sum(np.abs(velocity) ** 2, axis=0)
    return np.asarray(np.sum(force * np.conj(velocity), axis=0) / square, dtype=np.complex128)


def estimate_drag(velocity: Complexes, force: Complexes, drag: Complexes) -> DragEstimate:
    """Estimate drag from the part of force that velocity does not explain; rows by lines."""
    residual_force = force - fit_impedance(force, velocity) * velocity
    residual_drag = drag - fit_impedance(drag, velocity) * velocity
    square = float(np.sum(np.abs(residual_drag) ** 2))
    count = 2 * (velocity.shape[0] - 1) * velocity.shape[1] - 1
    if count < 1 or square < 1e-9 * float(np.sum(np.abs(drag) ** 2)):
        return DragEstimate(0.0, 0.0, observable=False)
    value = float(np.sum((residual_force * np.conj(residual_drag)).real)) / square
    remainder = residual_force - value * residual_drag
    deviation = float(np.sqrt(np.sum(np.abs(remainder) ** 2) / count / square))
    return DragEstimate(
        0.0 if value < MIN_SIGNIFICANCE * deviation else value, deviation, observable=True
    )


def identify_drag(experiments: Sequence[Experiment]) -> Drag | None:
    """Return the hull's drag from experiments in calm water with the most common set of lines.

    None if there are fewer than two of them or the drag is not significant.
    """
    calm = [
        experiment
        for experiment in experiments
        if experiment.sea is None and BODY in experiment.channels
    ]
    by_lines: dict[tuple[float, tuple[int, ...]], list[Experiment]] = {}
    for experiment in calm:
        by_lines.setdefault((experiment.period, experiment.lines), []).append(experiment)
    group = max(by_lines.values(), key=len, default=[])
    if len(group) < 2:
        return None
    lines = np.flatnonzero(np.all([experiment.excited for experiment in group], axis=0))
    if lines.size == 0:
        return None
    motions = [experiment.channels[VELOCITY].mean(axis=0) for experiment in group]
    velocity = np.array([motion[lines] for motion in motions])
    force = np.array([experiment.channels[BODY].mean(axis=0)[lines] for experiment in group])
    drag = np.array([drag_spectrum(motion)[lines] for motion in motions])
    estimate = estimate_drag(velocity, force, drag)
    if estimate.value == 0.0:
        return None
    linear = np.asarray(force - estimate.value * drag, dtype=np.complex128)
    return Drag(estimate.value, group[0].frequency[lines], fit_impedance(linear, velocity))
