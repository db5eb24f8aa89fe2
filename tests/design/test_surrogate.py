"""The surrogate of powers and the choice of rows: closed forms, known surfaces, odd values."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.stats import norm

from rig.design import surrogate
from rig.design.surrogate import Floats, Measured, Surrogate, choose, fit, spread

SIDE = 7  # candidates along each of two columns
LOSS_SHARE = 2.0  # the mean true loss is at most that of the expected one


def grid(side: int = SIDE) -> Floats:
    axis = np.linspace(0.0, 1.0, side)
    return np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)


def branin(places: Floats) -> Floats:
    """The function of Branin (1972) on the unit square, in W: three equal minima."""
    x, y = 15.0 * places[:, 0] - 5.0, 15.0 * places[:, 1]
    bowl = (y - 5.1 / (4.0 * np.pi**2) * x * x + 5.0 / np.pi * x - 6.0) ** 2
    found: Floats = 0.2 * (bowl + 10.0 * (1.0 - 0.125 / np.pi) * np.cos(x) + 10.0) - 30.0
    return found


def bowl(places: Floats, random: np.random.Generator) -> Floats:
    """A quadratic with a random minimum, tilted axes and two curvatures (W)."""
    turn, _ = np.linalg.qr(random.standard_normal((2, 2)))
    curvature = turn @ np.diag(np.exp(random.uniform(np.log(5.0), np.log(80.0), 2))) @ turn.T
    away = places - random.uniform(0.0, 1.0, 2)
    found: Floats = np.einsum("ij,jk,ik->i", away, curvature, away) - 20.0
    return found


def measured_at(rows: Any, powers: Floats, error: float) -> Measured:
    at = np.array(rows, np.int64)
    return Measured(at, powers[at], np.full(len(at), error))


def fix_hyperparameters(
    monkeypatch: pytest.MonkeyPatch, length: float, amplitude: float, draws: int
) -> None:
    """Let each draw of the hyperparameters be the same."""
    monkeypatch.setattr(surrogate, "_LENGTHS", (length, length))
    monkeypatch.setattr(surrogate, "_AMPLITUDES", (amplitude, amplitude))
    monkeypatch.setattr(surrogate, "_DRAWS", draws)
    monkeypatch.setattr(surrogate, "_HYPERPARAMETERS", 2)
    monkeypatch.setattr(surrogate, "_KEPT", 1)


# --- the posterior


@pytest.mark.parametrize("with_prior", [False, True])
def test_the_posterior_is_that_of_the_textbook(
    monkeypatch: pytest.MonkeyPatch, *, with_prior: bool
) -> None:
    """Rasmussen and Williams (2006), equations 2.23 and 2.24, with the Matern kernel of 4.17."""
    length, amplitude, draws = 0.7, 1.5, 40_000
    fix_hyperparameters(monkeypatch, length, amplitude, draws)
    places, powers = grid(4), branin(grid(4))
    prior = 0.8 * powers + 1.0 if with_prior else None
    measured = measured_at([0, 5, 6, 11, 14], powers, 0.5)
    known = fit(places, measured, prior)

    expected = np.zeros(len(places)) if prior is None else prior
    residual = measured.power - expected[measured.at]
    scale = residual.std()
    if prior is not None:
        scale = max(scale, surrogate.PREDICTION_ERROR * prior.std())
    distance = np.sqrt(5.0) * np.linalg.norm(places[:, None] - places[None], axis=-1) / length
    matern = (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)
    kernel = scale**2 * (1.0 + amplitude**2 * matern)  # 1: the unknown offset
    noise = np.diag(measured.error**2 + (scale * surrogate._NUGGET) ** 2)
    gain = kernel[:, measured.at] @ np.linalg.inv(kernel[np.ix_(measured.at, measured.at)] + noise)
    mean = expected + residual.mean() + gain @ (residual - residual.mean())
    covariance = kernel - gain @ kernel[measured.at]

    deviation = np.sqrt(np.diag(covariance))
    assert (np.abs(known.mean - mean) < 5.0 * deviation / np.sqrt(draws) + 1e-6).all()
    np.testing.assert_allclose(known.deviation, deviation, rtol=0.02, atol=1e-3 * scale)
    drawn = np.cov(known.draws.T) / np.outer(deviation, deviation)
    np.testing.assert_allclose(drawn, covariance / np.outer(deviation, deviation), atol=0.03)


@pytest.mark.parametrize("error", [1e-3, 0.05, 0.5])
def test_measured_rows_keep_their_powers_within_their_errors(error: float) -> None:
    powers = branin(grid())
    random = np.random.default_rng(1)
    at = random.permutation(len(powers))[:12]
    noisy = powers[at] + error * random.standard_normal(len(at))
    known = fit(grid(), Measured(at, noisy, np.full(len(at), error)), None)
    nugget = surrogate._NUGGET * noisy.std()
    assert (np.abs(known.mean[at] - noisy) < 3.0 * error + 5.0 * nugget).all()
    assert (known.deviation[at] < 1.1 * error + 5.0 * nugget).all()
    others = np.delete(known.deviation, at)
    assert others.min() > known.deviation[at].max() or error == 0.5


def test_equal_measurements_lead_to_equal_choices() -> None:
    powers = branin(grid())
    measured = measured_at([3, 30, 40], powers, 0.1)
    first, second = fit(grid(), measured, None), fit(grid(), measured, None)
    np.testing.assert_array_equal(first.draws, second.draws)


# --- the choice


def known_by(mean: Any, draws: Any) -> Surrogate:
    draws = np.array(draws, float)
    return Surrogate(np.array(mean, float), draws.std(axis=0), draws)


def test_the_choice_has_the_largest_expected_gain_for_its_time() -> None:
    """By hand: candidate 1 gains 2 W in half of the draws, candidate 2 gains 3 W in a quarter."""
    draws = [[0, -2, 1, 5], [0, -2, 1, 5], [0, 4, 1, 5], [0, 4, -3, 5]]
    known = known_by(np.mean(draws, axis=0), draws)
    measured = Measured(np.array([0]), np.zeros(1), np.zeros(1))
    choice = choose(known, measured, np.ones(4))
    assert choice == (1, 1.0, 0, 1.75)  # expected loss: (2 + 2 + 0 + 3) / 4
    assert choose(known, measured, np.array([1.0, 2.0, 1.0, 1.0])).at == 2
    assert choose(known, measured, np.array([1.0, np.inf, np.inf, 1.0])).at == 3
    assert choose(known, measured, np.full(4, np.inf)).at == -1


def test_the_gain_of_a_normal_row_is_that_of_jones() -> None:
    """Jones, Schonlau and Welch (1998), equation 15: s (u Phi(u) + phi(u)), u = gain / s."""
    random, away, s = np.random.default_rng(2), 0.4, 0.7
    draws = np.column_stack([np.zeros(200_000), away + s * random.standard_normal(200_000)])
    measured = Measured(np.array([0]), np.zeros(1), np.zeros(1))
    u = -away / s
    truth = s * (u * norm.cdf(u) + norm.pdf(u))
    choice = choose(known_by(draws.mean(axis=0), draws), measured, np.ones(2))
    assert choice.gain == pytest.approx(truth, rel=0.02)
    assert choice.regret == pytest.approx(truth, rel=0.02)


def test_a_row_is_not_measured_twice_and_nothing_is_lost_once_all_are() -> None:
    powers = branin(grid(4))
    everything = measured_at(range(16), powers, 1e-6)
    choice = choose(fit(grid(4), everything, None), everything, np.ones(16))
    assert (choice.at, choice.best) == (-1, int(np.argmin(powers)))
    assert choice.regret < 1e-3
    for left in (0, 6, 15):
        rows = [each for each in range(16) if each != left]
        some = measured_at(rows, powers, 0.1)
        assert choose(fit(grid(4), some, None), some, np.ones(16)).at == left


# --- odd measurements


CASES: dict[str, tuple[list[float], list[float]]] = {
    "equal powers": ([-5.0] * 4, [0.01] * 4),
    "equal and exact": ([-5.0] * 4, [0.0] * 4),
    "no power at all": ([0.0] * 4, [0.0] * 4),
    "no power, with errors": ([0.0] * 4, [0.01] * 4),
    "two tied best": ([-5.0, -5.0, -3.0, -1.0], [0.0] * 4),
    "errors above the powers": ([-5.0, -4.0, -3.0, -1.0], [1e6] * 4),
    "tiny powers": ([-5e-9, -4e-9, -3e-9, -1e-9], [1e-10] * 4),
    "large powers": ([-5e6, -4e6, -3e6, -1e6], [1e3] * 4),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("predicted", ["nothing", "equal powers", "the opposite"])
def test_odd_measurements_give_a_choice_without_warnings(name: str, predicted: str) -> None:
    powers, errors = map(np.array, CASES[name])
    prior = {"nothing": None, "equal powers": np.full(49, -2.0), "the opposite": -branin(grid())}
    measured = Measured(np.array([0, 10, 24, 48]), powers, errors)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        known = fit(grid(), measured, prior[predicted])
        choice = choose(known, measured, np.ones(49))
    assert choice.at not in (-1, 0, 10, 24, 48)
    assert np.isfinite([choice.gain, choice.regret]).all()
    assert choice.regret >= choice.gain >= 0.0
    assert np.isfinite(known.draws).all()


@pytest.mark.parametrize("shape", ["one column", "equal candidates", "one row measured", "pairs"])
def test_odd_matrices_give_a_choice(shape: str) -> None:
    columns, rows = grid(), [0, 3]
    if shape == "one column":
        columns = grid()[:SIDE, 1:]
    elif shape == "equal candidates":
        columns = np.ones((5, 1))
    elif shape == "one row measured":
        rows = [24]
    else:
        columns = np.vstack([grid(), grid()])
    powers = 3.0 * columns.sum(axis=1) - 10.0
    measured = measured_at(rows, powers, 0.01)
    choice = choose(fit(columns, measured, None), measured, np.ones(len(columns)))
    assert choice.at not in rows
    assert np.isfinite([choice.gain, choice.regret]).all()


def test_the_first_rows_cover_the_matrix() -> None:
    order = spread(grid())
    assert sorted(order) == list(range(SIDE * SIDE))
    assert order[0] == SIDE * SIDE // 2
    assert set(order[1:5]) == {0, SIDE - 1, SIDE * (SIDE - 1), SIDE * SIDE - 1}  # the corners
    assert sorted(spread(np.ones((4, 2)))) == [0, 1, 2, 3]


# --- whole campaigns


class Ended(NamedTuple):
    loss: float  # W, true one of the recommended row
    expected: float  # W
    rows: int


def run_campaign(
    truth: Floats,
    prior: Floats | None,
    noise: float,
    random: np.random.Generator,
    precision: float = 0.3,
) -> Ended:
    """Measure rows of a known surface until the expected loss is within ``precision`` (W)."""
    powers: dict[int, float] = {}
    begin = spread(grid())[:4] if prior is None else [int(np.argmin(prior))]
    for row in begin:
        powers[row] = truth[row] + noise * random.standard_normal()
    while True:
        values = np.array([*powers.values()])
        measured = Measured(np.array([*powers]), values, np.full(len(values), noise))
        choice = choose(fit(grid(), measured, prior), measured, np.ones(len(truth)))
        if (choice.regret <= precision and len(powers) >= 4) or choice.at < 0:
            return Ended(float(truth[choice.best] - truth.min()), choice.regret, len(powers))
        powers[choice.at] = truth[choice.at] + noise * random.standard_normal()


PRIORS: dict[str, Callable[[Floats], Floats | None]] = {
    "nothing": lambda truth: None,
    "scaled": lambda truth: 1.2 * truth + 3.0,
    "badly wrong": lambda truth: -truth,
}


@pytest.mark.parametrize("predicted", PRIORS)
def test_the_best_row_of_a_known_surface_is_found_with_few_rows(predicted: str) -> None:
    truth = branin(grid())
    ended = run_campaign(truth, PRIORS[predicted](truth), 0.05, np.random.default_rng(3))
    assert ended.loss <= 0.3
    assert ended.rows <= 0.5 * len(truth)


@pytest.mark.parametrize("noise", [0.05, 0.5])
def test_the_true_loss_is_about_the_expected_one(noise: float) -> None:
    """Seeded campaigns on random bowls."""
    ended = []
    for seed in range(4):
        random = np.random.default_rng(seed)
        ended.append(run_campaign(bowl(grid(), random), None, noise, random, max(0.3, noise)))
    loss, expected = (np.mean([each[i] for each in ended]) for i in (0, 1))
    assert loss <= LOSS_SHARE * expected
    assert np.mean([each.rows for each in ended]) <= 0.5 * SIDE * SIDE
