"""The encoder estimator against a full Kalman filter, against sinusoids, and against its noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import KalmanFilter

from controllers import estimator
from rig import estimator_design
from rig.estimator_design import design, response

DT = 0.001
COUNT = 2.52e-5  # m, heave a count of the WaveBot
NOISE = 0.5  # counts, besides quantisation
JERK = 0.5  # m^2/s^5
PARAMS = design(COUNT, NOISE, JERK, DT)
FINE = PARAMS._replace(metres_per_count=1e-12)  # as good as no quantisation


def track(params: estimator.Params, positions: np.ndarray) -> np.ndarray:
    """Estimates (position, velocity, acceleration) for true positions (m), one a tick."""
    state, out = estimator.start(), []
    for x in positions:
        state = estimator.step(params, state, round(float(x) / params.metres_per_count), 1, DT)
        out.append(state[:3])
    return np.array(out)


def full_filter() -> KalmanFilter:
    full = KalmanFilter(dim_x=3, dim_z=1)
    full.F = np.array([[1.0, DT, 0.5 * DT * DT], [0.0, 1.0, DT], [0.0, 0.0, 1.0]])
    full.H = np.array([[1.0, 0.0, 0.0]])
    full.R = np.array([[(1.0 / 12.0 + NOISE**2) * COUNT**2]])
    full.Q = Q_continuous_white_noise(dim=3, dt=DT, spectral_density=JERK)
    full.P = np.diag([1e-6, 1e-2, 1.0])
    return full


def test_equals_a_full_kalman_filter_once_that_has_settled() -> None:
    full = full_filter()
    for _ in range(3000):
        full.predict()
        full.update(np.array([[0.0]]))
    rng = np.random.default_rng(3)
    counts = np.rint(np.cumsum(rng.normal(0.0, 8.0, 3000))).astype(int)
    state = estimator.State(0.0, 0.0, 0.0, 1)
    full.x = np.zeros((3, 1))
    for n in counts:
        full.predict()
        full.update(np.array([[n * COUNT]]))
        state = estimator.step(PARAMS, state, int(n), 1, DT)
        scale = np.array([1e-3, 1e-1, 10.0])  # m, m/s, m/s^2 of this walk
        assert np.all(np.abs(full.x[:, 0] - state[:3]) <= 1e-9 * scale)
    assert abs(state.velocity) > 1e-3


def test_design_scales_with_the_count_and_keeps_its_sign() -> None:
    down = design(-COUNT, NOISE, JERK, DT)
    assert down == PARAMS._replace(metres_per_count=-COUNT)
    eager = design(COUNT, NOISE, 100.0 * JERK, DT)
    assert eager.gain_velocity > PARAMS.gain_velocity
    assert 0.0 < PARAMS.gain_position < eager.gain_position < 1.0


def test_design_says_when_the_gain_does_not_settle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estimator_design, "_MOST_STEPS", 50)
    with pytest.raises(ValueError, match="did not settle"):
        design(COUNT, NOISE, JERK, DT)


@pytest.mark.parametrize("f", [0.2, 0.5, 1.0])
def test_a_sinusoid_comes_out_as_the_design_says(f: float) -> None:
    periods = 1 if f < 0.5 else 2
    n, settle = round(periods / (f * DT)), 4000
    t = np.arange(settle + n) * DT
    got = track(FINE, np.sin(2.0 * np.pi * f * t))[settle:]
    phasor = np.exp(-2j * np.pi * f * t[settle:]) * 2j / n  # of e^{j omega t}, sine reference
    position, velocity = response(FINE, np.array([f]), DT)
    assert abs(np.sum(got[:, 0] * phasor) - position[0]) < 1e-6
    assert abs(np.sum(got[:, 1] * phasor) - velocity[0]) < 1e-6 * 2.0 * np.pi * f


def test_the_velocity_error_over_the_wave_band_is_small() -> None:
    """0.2 to 1 Hz: amplitude 0.02 to 0.56 % high, lag 3 to 71 us: below a tenth of a tick.

    A lag tau of the velocity turns part of a damping Kp into a stiffness Kp omega^2 tau: at 1 Hz
    and Kp = -3000 N s/m that is 8 N/m, against a hydrostatic stiffness of 24 kN/m.
    """
    f = np.linspace(0.2, 1.0, 81)
    _, velocity = response(PARAMS, f, DT)
    omega = 2.0 * np.pi * f
    error = velocity / (1j * omega)
    assert np.max(np.abs(np.abs(error) - 1.0)) < 0.006
    lag = -np.angle(error) / omega
    assert 0.0 < np.min(lag) < 4e-6
    assert np.max(lag) < 80e-6


def test_the_first_count_sets_the_position_and_nothing_moves() -> None:
    state = estimator.step(PARAMS, estimator.start(), 183264, 1, DT)
    assert state == (183264 * COUNT, 0.0, 0.0, 1)
    for _ in range(100):
        state = estimator.step(PARAMS, state, 183264, 1, DT)
    assert state == (183264 * COUNT, 0.0, 0.0, 1)
    assert estimator.estimate(state, 183264 * COUNT) == (0.0, 0.0, 0.0)
    assert estimator.estimate(state, 0.0).position == 183264 * COUNT


def test_counts_that_grow_downwards_give_a_negative_velocity() -> None:
    x = 0.2 * np.arange(3000) * DT
    up = track(PARAMS, x)[-1]
    down = track(PARAMS._replace(metres_per_count=-COUNT), x)[-1]
    assert up[1] == pytest.approx(0.2, rel=0.01)
    state = estimator.start()
    for position in x:
        flipped = PARAMS._replace(metres_per_count=-COUNT)
        state = estimator.step(flipped, state, round(position / COUNT), 1, DT)
    assert state.velocity == pytest.approx(-up[1])
    assert down == pytest.approx(up)


@pytest.mark.parametrize("lost", [2, 5, 100])
def test_lost_periods_are_predicted(lost: int) -> None:
    """On the filter's own model, constant acceleration, a gap leaves no error at all."""
    a, v, x = 0.3, -0.2, 0.05
    state, t = estimator.State(x, v, a, 1), 0.0
    for periods in (1, lost, 1, 1, lost, lost):
        t += periods * DT
        true = x + v * t + 0.5 * a * t * t
        state = estimator.step(FINE, state, round(true / 1e-12), periods, DT)
        assert state.position == pytest.approx(true, abs=1e-10)
        assert state.velocity == pytest.approx(v + a * t, abs=1e-9)
        assert state.acceleration == pytest.approx(a, abs=1e-7)


def test_ignoring_a_gap_would_cost_velocity() -> None:
    state = estimator.State(0.0, 0.5, 0.0, 1)
    told = estimator.step(FINE, state, round(0.5 * 0.02 / 1e-12), 20, DT)
    untold = estimator.step(FINE, state, round(0.5 * 0.02 / 1e-12), 1, DT)
    assert told.velocity == pytest.approx(0.5, abs=1e-9)
    assert abs(untold.velocity - 0.5) > 0.1


def peak_gain() -> float:
    """Largest gain from an error of position to the velocity estimate (1/s), over all f."""
    f = np.linspace(0.01, 0.5 / DT, 5000)
    return float(np.max(np.abs(response(PARAMS, f, DT)[1])))


def test_at_rest_a_still_encoder_gives_no_velocity() -> None:
    got = track(PARAMS, np.full(2000, 0.4567))
    assert np.all(got[:, 1] == 0.0)


@pytest.mark.parametrize("speed", [0.01, 0.1, 0.5])
def test_quantisation_disturbs_velocity_little(speed: float) -> None:
    """Bound: the error's rms q/sqrt(12) times the largest gain, wherever its lines alias to."""
    bound = peak_gain() * COUNT / math.sqrt(12.0)
    assert bound < 1.5e-3  # m/s, 1.5 % of 0.1 m/s: 5 N of noise at Kp = -3000 N s/m
    got = track(PARAMS, speed * np.arange(6000) * DT)[2000:, 1]
    assert np.sqrt(np.mean((got - speed) ** 2)) < bound


@pytest.mark.parametrize("speed", [0.0, 0.1])
def test_encoder_noise_disturbs_velocity_as_the_covariance_says(speed: float) -> None:
    """White noise of the designed size: rms by the filter's impulse response, within 25 %."""
    impulse, state = [], estimator.State(0.0, 0.0, 0.0, 1)
    for k in range(3000):
        state = estimator.step(PARAMS._replace(metres_per_count=1.0), state, int(k == 0), 1, DT)
        impulse.append(state.velocity)
    sigma = math.sqrt(NOISE**2 + 1.0 / 12.0) * COUNT
    expected = sigma * math.sqrt(sum(h * h for h in impulse))
    assert expected < 0.8e-3  # m/s: 2 N at Kp = -3000 N s/m
    rng = np.random.default_rng(5)
    x = speed * np.arange(20_000) * DT + rng.normal(0.0, NOISE * COUNT, 20_000)
    got = track(PARAMS, x)[2000:, 1] - speed
    assert float(np.sqrt(np.mean(got**2))) == pytest.approx(expected, rel=0.25)
