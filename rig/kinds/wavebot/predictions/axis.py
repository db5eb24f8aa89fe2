"""One axis of the rig (heave or surge): hull, excitation and control loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.design.grid import Complexes, Floats, Grid
from rig.design.loop import Timing
from sim_plant.body import BodyParams


class Axis(NamedTuple):
    """Parameters of one axis that all rows share."""

    hull: BodyParams
    drivetrain_damping: float  # N*s/m, viscous, in addition to the hull
    excitation: Complexes  # N, by line
    timing: Timing
    newtons_per_ampere: float
    current_limit: float  # A, the smaller of the rig's and the drive's peak current


def body_dynamic_stiffness(axis: Axis, grid: Grid) -> Complexes:
    """Return the dynamic stiffness of the linear hull without spring and drive, N/m, by line."""
    return hull_dynamic_stiffness(axis.hull, axis.drivetrain_damping, grid.omega)


def hull_dynamic_stiffness(hull: BodyParams, drivetrain_damping: float, omega: Floats) -> Complexes:
    """Return the same at angular frequencies ``omega`` (rad/s); amplitudes of e^{+i omega t}."""
    s = np.asarray(1j * omega, dtype=np.complex128)
    num = [hull.b4, hull.b3, hull.b2, hull.b1, 0.0]
    den = [1.0, hull.a4, hull.a3, hull.a2, hull.a1, hull.a0]
    radiation = np.polyval(num, s) / np.polyval(den, s)
    damping = radiation + hull.viscous + drivetrain_damping
    return np.asarray(s * s * hull.inertia + s * damping + hull.hydrostatic, dtype=np.complex128)


def peak(values: Floats) -> Floats:
    """Return the largest magnitude in each row."""
    peaks: Floats = np.abs(values).max(axis=1)
    return peaks
