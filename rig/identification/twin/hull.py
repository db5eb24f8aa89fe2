"""The hull: quadratic drag from amplitudes, then inertia, damping, stiffness and radiation memory.

In calm water the column load cell pushes the hull alone:

    F_LCB = Z_i v + c |v| v,    Z_i = M s + B + K/s + R(s)

At each line, rows of other amplitude or phases differ in the share of the line of |v| v, which is
computed from the measured motion; c is what explains the differences, least squares over all lines.
R(s) = s (b4 s^3 + b3 s^2 + b2 s + b1)/((s^2 + a1 s + a0)(s^2 + c1 s + c0)(s + p)) is the radiation
memory in the shape that a plant file has. For given poles it is linear in all else; poles are
searched from several beginnings, and what would make the hull give energy is pushed out.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import optimize

from rig.identification.drag import along, coefficient, lines_of_drag
from rig.identification.periods import Complexes, Floats
from rig.identification.twin.group import Group
from rig.identification.twin.records import Record

NAMES = ("inertia", "viscous", "hydrostatic")
_BEGINNINGS = ((3.0, 4.0, 5.0, 20.0, 4.0), (2.0, 5.0, 3.0, 14.0, 2.0), (4.0, 8.0, 6.0, 40.0, 1.5))
_SCALE = np.array([1.0e3, 3.0e2, 2.0e4, 4.0e3, 6.0e4, 5.0e5, 5.0e5])  # SI, of the linear numbers
_WATCHED = np.geomspace(0.05, 200.0, 80)  # rad/s, where the hull must not give energy


class Radiation(NamedTuple):
    """R(s), highest power first, as a plant file has it."""

    numerator: tuple[float, ...]  # s^4 to s
    denominator: tuple[float, ...]  # s^4 to s^0, leading 1 omitted


class Hull(NamedTuple):
    """What calm water tells of the hull."""

    linear: Group  # `NAMES`: kg with added mass at infinite frequency, N s/m, N/m
    quadratic: Group  # viscous_quadratic, N s^2/m^2
    radiation: Radiation
    frequency: Floats  # Hz, lines that were used
    impedance: Complexes  # N s/m there, without quadratic drag
    worst: float  # largest |fit - impedance| / |impedance|


def hull(records: Sequence[Record]) -> Hull:
    """The hull from pushed rows in calm water.

    Raises ValueError where they are none, or have too few lines.
    """
    used = [one for one in records if one.has_excitation and one.sea is None]
    if not used:
        raise ValueError("no row in calm water with an open-loop reference")
    used = [one for one in used if one.period == used[0].period]
    lines = np.flatnonzero(np.all([one.excited for one in used], axis=0))
    if lines.size < 7:
        raise ValueError(f"{lines.size} lines cannot tell hull and radiation; at least 7 do")
    velocity = np.array([one.velocity[lines] for one in used])
    force = np.array([one.lcb[lines] for one in used])
    drag = np.array([lines_of_drag(one.velocity)[lines] for one in used])
    quadratic = _quadratic(velocity, force, drag)
    linear = np.asarray(force - quadratic.values[0] * drag, dtype=np.complex128)
    z = along(linear, velocity)
    omega = used[0].omega[lines]
    numbers, poles = _fit(omega, z)
    told = _impedance(numbers, poles, omega)
    top = tuple(numbers[3:].tolist())
    below = tuple(_denominator(poles)[1:].tolist())
    source = f"{len(used)} rows, {lines.size} lines from {_span(omega)} Hz"
    return Hull(
        Group(NAMES, tuple(numbers[:3].tolist()), _covariance(omega, z, told), source),
        quadratic,
        Radiation(top, below),
        omega / (2.0 * np.pi),
        z,
        float(np.max(np.abs(told - z) / np.abs(z))),
    )


def _span(omega: Floats) -> str:
    low, high = omega[[0, -1]] / (2.0 * np.pi)
    return f"{low:.3g} to {high:.3g}"


def _quadratic(velocity: Complexes, force: Complexes, drag: Complexes) -> Group:
    """Drag coefficient from what velocity alone does not explain; 0 where it is not sure."""
    name, found = ("viscous_quadratic",), coefficient(velocity, force, drag)
    if not found.told:
        return Group(name, (0.0,), np.zeros((1, 1)), "one row: drag stands in the linear damping")
    source = f"{velocity.shape[0]} rows of one to several amplitudes, lines of |v| v"
    seen = source if found.value else f"{source}: none to be seen"
    return Group(name, (found.value,), np.array([[found.deviation**2]]), seen)


def _denominator(poles: Floats) -> Floats:
    a1, a0, c1, c0, p = np.exp(poles)
    whole = np.polymul(np.polymul([1.0, a1, a0], [1.0, c1, c0]), [1.0, p])
    return np.asarray(whole, dtype=np.float64)


def _columns(poles: Floats, omega: Floats) -> Complexes:
    """What each linear number gives of Z at the lines, in units of `_SCALE`."""
    s = 1j * omega
    below = np.polyval(_denominator(poles), s)
    parts = [s, np.ones_like(s), 1.0 / s, *(s**k / below for k in (4, 3, 2, 1))]
    return np.asarray(np.array(parts).T * _SCALE, dtype=np.complex128)


def _impedance(numbers: Floats, poles: Floats, omega: Floats) -> Complexes:
    return np.asarray(_columns(poles, omega) @ (numbers / _SCALE), dtype=np.complex128)


def _fit(omega: Floats, z: Complexes) -> tuple[Floats, Floats]:
    """Linear numbers (M, B, K, b4 .. b1) and logarithms of a1, a0, c1, c0, p."""
    best, found = np.inf, np.zeros(5)
    for beginning in _BEGINNINGS:
        start = np.log(np.array(beginning))

        def misfit(poles: Floats, start: Floats = start) -> Floats:
            _, error, room = _solve(poles, omega, z)
            # A faint pull to where it began: poles that the data do not know stay put.
            return np.concatenate([error, 0.3 * np.minimum(room, 0.0), 1e-4 * (poles - start)])

        solved = optimize.least_squares(misfit, start, max_nfev=150)
        if solved.cost < best:
            best, found = float(solved.cost), np.asarray(solved.x)
    return _solve(found, omega, z)[0] * _SCALE, found


def _solve(poles: Floats, omega: Floats, z: Complexes) -> tuple[Floats, Floats, Floats]:
    """Best linear numbers for given poles, relative errors, and how far each bound is kept.

    Bounds: the hull gives no energy at any frequency; the memory is passive at high ones, as plant
    files ask; inertia, damping and stiffness are positive. A broken one is pulled back.
    """
    weighed = _columns(poles, omega) / np.abs(z)[:, None]
    goal = z / np.abs(z)
    whole = np.concatenate([weighed.real, weighed.imag])
    wanted = np.concatenate([goal.real, goal.imag])
    steep = np.zeros(7)
    steep[3], steep[4] = _denominator(poles)[1] * _SCALE[3], -_SCALE[4]
    energy = _columns(poles, _WATCHED).real / 1.0e3
    bounds = np.concatenate([energy, [steep / 6.0e4], np.eye(7)[:3]])
    pulled = np.zeros(len(bounds), dtype=np.bool_)
    numbers = np.zeros(7)
    for _ in range(8):
        rows = np.concatenate([whole, 3.0 * bounds[pulled]])
        right = np.concatenate([wanted, np.zeros(int(pulled.sum()))])
        numbers = np.linalg.lstsq(rows, right, rcond=None)[0]
        broken = (bounds @ numbers < -1e-6) & ~pulled
        if not broken.any():
            break
        pulled |= broken
    return numbers, whole @ numbers - wanted, bounds @ numbers


def _covariance(omega: Floats, z: Complexes, told: Complexes) -> Floats:
    """Of inertia, damping and stiffness, by what the fit leaves of the lines."""
    weighed = np.array([1j * omega, np.ones_like(omega), 1.0 / (1j * omega)]).T / np.abs(z)[:, None]
    whole = np.concatenate([weighed.real, weighed.imag])
    left = np.abs(told - z) / np.abs(z)
    variance = float(np.sum(left * left)) / max(2 * omega.size - 12, 1)
    return np.asarray(variance * np.linalg.pinv(whole.T @ whole), dtype=np.float64)
