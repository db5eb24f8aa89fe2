"""A Gaussian-process surrogate of the powers of rows, and the choice of the next row by it.

The surrogate models what a prediction leaves over (or, without one, the powers themselves) as a
Gaussian process over the columns of the matrix (Rasmussen and Williams, 2006, chapters 2 and 5):
a measured row shows its neighbours, the less the farther away. Few rows do not show how far: so
lengths and amplitude are not fitted, but drawn, and each draw counts by its likelihood (Snoek,
Larochelle and Adams, 2012). The next row is the one with the largest expected improvement over the
row recommended so far (Jones, Schonlau and Welch, 1998), per second that it costs. The choice has
come to its end once the power that the recommended row is expected to give away, the mean over
joint draws of all rows, is small enough.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PREDICTION_ERROR = 0.2  # of the spread of predicted powers: a prediction is trusted no better
SEED = 20_261_127  # equal measurements lead to equal choices
_LENGTHS = (0.25, 4.0)  # length scales, of the range of a column
_AMPLITUDES = (0.5, 10.0)  # standard deviations, of that of the residuals
_HYPERPARAMETERS = 200  # drawn
_KEPT = 20  # of them, those with the largest likelihood
_DRAWS = 2000  # of all rows together
_LEAST_W = 1.0e-6  # W, of the residuals: rows without any power have no scale
_NUGGET = 1.0e-3  # standard deviation of each row besides, of that of the residuals


class Measured(NamedTuple):
    """The rows that are measured."""

    at: NDArray[np.int64]  # index into the candidates, of each
    power: Floats  # W, negative where absorbed
    error: Floats  # W, standard error


class Surrogate(NamedTuple):
    """The powers of all candidates as they are known by now."""

    mean: Floats  # W
    deviation: Floats  # W, standard deviation
    draws: Floats  # W, one row a draw, one column a candidate


class Choice(NamedTuple):
    """The row to measure next, and what is known before it."""

    at: int  # index of the candidate; -1: there is none
    gain: float  # W, expected improvement by it
    best: int  # index of the candidate that is recommended so far
    regret: float  # W, power that this one is expected to give away


def fit(columns: Floats, measured: Measured, prior: Floats | None) -> Surrogate:
    """Return the powers of candidates after some of them were measured.

    ``columns``: values of each candidate (one row each), of columns that differ; ``prior``: their
    predicted powers (W), None without a prediction.
    """
    # Imported here, because it takes a second that only adaptive campaigns need.
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern  # noqa: PLC0415

    places = _scaled(columns)
    expected = np.zeros(len(columns)) if prior is None else prior
    residual = measured.power - expected[measured.at]
    offset = float(residual.mean())
    least = max(1e-3 * float(np.abs(measured.power).max()), _LEAST_W)
    if prior is not None:
        least = max(least, PREDICTION_ERROR * float(prior.std()))
    scale = max(float(residual.std()), least)
    noise = (measured.error / scale) ** 2 + _NUGGET**2
    random = np.random.default_rng(SEED)
    # The offset is known as badly as one row is.
    kernel = ConstantKernel(1.0) + ConstantKernel(1.0) * Matern([1.0] * places.shape[1], nu=2.5)
    process = GaussianProcessRegressor(kernel, alpha=noise, optimizer=None)
    process.fit(places[measured.at], (residual - offset) / scale)
    size = _HYPERPARAMETERS, places.shape[1]
    low, high = np.log(_LENGTHS)
    lengths = random.uniform(low, high, size)
    low, high = np.log(_AMPLITUDES)
    variances = 2.0 * random.uniform(low, high, size[0])
    thetas = np.column_stack([np.zeros(size[0]), variances, lengths])
    likelihood = np.array([process.log_marginal_likelihood(each) for each in thetas])
    kept = np.argsort(likelihood)[-_KEPT:]
    weights = np.exp(likelihood[kept] - likelihood[kept].max())
    draws = []
    for theta, share in zip(thetas[kept], weights / weights.sum(), strict=True):
        number = round(share * _DRAWS)
        if number == 0:
            continue
        process = GaussianProcessRegressor(
            kernel.clone_with_theta(theta), alpha=noise, optimizer=None
        ).fit(places[measured.at], (residual - offset) / scale)
        mean, covariance = process.predict(places, return_cov=True)
        root = np.linalg.cholesky(covariance + 1e-8 * np.eye(len(mean)))
        draws.append(mean + random.standard_normal((number, len(mean))) @ root.T)
    drawn = expected + offset + scale * np.concatenate(draws)
    return Surrogate(drawn.mean(axis=0), drawn.std(axis=0), drawn)


def choose(known: Surrogate, measured: Measured, seconds: Floats) -> Choice:
    """Return the candidate to measure next.

    ``seconds``: time that each costs, infinite for one that must not be chosen. The power is to be
    as low as possible. A row that was measured is not measured twice.
    """
    done = np.zeros(len(known.mean), bool)
    done[measured.at] = True
    best = int(measured.at[np.argmin(known.mean[measured.at])])
    differences = known.draws[:, [best]] - known.draws
    regret = float(differences.max(axis=1).mean())
    gains = np.maximum(differences, 0.0).mean(axis=0)
    ranked = gains
    if not gains[~done].any():  # no draw is better: by how many deviations each is worse
        deviation = differences.std(axis=0)
        ranked = np.exp(
            np.clip(differences.mean(axis=0) / np.maximum(deviation, 1e-9), -300.0, 0.0)
        )
    worth = np.where(done | ~np.isfinite(seconds), -np.inf, ranked / seconds)
    at = int(np.argmax(worth))
    if not np.isfinite(worth[at]):
        return Choice(-1, 0.0, best, regret)
    return Choice(at, float(gains[at]), best, regret)


def spread(columns: Floats) -> list[int]:
    """Return all candidates in an order whose beginning covers the matrix: the middle one, then
    each the farthest from those before it."""
    places = _scaled(columns)
    chosen = [int(np.argmin(((places - 0.5) ** 2).sum(axis=1)))]
    nearest = np.full(len(places), np.inf)
    while len(chosen) < len(places):
        nearest = np.minimum(nearest, ((places - places[chosen[-1]]) ** 2).sum(axis=1))
        nearest[chosen] = -1.0  # equal candidates come last
        chosen.append(int(np.argmax(nearest)))
    return chosen


def _scaled(columns: Floats) -> Floats:
    """Return the columns from 0 to 1."""
    low, high = columns.min(axis=0), columns.max(axis=0)
    found: Floats = (columns - low) / np.where(high > low, high - low, 1.0)
    return found
