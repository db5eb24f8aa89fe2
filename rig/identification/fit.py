"""Parametric models of an impedance: mass, damping, stiffness, or a passive model of higher order.

    Z(s) = M s + B + K/s + sum_k (c_k s + d_k)/(s^2 + a_k s + b_k)        (N*s/m)

Without the sum it is the second-order model of the published fits. Every part is a positive real
function (M, B, K, a, b, c >= 0, 0 <= d <= a c), and so is their sum: the model is passive at all
frequencies and its admittance Y = 1/Z is stable for any data. These are all passive functions of
this form, not all passive functions. Each section adds two states, as radiation needs.

The fit minimises the squared error of the admittance over the lines, because the admittance is
largest where the device moves most. The intervals of M, B and K follow from the misfit, which is
that of the form where noise is small: they are no intervals of physical constants.
"""

from typing import NamedTuple

import numpy as np
from scipy import optimize
from scipy.special import stdtrit

from rig.spectra.periods import Complexes, Floats

ORDERS = (2, 4, 6, 8)
"""Allowed orders of a model; every two above the second add a section."""

_START_FREQUENCIES = 2.0 * np.pi * np.array([0.45, 0.8, 0.25])  # rad/s, of a new section
_SCREENING_EVALUATIONS = 25  # evaluations per initial point when choosing the best one
_MAX_LOGARITHM = 40.0  # bound on logarithms of parameters, far beyond physical values


class Section(NamedTuple):
    """(c s + d)/(s^2 + a s + b)."""

    a: float  # 1/s
    b: float  # 1/s^2
    c: float  # N
    d: float  # N/s


class FittedImpedance(NamedTuple):
    """A fitted model and its goodness of fit."""

    mass: float  # kg
    damping: float  # N*s/m
    stiffness: float  # N/m
    sections: tuple[Section, ...]
    fit_percent: float  # 100 (1 - |Y - fit|/|Y - mean Y|), as in the published scripts
    worst: float  # largest |Z - fit|/|Z|
    intervals: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    """Half-widths of the 95 % intervals of M, B and K; NaN where the lines do not determine them.
    """

    @property
    def order(self) -> int:
        """Order of the admittance."""
        return 2 + 2 * len(self.sections)

    @property
    def natural_frequency(self) -> float:
        """Frequency at which Im Z is zero, Hz: sqrt(K/M)/(2 pi) for the second order."""
        if not self.sections:
            return float(np.sqrt(self.stiffness / self.mass) / (2.0 * np.pi))
        return zero_crossing(grid := np.linspace(0.05, 2.0, 3901), impedance(self, grid))


def impedance(model: FittedImpedance, frequency: Floats) -> Complexes:
    """Return Z of the model (N*s/m) at frequencies (Hz) above 0."""
    s = 2j * np.pi * np.asarray(frequency)
    total = model.mass * s + model.damping + model.stiffness / s
    for a, b, c, d in model.sections:
        total = total + (c * s + d) / (s * s + a * s + b)
    return np.asarray(total, dtype=np.complex128)


def zero_crossing(frequency: Floats, z: Complexes) -> float:
    """Return the frequency (Hz) at which Im Z rises through zero; NaN if it does not.

    The value is interpolated linearly between lines.
    """
    rises = np.flatnonzero((z.imag[:-1] < 0.0) & (z.imag[1:] >= 0.0))
    if not rises.size:
        return float("nan")
    i = int(rises[0])
    share = -z.imag[i] / (z.imag[i + 1] - z.imag[i])
    return float(frequency[i] + share * (frequency[i + 1] - frequency[i]))


def fit(frequency: Floats, z: Complexes, order: int = 2) -> FittedImpedance:
    """Fit a model of an order (2, 4, 6, 8) to an impedance at frequencies (Hz).

    Raises ValueError for another order, or for fewer lines than the model needs.
    """
    if order not in ORDERS:
        raise ValueError(f"order {order}: allowed {', '.join(map(str, ORDERS))}")
    parameter_count = 3 + 4 * (order // 2 - 1)
    if 2 * len(frequency) < parameter_count + 1:
        raise ValueError(
            f"{len(frequency)} lines are too few for a model of order {order},"
            f" which has {parameter_count} parameters"
        )
    model = _second_order(frequency, z)
    for section_count in range(1, order // 2):
        model = _with_section(frequency, z, model, section_count)
    return model


def _second_order(frequency: Floats, z: Complexes) -> FittedImpedance:
    """Fit Y, starting from the fit of Z, which is linear in M, B and K."""
    omega = 2.0 * np.pi * frequency
    regressors = np.column_stack([omega, -1.0 / omega])
    weight = 1.0 / np.abs(z)
    mass, stiffness = np.linalg.lstsq(regressors * weight[:, None], z.imag * weight, rcond=None)[0]
    damping = float(np.average(z.real, weights=weight * weight))
    min_damping = 1e-3 * float(np.median(np.abs(z)))
    start = [max(mass, 1.0), max(damping, min_damping), max(stiffness, 1.0)]
    return _fit_admittance(frequency, z, np.log(start), 0)


def _with_section(
    frequency: Floats, z: Complexes, previous: FittedImpedance, section_count: int
) -> FittedImpedance:
    """Add a section, from the best of several starting points; never worse than without it."""
    start = _to_parameters(previous)
    best = previous
    for centre in _START_FREQUENCIES:
        for scale in (0.1, 0.5):
            force = scale * previous.damping * centre
            section = [np.log(centre), np.log(centre * centre), np.log(force), 0.0]
            parameters = np.array([*start, *section])
            candidate = _fit_admittance(
                frequency, z, parameters, section_count, _SCREENING_EVALUATIONS
            )
            best = candidate if candidate.fit_percent > best.fit_percent else best
    if best is previous:  # add a section of zero weight to reach the requested order
        centre = float(_START_FREQUENCIES[0])
        empty = Section(centre, centre * centre, 0.0, 0.0)
        return previous._replace(sections=(*previous.sections, empty))
    return _fit_admittance(frequency, z, _to_parameters(best), section_count)


def _to_parameters(model: FittedImpedance) -> Floats:
    """Return the unconstrained parameters of a model: logarithms, and the logit of d/(a c)."""
    parameters = [np.log(model.mass), np.log(max(model.damping, 1e-9)), np.log(model.stiffness)]
    for a, b, c, d in model.sections:
        share = min(max(d / (a * c), 1e-9), 1.0 - 1e-9) if c > 0.0 else 0.5
        parameters += [np.log(a), np.log(b), np.log(max(c, 1e-9)), np.log(share / (1.0 - share))]
    return np.array(parameters)


def _from_parameters(parameters: Floats, section_count: int) -> FittedImpedance:
    clipped = np.clip(parameters, -_MAX_LOGARITHM, _MAX_LOGARITHM)
    mass, damping, stiffness = np.exp(clipped[:3]).tolist()
    sections = []
    for i in range(section_count):
        a, b, c = np.exp(clipped[3 + 4 * i : 6 + 4 * i]).tolist()
        share = 1.0 / (1.0 + np.exp(-clipped[6 + 4 * i]))
        sections.append(Section(a, b, c, float(share) * a * c))
    return FittedImpedance(mass, damping, stiffness, tuple(sections), np.nan, np.nan)


def _fit_admittance(
    frequency: Floats, z: Complexes, start: Floats, section_count: int, evaluations: int = 300
) -> FittedImpedance:
    admittance = 1.0 / z
    scale = float(np.sqrt(np.mean(np.abs(admittance) ** 2)))

    def misfit(parameters: Floats) -> Floats:
        error = (
            1.0 / impedance(_from_parameters(parameters, section_count), frequency) - admittance
        ) / scale
        return np.concatenate([error.real, error.imag])

    solution = optimize.least_squares(
        misfit, start, xtol=1e-10, ftol=1e-10, gtol=1e-12, max_nfev=evaluations
    )
    model = _from_parameters(solution.x, section_count)
    fitted = impedance(model, frequency)
    variation = np.linalg.norm(admittance - admittance.mean())
    fit_percent = 100.0 * (1.0 - np.linalg.norm(1.0 / fitted - admittance) / variation)
    worst = float(np.max(np.abs(fitted - z) / np.abs(z)))
    intervals = _intervals(model, solution.jac, solution.fun)
    return model._replace(fit_percent=float(fit_percent), worst=worst, intervals=intervals)


def _intervals(
    model: FittedImpedance, jacobian: Floats, misfit: Floats
) -> tuple[float, float, float]:
    """Return the half-widths of the 95 % intervals of M, B and K by linear regression.

    ``jacobian`` is that of the misfit by the logarithms of M, B and K and the sections' parameters.
    """
    degrees = misfit.size - jacobian.shape[1]
    if degrees < 1 or np.linalg.matrix_rank(jacobian) < jacobian.shape[1]:
        return (np.nan, np.nan, np.nan)
    covariance = np.linalg.inv(jacobian.T @ jacobian) * float(misfit @ misfit) / degrees
    relative = float(stdtrit(degrees, 0.975)) * np.sqrt(np.diag(covariance)[:3])
    mass, damping, stiffness = relative.tolist()
    return mass * model.mass, damping * model.damping, stiffness * model.stiffness
