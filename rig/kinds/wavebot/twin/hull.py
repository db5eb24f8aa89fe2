"""Identification of the hull: quadratic drag, inertia, damping, stiffness, radiation memory.

In calm water the column load cell measures the force on the hull alone:

    F_LCB = Z_i v + c |v| v,    Z_i = M s + B + K/s + R(s)

At each line, rows with different amplitudes or phases differ in the line of |v| v, which is
computed from the measured motion; c is the least-squares coefficient that explains the differences
over all lines. The radiation memory has the form of a plant file,

    R(s) = s (b4 s^3 + b3 s^2 + b2 s + b1)/((s^2 + a1 s + a0)(s^2 + c1 s + c0)(s + p))

For given poles, it is linear in the other parameters. The search for the poles starts from several
initial values; constraints keep the hull passive.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import optimize

from rig.identification.drag import drag_spectrum, estimate_drag, fit_impedance
from rig.kinds.wavebot.twin.group import Group, single_value
from rig.kinds.wavebot.twin.records import Record
from rig.spectra.periods import Complexes, Floats

NAMES = ("inertia", "viscous", "hydrostatic")
_INITIAL_POLES = (
    (3.0, 4.0, 5.0, 20.0, 4.0),
    (2.0, 5.0, 3.0, 14.0, 2.0),
    (4.0, 8.0, 6.0, 40.0, 1.5),
)
_SCALE = np.array([1.0e3, 3.0e2, 2.0e4, 4.0e3, 6.0e4, 5.0e5, 5.0e5])  # SI, linear parameters
_PASSIVITY_FREQUENCIES = np.geomspace(0.05, 200.0, 80)  # rad/s, at which the hull must be passive


class Radiation(NamedTuple):
    """R(s), highest power first, in the form of a plant file."""

    numerator: tuple[float, ...]  # s^4 to s
    denominator: tuple[float, ...]  # s^4 to s^0, leading 1 omitted


class Hull(NamedTuple):
    """Hull parameters identified in calm water."""

    linear: Group  # `NAMES`: kg with added mass at infinite frequency, N s/m, N/m
    quadratic: Group  # viscous_quadratic, N s^2/m^2
    radiation: Radiation
    frequency: Floats  # Hz, of the lines used
    impedance: Complexes  # N s/m at these lines, without quadratic drag
    worst: float  # largest |fit - impedance| / |impedance|

    def impedance_at(self, omega: Floats) -> Complexes:
        """Return Z_i of the fitted model at any angular frequency (rad/s), N s/m."""
        mass, damping, stiffness = self.linear.values
        s = 1j * omega
        denominator = np.polyval([1.0, *self.radiation.denominator], s)
        memory = np.polyval([*self.radiation.numerator, 0.0], s) / denominator
        return np.asarray(mass * s + damping + stiffness / s + memory, dtype=np.complex128)


def identify_hull(records: Sequence[Record]) -> Hull:
    """Identify the hull from rows in calm water with an open-loop reference.

    Raises ValueError if there are no such rows or too few lines.
    """
    rows = [record for record in records if record.has_excitation and record.sea is None]
    if not rows:
        raise ValueError("no row in calm water with an open-loop reference")
    rows = [record for record in rows if record.period == rows[0].period]
    lines = np.flatnonzero(np.all([record.excited for record in rows], axis=0))
    if lines.size < 7:
        raise ValueError(
            f"{lines.size} lines are too few for hull and radiation: at least 7 are needed"
        )
    velocity = np.array([record.velocity[lines] for record in rows])
    force = np.array([record.lcb[lines] for record in rows])
    drag = np.array([drag_spectrum(record.velocity)[lines] for record in rows])
    quadratic = _quadratic_group(velocity, force, drag)
    linear = np.asarray(force - quadratic.values[0] * drag, dtype=np.complex128)
    z = fit_impedance(linear, velocity)
    omega = rows[0].omega[lines]
    numbers, poles = _fit(omega, z)
    fitted = _columns(poles, omega) @ (numbers / _SCALE)
    numerator = tuple(numbers[3:].tolist())
    denominator = tuple(_denominator(poles)[1:].tolist())
    low, high = omega[[0, -1]] / (2.0 * np.pi)
    source = f"{len(rows)} rows, {lines.size} lines from {low:.3g} to {high:.3g} Hz"
    return Hull(
        Group(NAMES, tuple(numbers[:3].tolist()), _covariance(omega, z, fitted), source),
        quadratic,
        Radiation(numerator, denominator),
        omega / (2.0 * np.pi),
        z,
        float(np.max(np.abs(fitted - z) / np.abs(z))),
    )


def _quadratic_group(velocity: Complexes, force: Complexes, drag: Complexes) -> Group:
    """Return the drag coefficient as a group; its value is 0 if not significant."""
    name, estimate = "viscous_quadratic", estimate_drag(velocity, force, drag)
    if not estimate.observable:
        return single_value(name, 0.0, 0.0, "one row: drag is part of the linear damping")
    source = f"{velocity.shape[0]} rows of one to several amplitudes, lines of |v| v"
    source += "" if estimate.value else ": not significant"
    return single_value(name, estimate.value, estimate.deviation, source)


def _denominator(poles: Floats) -> Floats:
    a1, a0, c1, c0, p = np.exp(poles)
    polynomial = np.polymul(np.polymul([1.0, a1, a0], [1.0, c1, c0]), [1.0, p])
    return np.asarray(polynomial, dtype=np.float64)


def _columns(poles: Floats, omega: Floats) -> Complexes:
    """Return the regressors of Z for the linear parameters at the lines, in units of `_SCALE`."""
    s = 1j * omega
    denominator = np.polyval(_denominator(poles), s)
    parts = [s, np.ones_like(s), 1.0 / s, *(s**k / denominator for k in (4, 3, 2, 1))]
    return np.asarray(np.array(parts).T * _SCALE, dtype=np.complex128)


def _fit(omega: Floats, z: Complexes) -> tuple[Floats, Floats]:
    """Return the linear parameters (M, B, K, b4 .. b1) and logarithms of a1, a0, c1, c0, p."""
    lowest_cost, best_poles = np.inf, np.zeros(5)
    for initial in _INITIAL_POLES:
        start = np.log(np.array(initial))

        def misfit(poles: Floats, start: Floats = start) -> Floats:
            _, fit_error, bound_values = _solve(poles, omega, z)
            # Weak regularisation: poles that the data do not determine keep their initial values.
            return np.concatenate(
                [fit_error, 0.3 * np.minimum(bound_values, 0.0), 1e-4 * (poles - start)]
            )

        solution = optimize.least_squares(misfit, start, max_nfev=150)
        if solution.cost < lowest_cost:
            lowest_cost, best_poles = float(solution.cost), np.asarray(solution.x)
    return _solve(best_poles, omega, z)[0] * _SCALE, best_poles


def _solve(poles: Floats, omega: Floats, z: Complexes) -> tuple[Floats, Floats, Floats]:
    """Return the best linear parameters for given poles, relative errors, and bound values.

    Bounds: the hull is passive at all frequencies; the memory is passive at high frequency, as
    plant files require; inertia, damping and stiffness are positive. A violated bound is added to
    the least-squares problem as a penalty row.
    """
    weighted = _columns(poles, omega) / np.abs(z)[:, None]
    normalised = z / np.abs(z)
    regressors = np.concatenate([weighted.real, weighted.imag])
    target = np.concatenate([normalised.real, normalised.imag])
    high_frequency = np.zeros(7)
    high_frequency[3], high_frequency[4] = _denominator(poles)[1] * _SCALE[3], -_SCALE[4]
    energy = _columns(poles, _PASSIVITY_FREQUENCIES).real / 1.0e3
    bounds = np.concatenate([energy, [high_frequency / 6.0e4], np.eye(7)[:3]])
    active = np.zeros(len(bounds), dtype=np.bool_)
    numbers = np.zeros(7)
    for _ in range(8):
        rows = np.concatenate([regressors, 3.0 * bounds[active]])
        right_hand_side = np.concatenate([target, np.zeros(int(active.sum()))])
        numbers = np.linalg.lstsq(rows, right_hand_side, rcond=None)[0]
        violated = (bounds @ numbers < -1e-6) & ~active
        if not violated.any():
            break
        active |= violated
    return numbers, regressors @ numbers - target, bounds @ numbers


def _covariance(omega: Floats, z: Complexes, fitted: Complexes) -> Floats:
    """Return the covariance of inertia, damping and stiffness from the residuals of the fit."""
    weighted = (
        np.array([1j * omega, np.ones_like(omega), 1.0 / (1j * omega)]).T / np.abs(z)[:, None]
    )
    regressors = np.concatenate([weighted.real, weighted.imag])
    relative_error = np.abs(fitted - z) / np.abs(z)
    variance = float(np.sum(relative_error * relative_error)) / max(2 * omega.size - 12, 1)
    return np.asarray(variance * np.linalg.pinv(regressors.T @ regressors), dtype=np.float64)
