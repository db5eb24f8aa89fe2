"""One axis of the rig: hull, excitation, loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.design.predictions.grid import Complexes, Floats, Grid
from rig.design.predictions.loop import Timing
from sim_plant.body import BodyParams


class Axis(NamedTuple):
    """What all rows have in common on one axis."""

    hull: BodyParams
    drivetrain: float  # N*s/m, viscous, beside the hull
    excitation: Complexes  # N, by line
    timing: Timing
    newtons_per_ampere: float
    most: float  # A, the lesser of the rig's peak current and the drive's


def body_lines(axis: Axis, on: Grid) -> Complexes:
    """The linear hull without spring and drive: force per metre, N/m, by line."""
    return hull_lines(axis.hull, axis.drivetrain, on.omega)


def hull_lines(hull: BodyParams, drivetrain: float, omega: Floats) -> Complexes:
    """As `body_lines`, at angular frequencies (rad/s); amplitudes of e^{+i omega t}."""
    s = np.asarray(1j * omega, dtype=np.complex128)
    above = [hull.b4, hull.b3, hull.b2, hull.b1, 0.0]
    below = [1.0, hull.a4, hull.a3, hull.a2, hull.a1, hull.a0]
    radiation = np.polyval(above, s) / np.polyval(below, s)
    damping = radiation + hull.viscous + drivetrain
    return np.asarray(s * s * hull.inertia + s * damping + hull.hydrostatic, dtype=np.complex128)


def peak(values: Floats) -> Floats:
    """Largest size in each row."""
    found: Floats = np.abs(values).max(axis=1)
    return found
