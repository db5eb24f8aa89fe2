"""Passive state spaces of the radiation memory, fitted to the impedance of a BEM file.

K_r(i omega) = B + i omega (A - A_inf) is fitted by sum_k R_k / (s - p_k) with poles common to a
block of coupled modes and symmetric residues: vector fitting places the poles, and a least-squares
problem with linear inequalities gives the residues. It also gives a small correction of A_inf: a
BEM program's value belongs to another mesh resolution than the rest, and i omega times its error
would be fitted as memory. K_r(0) = 0 holds exactly, the poles are stable,
and Re K_r(i omega) has no negative eigenvalue: violated directions are added as inequalities until
none is left on a dense grid of frequencies and at both limits.

Sources: B. Gustavsen and A. Semlyen, IEEE Trans. Power Delivery 14(3), 1999 (poles);
T. Perez and T. I. Fossen, Modeling, Identification and Control 30(1), 2009 (properties of K_r);
C. L. Lawson and R. J. Hanson, Solving Least Squares Problems, chapter 23 (inequalities).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import nnls

from sim_plant.modes.bem import BemModes, impedance
from sim_plant.modes.bem_content import Floats

Complexes = NDArray[Any]  # complex128
Mask = NDArray[np.bool_]

TOLERANCE = 0.01  # of the peak, in the wave band: the smallest order below it is chosen
NEAR_BEST = 1.25  # times the rms error of the best: without one below, the smallest such order
WAVE_BAND = 0.05  # of the largest damping: the frequencies between the first and last above it
OUTSIDE_WEIGHT = 0.25  # of frequencies outside the wave band
MAX_ORDER = 12  # states for each mode
SMOOTH_ORDER = 8  # of the fit by which irregular frequencies are found
MAX_ERROR = 0.10  # of the peak: a worse fit is refused
ACCURACY = 0.02  # of an added mass from a BEM program
COUPLED = 0.5 * TOLERANCE  # of the diagonal's peaks: a smaller term in the wave band is noise
ITERATIONS = 20  # of the placement of poles
REWEIGHTINGS = 6  # of the residues, towards the smallest largest error in the wave band
WITHIN_REACH = 2.0  # times the tolerance: more is not gained by reweighting
OUTLIER = 0.03  # of the peak, and OUTLIER_RATIO times the median error: an irregular frequency
OUTLIER_RATIO = 8.0
MAX_OUTLIERS = 0.2  # of all frequencies
CUTS = 40  # rounds of the enforcement of passivity
FINER = 65  # points between the neighbours of a minimum of the damping
MAX_POLE = 3.0  # times the highest frequency: a faster pole would only slow the simulation
MIN_DAMPING = 0.05  # damping ratio of a pole: what is narrower is an irregular frequency
MARGIN = 1.0e-4  # of the largest damping, where the curve is enforced


class Radiation(NamedTuple):
    """State space z' = diagonal z + cross z[partner] + input v[source], force = -(output z).

    Source, partner, diagonal, cross and input have one entry for each state; output is (n, states).
    """

    source: tuple[int, ...]  # mode whose velocity drives the state
    partner: tuple[int, ...]  # the other state of a complex pair, the state itself of a real pole
    diagonal: Floats  # 1/s
    cross: Floats  # 1/s
    input: Floats
    output: Floats
    error: Floats  # (n, n), largest error in the wave band by `error_scale`
    left_out: Floats  # Hz, irregular frequencies of the BEM file, which are not fitted
    added_mass: Floats  # (n, n), correction of A_inf, kg, kg m or kg m2


class Block(NamedTuple):
    """Poles (of each complex pair the one with positive imaginary part) and real residues.

    A residue of a real pole is one matrix; a complex pair has two, the real and imaginary part.
    """

    poles: Complexes
    residues: Floats  # (order, m, m)
    mass: Floats  # (m, m), the term i omega mass / (highest omega)


def fit(bem: BemModes, tolerance: float = TOLERANCE) -> Radiation:
    """Return the state space of all modes; ValueError if a block cannot be fitted."""
    target = impedance(bem)
    count = len(bem.modes)
    omega = 2.0 * np.pi * bem.frequency
    scale = np.sqrt(error_scale(bem, target))
    normalised = target / np.outer(scale, scale)
    kept = regular_frequencies(omega, normalised)
    band = wave_band(normalised[kept])
    added_mass = np.zeros((count, count))
    source: list[int] = []
    partner: list[int] = []
    columns: list[Floats] = []
    numbers: list[tuple[float, float, float]] = []
    for modes in coupled_blocks(np.abs(normalised[kept][band]).max(axis=0)):
        own = normalised[kept][:, modes][:, :, modes]
        block, error = _fit_block(omega[kept], own, band, tolerance)
        if error > MAX_ERROR:
            names = ", ".join(bem.modes[m] for m in modes)
            raise ValueError(
                f"the radiation of {names} is fitted with an error of {error:.1%} of its peak by "
                f"{MAX_ORDER} states; allowed: {MAX_ERROR:.0%} (are there irregular frequencies "
                "in the BEM file, or too few of them?)"
            )
        added_mass[np.ix_(modes, modes)] = block.mass / omega[kept][-1]
        at = 0
        for pole in block.poles:
            width = 1 if pole.imag == 0.0 else 2
            for k, mode in enumerate(modes):
                first = len(source)
                for part in range(width):
                    column = np.zeros(count)
                    column[modes] = block.residues[at + part][:, k] * scale[modes] * scale[mode]
                    columns.append(column)
                    source.append(mode)
                    partner.append(first + (width - 1 - part))
                    cross = 0.0 if width == 1 else pole.imag * (1.0 if part == 0 else -1.0)
                    enters = (1.0 if width == 1 else 2.0) if part == 0 else 0.0
                    numbers.append((pole.real, cross, enters))
            at += width
    diagonal, cross_terms, entries = np.array(numbers).T
    radiation = Radiation(
        tuple(source),
        tuple(partner),
        diagonal,
        cross_terms,
        entries,
        np.array(columns).T,
        np.zeros((count, count)),
        np.delete(bem.frequency, kept),
        added_mass * np.outer(scale, scale),
    )
    inside = kept[band]
    gap = np.abs(total_response(radiation, omega[inside]) - target[inside]).max(axis=0)
    return radiation._replace(error=gap / np.outer(scale, scale))


def error_scale(bem: BemModes, target: Complexes) -> Floats:
    """Return what the errors of each mode are measured by, N s/m or N m s: the peak of K_r.

    At least it is `ACCURACY` of the impedance of the added mass at the end of the wave band: a deep
    body radiates hardly any waves, and its K_r is a small difference of numbers with that error.
    """
    omega = 2.0 * np.pi * bem.frequency
    peak = np.einsum("ii->i", np.abs(target).max(axis=0))
    highest = omega[wave_band(target)][-1]
    least = np.maximum(ACCURACY * highest * np.diag(bem.added_mass_infinite), 1e-12 * peak.max())
    scale: Floats = np.maximum(peak, least)
    return scale


def response(radiation: Radiation, omega: Floats) -> Complexes:
    """Return K_r(i omega) of a state space, (omega, n, n)."""
    states, count = len(radiation.source), radiation.output.shape[0]
    system = np.diag(radiation.diagonal).astype(np.complex128)
    system[range(states), radiation.partner] += radiation.cross
    drive = np.zeros((states, count))
    drive[range(states), radiation.source] = radiation.input
    identity = np.eye(states)
    return np.array([radiation.output @ np.linalg.solve(1j * w * identity - system, drive)
                     for w in omega])  # fmt: skip


def total_response(radiation: Radiation, omega: Floats) -> Complexes:
    """Return K_r of a state space with the correction of A_inf, to compare with a file's own."""
    correction = 1j * omega[:, None, None] * radiation.added_mass
    total: Complexes = response(radiation, omega) + correction
    return total


def wave_band(target: Complexes) -> Mask:
    """Return a mask of the frequencies at which some mode radiates notable waves.

    By magnitude, because the damping of a deep body is rounding, which may be negative throughout.
    """
    damping = np.abs(np.einsum("wii->wi", target).real)
    notable = np.flatnonzero((damping >= WAVE_BAND * damping.max(axis=0)).any(axis=1))
    indices = np.arange(target.shape[0])
    mask: Mask = (indices >= notable[0]) & (indices <= notable[-1])
    return mask


def regular_frequencies(omega: Floats, target: Complexes) -> NDArray[np.intp]:
    """Return the indices of the frequencies that one smooth fit of the diagonal explains.

    A hull without a lid has irregular frequencies, where a BEM program's result is wrong in one or
    two narrow points. They are found by leaving out what a fit with damped poles misses.
    """
    diagonal = np.einsum("wii->wi", target)
    kept = np.arange(omega.size)
    for _ in range(6):
        poles = _place_poles(omega[kept], diagonal[kept], SMOOTH_ORDER, np.ones(kept.size))
        part = _basis(1j * omega[kept], poles)
        system = np.vstack([part.real, part.imag])
        right = np.vstack([diagonal[kept].real, diagonal[kept].imag])
        coefficients = np.linalg.lstsq(system, right, rcond=None)[0]
        error = np.abs(_basis(1j * omega, poles) @ coefficients - diagonal).max(axis=1)
        inside = np.flatnonzero(error <= max(OUTLIER, OUTLIER_RATIO * float(np.median(error))))
        if np.array_equal(inside, kept):
            return kept
        if inside.size < (1.0 - MAX_OUTLIERS) * omega.size:
            break
        kept = inside
    return np.arange(omega.size) if kept.size < (1.0 - MAX_OUTLIERS) * omega.size else kept


def coupled_blocks(strength: Floats) -> list[list[int]]:
    """Return the sets of modes that are connected by terms of a normalised matrix."""
    left = list(range(strength.shape[0]))
    blocks = []
    while left:
        block, queue = [], [left[0]]
        while queue:
            mode = queue.pop()
            if mode in left:
                left.remove(mode)
                block.append(mode)
                queue += [other for other in left if strength[mode, other] > COUPLED]
        blocks.append(sorted(block))
    return blocks


def _fit_block(
    omega: Floats, target: Complexes, band: Mask, tolerance: float
) -> tuple[Block, float]:
    """Return the fit of the smallest sufficient order and its error.

    Sufficient is an error of the tolerance or, where noise in the file allows none, a root mean
    square of `NEAR_BEST` times the best.
    """
    found: list[tuple[Block, float]] = []
    scatter: list[float] = []
    upper = np.triu_indices(target.shape[1])
    start = np.where(band, 1.0, OUTSIDE_WEIGHT)
    for order in range(2, MAX_ORDER + 1):
        poles = _place_poles(omega, target[:, upper[0], upper[1]], order, start)
        plain = _reweighted(omega, target, band, poles, 0, tolerance)
        if plain is None:
            continue
        found.append(plain)
        scatter.append(float(np.linalg.norm((_evaluate(plain[0], omega) - target)[band])))
        if plain[1] <= WITHIN_REACH * tolerance:
            best = _reweighted(omega, target, band, poles, REWEIGHTINGS, tolerance)
            if best is not None and best[1] <= tolerance:
                return best
    if not found:
        raise ValueError("no passive fit of the radiation; check the damping in the BEM file")
    # The smallest largest error would follow the noise: least squares serve better.
    bound = NEAR_BEST * min(scatter)
    return next(each for each, norm in zip(found, scatter, strict=True) if norm <= bound)


def _reweighted(
    omega: Floats, target: Complexes, band: Mask, poles: Complexes, rounds: int, tolerance: float
) -> tuple[Block, float] | None:
    """Return the residues with the smallest largest error in the wave band, and that error.

    Each round raises the weight of the frequencies with large errors, until the tolerance holds.
    """
    weight = np.where(band, 1.0, OUTSIDE_WEIGHT)
    best: tuple[Block, float] | None = None
    for _ in range(1 + rounds):
        block = _residues(omega, target, poles, weight)
        if block is None:
            break
        error = np.abs(_evaluate(block, omega) - target).max(axis=(1, 2))
        largest = float(error[band].max())
        if best is None or largest < best[1]:
            best = block, largest
        if largest <= tolerance:
            break
        weight = weight * np.sqrt(np.maximum(error / largest, 0.05))
        weight = np.where(band, weight / weight[band].max(), np.minimum(weight, OUTSIDE_WEIGHT))
    return best


def _basis(s: Complexes, poles: Sequence[complex] | Complexes) -> Complexes:
    """Return the partial fractions of real coefficients: one of a real pole, two of a pair."""
    columns = []
    for pole in poles:
        if pole.imag == 0.0:
            columns.append(1.0 / (s - pole))
        else:
            one, other = 1.0 / (s - pole), 1.0 / (s - np.conj(pole))
            columns += [one + other, 1j * (one - other)]
    return np.array(columns).T


def _zero_at_rest(poles: Sequence[complex] | Complexes) -> Floats:
    """Return the coefficients with K(0) = 0: the null space of the basis at s = 0, in columns."""
    at_zero = _basis(np.zeros(1, np.complex128), poles).real
    free: Floats = np.linalg.svd(at_zero)[2][1:].T
    return free


def _place_poles(omega: Floats, columns: Complexes, order: int, weight: Floats) -> Complexes:
    """Return stable poles by vector fitting of all columns together, each with K(0) = 0."""
    curves = columns.T
    low, high = max(omega[0], 0.1 * omega[-1]), 0.7 * omega[-1]
    poles = [complex(-0.3 * w, w) for w in np.linspace(low, high, order // 2)]
    poles += [complex(-high, 0.0)] * (order % 2)
    s = 1j * omega
    for _ in range(ITERATIONS):
        basis = _basis(s, poles)
        numerator = np.hstack([basis @ _zero_at_rest(poles), s[:, None] / omega[-1]])
        free = numerator.shape[1]
        rows = []
        # Relaxed non-triviality: sigma = d + sum c phi with mean real part 1. QR of each curve's
        # own columns leaves only the equations of sigma's unknowns.
        for curve in curves:
            sigma = -curve[:, None] * np.hstack([basis, np.ones((s.size, 1))])
            system = np.hstack([numerator, sigma]) * weight[:, None]
            real = np.vstack([system.real, system.imag])
            _, triangle = np.linalg.qr(real)
            rows.append(triangle[free:, free:])
        relaxation = float(np.linalg.norm(curves)) / s.size
        mean = np.concatenate([basis.real.sum(axis=0), [s.size]])
        matrix = np.vstack([*rows, relaxation * mean])
        right = np.zeros(matrix.shape[0])
        right[-1] = relaxation * s.size
        scale = np.linalg.norm(matrix, axis=0)
        scale[scale == 0.0] = 1.0
        found = np.linalg.lstsq(matrix / scale, right, rcond=None)[0] / scale
        constant = found[-1] if abs(found[-1]) > 1.0e-8 else 1.0e-8
        poles = _zeros(poles, found[:-1] / constant, MAX_POLE * omega[-1])
    return np.array(poles)


def _zeros(poles: Sequence[complex], coefficients: Floats, largest: float) -> list[complex]:
    """Return the zeros of 1 + sum c phi, moved into the allowed part of the left half plane."""
    size = len(coefficients)
    system, drive = np.zeros((size, size)), np.zeros(size)
    at = 0
    for pole in poles:
        if pole.imag == 0.0:
            system[at, at], drive[at] = pole.real, 1.0
            at += 1
        else:
            system[at : at + 2, at : at + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
            drive[at] = 2.0
            at += 2
    found = np.linalg.eigvals(system - np.outer(drive, coefficients))
    found = np.where(found.real > 0.0, -found.conj(), found)
    found *= np.minimum(1.0, largest / np.abs(found))
    kept = []
    for pole in found:
        damped = complex(min(pole.real, -MIN_DAMPING * abs(pole)), pole.imag)
        if abs(damped.imag) < 1.0e-6 * largest:
            kept.append(complex(damped.real, 0.0))
        elif damped.imag > 0.0:
            kept.append(damped)
    return sorted(kept, key=lambda p: (p.imag, p.real))


def _residues(omega: Floats, target: Complexes, poles: Complexes, weight: Floats) -> Block | None:
    """Return the passive least-squares residues for poles, with K(0) = 0; None if none exist."""
    modes = target.shape[1]
    upper = np.transpose(np.triu_indices(modes))
    basis = np.hstack([_basis(1j * omega, poles), 1j * omega[:, None] / omega[-1]])
    order = basis.shape[1] - 1
    equations = np.vstack([basis.real, basis.imag]) * np.tile(weight, 2)[:, None]
    free = block_diag(_zero_at_rest(poles), 1.0)  # the last coefficient is that of the added mass
    reduced = equations @ free
    q, r = np.linalg.qr(reduced)
    curves = [target[:, i, j] * weight for i, j in upper]
    unconstrained = [
        np.linalg.solve(r, q.T @ np.concatenate([curve.real, curve.imag])) for curve in curves
    ]
    # Unknown y = r x for each curve: the distance to the best fit is the Euclidean one.
    coefficients = free @ np.linalg.inv(r)
    to_residues = coefficients[:order]
    grid = _passivity_grid(omega, poles)
    best = np.concatenate([r @ x for x in unconstrained])
    weights = np.array([1.0 if i == j else 2.0 for i, j in upper])
    width = order
    solution, cuts, limits = best, [], []
    for attempt in range(CUTS):
        curves_at = solution.reshape(len(upper), width) @ to_residues.T
        eigenvalues, vectors = _lowest_damping(grid, poles, curves_at, upper)
        worst = eigenvalues[:, 0]
        scale = float(np.abs(eigenvalues).max())
        if worst.min() >= 0.0:
            # Between the points of the grid an eigenvalue may be lower, next to its minima.
            finer = _around_minima(grid, worst)
            eigenvalues, vectors = _lowest_damping(finer, poles, curves_at, upper)
            worst = eigenvalues[:, 0]
            if worst.min() >= 0.0:
                break
            at = finer
        else:
            at = grid
        real_parts = _scaled_real_part(at, poles) @ to_residues
        for g in _local_minima(worst, 0.0):
            v = vectors[g, :, 0]
            cuts.append(np.concatenate([
                weights[u] * v[i] * v[j] * real_parts[g] for u, (i, j) in enumerate(upper)
            ]))  # fmt: skip
            limits.append(MARGIN * scale * 1.2**attempt)
        # An off-diagonal curve counts twice in the norm of the matrix.
        stretch = np.repeat(np.sqrt(weights), width)
        solution = (
            best
            + _least_distance(np.array(cuts) / stretch, np.array(limits) - np.array(cuts) @ best)
            / stretch
        )
    else:
        return None
    values = coefficients @ solution.reshape(len(upper), width).T
    matrices = np.zeros((order + 1, modes, modes))
    matrices[:, upper[:, 0], upper[:, 1]] = values
    matrices[:, upper[:, 1], upper[:, 0]] = values
    return Block(poles, matrices[:order], matrices[order])


def _evaluate(block: Block, omega: Floats) -> Complexes:
    """Return K_r with the correction of the added mass, on the grid of the fit."""
    memory = np.tensordot(_basis(1j * omega, block.poles), block.residues, 1)
    total: Complexes = memory + 1j * omega[:, None, None] / omega[-1] * block.mass
    return total


def _passivity_grid(omega: Floats, poles: Complexes) -> Floats:
    """Return frequencies from far below to far above poles and data, dense around each pole."""
    size = np.abs(poles)
    wide = np.geomspace(1.0e-3 * min(omega[0], size.min()), 1.0e3 * max(omega[-1], size.max()), 500)
    near = [p.imag + np.linspace(-4.0, 4.0, 33) * abs(p.real) for p in poles if p.imag > 0.0]
    grid = np.concatenate([wide, omega, *near])
    return np.unique(grid[grid > 0.0])


def _scaled_real_part(grid: Floats, poles: Complexes) -> Floats:
    """Return Re K of each basis function, multiplied so that its limits at 0 and inf are finite.

    With K(0) = 0 and a relative degree of one, Re K vanishes as omega² and as 1/omega².
    """
    middle = float(np.exp(np.mean(np.log(np.abs(poles)))))
    ratio = grid / middle
    factor = (1.0 + ratio**2) ** 2 / (4.0 * ratio**2)
    scaled: Floats = _basis(1j * grid, poles).real * factor[:, None]
    return scaled


def _lowest_damping(
    grid: Floats, poles: Complexes, coefficients: Floats, upper: NDArray[np.intp]
) -> tuple[Floats, Floats]:
    """Return eigenvalues, ascending, and eigenvectors of the scaled Re K on a grid."""
    size = int(upper.max()) + 1
    values = _scaled_real_part(grid, poles) @ coefficients.T
    matrices = np.zeros((grid.size, size, size))
    matrices[:, upper[:, 0], upper[:, 1]] = values
    matrices[:, upper[:, 1], upper[:, 0]] = values
    eigenvalues, vectors = np.linalg.eigh(matrices)
    return eigenvalues, vectors


def _local_minima(values: Floats, bound: float) -> list[int]:
    """Return the indices of values below a bound that are not larger than their neighbours."""
    padded = np.concatenate([[np.inf], values, [np.inf]])
    lowest = (values < bound) & (values <= padded[:-2]) & (values <= padded[2:])
    return [int(index) for index in np.flatnonzero(lowest)]


def _around_minima(grid: Floats, values: Floats) -> Floats:
    """Return a fine grid between the neighbours of each local minimum of values on a grid."""
    last = grid.size - 1
    parts = [
        np.linspace(grid[max(k - 1, 0)], grid[min(k + 1, last)], FINER)
        for k in _local_minima(values, np.inf)
    ]
    return np.unique(np.concatenate(parts))


def _least_distance(matrix: Floats, bound: Floats) -> Floats:
    """Return the shortest x with matrix x >= bound: Lawson and Hanson, algorithm LDP."""
    system = np.vstack([matrix.T, bound])
    right = np.zeros(system.shape[0])
    right[-1] = 1.0
    multipliers, _ = nnls(system, right, maxiter=50 * system.shape[1])
    residual = system @ multipliers - right
    if abs(residual[-1]) < 1.0e-14:
        return np.zeros(matrix.shape[1])  # no solution; the caller finds the violation again
    shortest: Floats = -residual[:-1] / residual[-1]
    return shortest


def smallest_damping(radiation: Radiation, omega: Floats) -> float:
    """Return the smallest eigenvalue of Re K_r by the largest one; not negative: passive."""
    eigenvalues = np.linalg.eigvalsh(response(radiation, omega).real)
    return float(eigenvalues.min() / np.abs(eigenvalues).max())
