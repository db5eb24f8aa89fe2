"""Parametric models of an impedance: mass, damping and stiffness, or a passive one of higher order.

    Z(s) = M s + B + K/s + sum_k (c_k s + d_k)/(s^2 + a_k s + b_k)        (N*s/m)

Without the sum it is the second order of the published fits. Every part is a positive real function
(M, B, K, a, b, c >= 0, 0 <= d <= a c), and so is their sum: the model is passive at all frequencies
and its admittance Y = 1/Z stable, whatever the data are. That is all the passive functions of
this shape, not all passive functions; each section adds two states, as radiation needs them.

Fitted is the admittance, least squares over the lines: it is largest where the device moves most.
"""

from typing import NamedTuple

import numpy as np
from scipy import optimize

from rig.identification.periods import Complexes, Floats

ORDERS = (2, 4, 6, 8)
"""Orders of a model; each two above the second are a section."""

_FIRST = 2.0 * np.pi * np.array([0.45, 0.8, 0.25])  # rad/s, where sections begin to look
_GLANCE = 25  # evaluations to choose a beginning by
_LARGEST = 40.0  # of logarithms: what is beyond is no number of physics


class Section(NamedTuple):
    """(c s + d)/(s^2 + a s + b)."""

    a: float  # 1/s
    b: float  # 1/s^2
    c: float  # N
    d: float  # N/s


class Fitted(NamedTuple):
    """A fitted model and how well it fits."""

    mass: float  # kg
    damping: float  # N*s/m
    stiffness: float  # N/m
    sections: tuple[Section, ...]
    fit_percent: float  # 100 (1 - |Y - fit|/|Y - mean Y|), as the published scripts give it
    worst: float  # largest |Z - fit|/|Z|

    @property
    def order(self) -> int:
        """Of the admittance."""
        return 2 + 2 * len(self.sections)

    @property
    def natural_frequency(self) -> float:
        """Where Im Z is zero, Hz: sqrt(K/M)/(2 pi) of the second order."""
        if not self.sections:
            return float(np.sqrt(self.stiffness / self.mass) / (2.0 * np.pi))
        return zero_crossing(grid := np.linspace(0.05, 2.0, 3901), impedance(self, grid))


def impedance(model: Fitted, frequency: Floats) -> Complexes:
    """Z of the model (N*s/m) at frequencies (Hz) above 0."""
    s = 2j * np.pi * np.asarray(frequency)
    total = model.mass * s + model.damping + model.stiffness / s
    for a, b, c, d in model.sections:
        total = total + (c * s + d) / (s * s + a * s + b)
    return np.asarray(total, dtype=np.complex128)


def poles(model: Fitted) -> Complexes:
    """Poles of the admittance Y = 1/Z, 1/s."""
    # Z s prod(den) = (M s^2 + B s + K) prod(den) + s sum (c s + d) prod(other den)
    parts = [np.array([1.0, a, b]) for a, b, _, _ in model.sections]
    top = np.array([model.mass, model.damping, model.stiffness])
    for part in parts:
        top = np.polymul(top, part)
    for i, (_, _, c, d) in enumerate(model.sections):
        added = np.array([c, d, 0.0])
        for j, part in enumerate(parts):
            added = np.polymul(added, part) if j != i else added
        top = np.polyadd(top, added)
    return np.asarray(np.roots(top), dtype=np.complex128)


def zero_crossing(frequency: Floats, z: Complexes) -> float:
    """Where Im Z rises through zero, Hz, on a line between neighbours; NaN where it does not."""
    rises = np.flatnonzero((z.imag[:-1] < 0.0) & (z.imag[1:] >= 0.0))
    if not rises.size:
        return float("nan")
    i = int(rises[0])
    share = -z.imag[i] / (z.imag[i + 1] - z.imag[i])
    return float(frequency[i] + share * (frequency[i + 1] - frequency[i]))


def fit(frequency: Floats, z: Complexes, order: int = 2) -> Fitted:
    """The model of an order (2, 4, 6, 8) nearest to an impedance at frequencies (Hz).

    Raises ValueError for another order, or fewer lines than the model has numbers.
    """
    if order not in ORDERS:
        raise ValueError(f"order {order}: allowed {', '.join(map(str, ORDERS))}")
    numbers = 3 + 4 * (order // 2 - 1)
    if 2 * len(frequency) < numbers + 1:
        raise ValueError(f"{len(frequency)} lines cannot tell a model of order {order}")
    found = _second_order(frequency, z)
    for count in range(1, order // 2):
        found = _with_section(frequency, z, found, count)
    return found


def _second_order(frequency: Floats, z: Complexes) -> Fitted:
    """From the straight fit of Z, which is linear in M, B, K, to that of Y."""
    omega = 2.0 * np.pi * frequency
    columns = np.column_stack([omega, -1.0 / omega])
    weight = 1.0 / np.abs(z)
    mass, stiffness = np.linalg.lstsq(columns * weight[:, None], z.imag * weight, rcond=None)[0]
    damping = float(np.average(z.real, weights=weight * weight))
    least = 1e-3 * float(np.median(np.abs(z)))
    start = [max(mass, 1.0), max(damping, least), max(stiffness, 1.0)]
    return _nearest(frequency, z, np.log(start), 0)


def _with_section(frequency: Floats, z: Complexes, before: Fitted, count: int) -> Fitted:
    """One section more, from the best of several beginnings; never worse than without it."""
    known = _logarithms(before)
    best = before
    for middle in _FIRST:
        for size in (0.1, 0.5):
            force = size * before.damping * middle
            added = [np.log(middle), np.log(middle * middle), np.log(force), 0.0]
            made = _nearest(frequency, z, np.array([*known, *added]), count, _GLANCE)
            best = made if made.fit_percent > best.fit_percent else best
    if best is before:  # a section of no weight, so that the order is what was asked for
        return _with_none(before)
    return _nearest(frequency, z, _logarithms(best), count)


def _with_none(model: Fitted) -> Fitted:
    nothing = Section(float(_FIRST[0]), float(_FIRST[0] * _FIRST[0]), 0.0, 0.0)
    return model._replace(sections=(*model.sections, nothing))


def _logarithms(model: Fitted) -> Floats:
    """The model as free numbers: logarithms, and d/(a c) by its logit."""
    out = [np.log(model.mass), np.log(max(model.damping, 1e-9)), np.log(model.stiffness)]
    for a, b, c, d in model.sections:
        share = min(max(d / (a * c), 1e-9), 1.0 - 1e-9) if c > 0.0 else 0.5
        out += [np.log(a), np.log(b), np.log(max(c, 1e-9)), np.log(share / (1.0 - share))]
    return np.array(out)


def _model(numbers: Floats, count: int) -> Fitted:
    bounded = np.clip(numbers, -_LARGEST, _LARGEST)
    mass, damping, stiffness = np.exp(bounded[:3]).tolist()
    sections = []
    for i in range(count):
        a, b, c = np.exp(bounded[3 + 4 * i : 6 + 4 * i]).tolist()
        share = 1.0 / (1.0 + np.exp(-bounded[6 + 4 * i]))
        sections.append(Section(a, b, c, float(share) * a * c))
    return Fitted(mass, damping, stiffness, tuple(sections), np.nan, np.nan)


def _nearest(
    frequency: Floats, z: Complexes, start: Floats, count: int, evaluations: int = 300
) -> Fitted:
    admittance = 1.0 / z
    scale = float(np.sqrt(np.mean(np.abs(admittance) ** 2)))

    def misfit(numbers: Floats) -> Floats:
        error = (1.0 / impedance(_model(numbers, count), frequency) - admittance) / scale
        return np.concatenate([error.real, error.imag])

    solved = optimize.least_squares(
        misfit, start, xtol=1e-10, ftol=1e-10, gtol=1e-12, max_nfev=evaluations
    )
    found = _model(solved.x, count)
    made = impedance(found, frequency)
    spread = np.linalg.norm(admittance - admittance.mean())
    percent = 100.0 * (1.0 - np.linalg.norm(1.0 / made - admittance) / spread)
    worst = float(np.max(np.abs(made - z) / np.abs(z)))
    return found._replace(fit_percent=float(percent), worst=worst)
