"""The position estimator against a full Kalman filter, sinusoids, and the encoder's noise."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import KalmanFilter

from controllers import estimator
from controllers.signals import Estimate
from rig.design import estimator as estimator_design
from rig.design.estimator import design, response

DT = 0.001
COUNT = 2.52e-5  # m, heave a count of the WaveBot
NOISE = 0.5  # counts, in addition to quantisation
JERK = 0.5  # m^2/s^5
PARAMS = design(COUNT, NOISE, JERK, DT)
REST = Estimate(0.0, 0.0, 0.0)


def track(measured: np.ndarray) -> np.ndarray:
    """Estimates (position, velocity, acceleration) for measured positions (m), one a tick."""
    first, *others = (float(x) for x in measured)
    motion = Estimate(first, 0.0, 0.0)
    out = [motion]
    for x in others:
        motion = estimator.step(PARAMS, motion, x, 1, DT)
        out.append(motion)
    return np.array(out)


def quantised(positions: np.ndarray) -> np.ndarray:
    """Return true positions (m) rounded to whole counts."""
    return np.rint(positions / COUNT) * COUNT


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
    motion = REST
    full.x = np.zeros((3, 1))
    for n in counts:
        full.predict()
        full.update(np.array([[n * COUNT]]))
        motion = estimator.step(PARAMS, motion, int(n) * COUNT, 1, DT)
        scale = np.array([1e-3, 1e-1, 10.0])  # m, m/s, m/s^2 of this walk
        assert np.all(np.abs(full.x[:, 0] - motion) <= 1e-9 * scale)
    assert abs(motion.velocity) > 1e-3


def test_the_design_ignores_the_sign_of_the_count() -> None:
    assert design(-COUNT, NOISE, JERK, DT) == PARAMS


def test_a_finer_count_or_more_jerk_raises_the_gains() -> None:
    fine = design(COUNT / 10.0, NOISE, JERK, DT)
    assert 0.0 < PARAMS.gain_position < fine.gain_position < 1.0
    eager = design(COUNT, NOISE, 100.0 * JERK, DT)
    assert eager.gain_velocity > PARAMS.gain_velocity
    assert 0.0 < PARAMS.gain_position < eager.gain_position < 1.0


def test_a_gain_that_does_not_converge_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estimator_design, "_MAX_STEPS", 50)
    with pytest.raises(ValueError, match="did not settle"):
        design(COUNT, NOISE, JERK, DT)


def test_cached_gains_equal_those_of_filterpy_bit_by_bit(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Truncated, empty and foreign cache files are ignored."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    inputs = (COUNT, NOISE, JERK, DT)
    by_filterpy = estimator_design.design_with_filterpy(*inputs)
    assert design(*inputs) == by_filterpy
    (cached,) = tmp_path.glob("wec-rig/estimator_*.json")
    with monkeypatch.context() as patch:
        patch.setattr(estimator_design, "design_with_filterpy", None)  # not called
        assert design(*inputs) == by_filterpy
    whole = cached.read_text()
    wrong = json.dumps({"arguments": [1.0, 2.0, 3.0, 4.0], "gains": [0.5, 0.5, 0.5]})
    not_finite = json.dumps({"arguments": inputs, "gains": [0.5, float("nan"), 0.5]})
    for text in (whole[:-3], "", "[]", wrong, not_finite):
        cached.write_text(text)
        assert design(*inputs) == by_filterpy
        assert cached.read_text() == whole
    assert design(COUNT, NOISE, JERK, 2.0 * DT) != by_filterpy
    assert len(list(tmp_path.glob("wec-rig/*"))) == 2


def test_a_gain_is_the_same_on_every_processor() -> None:
    """OpenBLAS uses fused operations on some processors, which changes filterpy's last bits."""
    inputs = (COUNT, NOISE, JERK, DT)
    code = f"from rig.design.estimator import design_with_filterpy as f; print(*f(*{inputs}))"
    for kernels in ("Prescott", "Haswell"):
        env = os.environ | {"OPENBLAS_CORETYPE": kernels}
        done = subprocess.run(
            [sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True
        )
        assert tuple(map(float, done.stdout.split())) == tuple(PARAMS)


def test_gains_are_designed_without_a_writable_cache(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert design(COUNT, NOISE, JERK, DT) == PARAMS


@pytest.mark.parametrize("f", [0.2, 0.5, 1.0])
def test_the_response_to_a_sinusoid_is_as_designed(f: float) -> None:
    periods = 1 if f < 0.5 else 2
    n, settle = round(periods / (f * DT)), 4000
    t = np.arange(settle + n) * DT
    got = track(np.sin(2.0 * np.pi * f * t))[settle:]
    phasor = np.exp(-2j * np.pi * f * t[settle:]) * 2j / n  # of e^{j omega t}, sine reference
    position, velocity, _ = response(PARAMS, 2.0 * np.pi * np.array([f]), DT)
    assert abs(np.sum(got[:, 0] * phasor) - position[0]) < 1e-6
    assert abs(np.sum(got[:, 1] * phasor) - velocity[0]) < 1e-6 * 2.0 * np.pi * f


def test_the_velocity_error_over_the_wave_band_is_small() -> None:
    """0.2 to 1 Hz: amplitude 0.02 to 0.56 % high, lag 3 to 71 us: below a tenth of a tick.

    A lag tau of the velocity turns part of a damping Kp into a stiffness Kp omega^2 tau: at 1 Hz
    and Kp = -3000 N s/m that is 8 N/m, against a hydrostatic stiffness of 24 kN/m.
    """
    f = np.linspace(0.2, 1.0, 81)
    velocity = response(PARAMS, 2.0 * np.pi * f, DT).velocity
    omega = 2.0 * np.pi * f
    error = velocity / (1j * omega)
    assert np.max(np.abs(np.abs(error) - 1.0)) < 0.006
    lag = -np.angle(error) / omega
    assert 0.0 < np.min(lag) < 4e-6
    assert np.max(lag) < 80e-6


def test_a_body_at_rest_stays_at_rest() -> None:
    found = Estimate(183264 * COUNT, 0.0, 0.0)
    motion = found
    for _ in range(100):
        motion = estimator.step(PARAMS, motion, 183264 * COUNT, 1, DT)
    assert motion == found
    assert type(motion) is Estimate


def test_a_descending_body_has_a_negative_velocity() -> None:
    x = quantised(0.2 * np.arange(3000) * DT)
    up, down = track(x)[-1], track(-x)[-1]
    assert up[1] == pytest.approx(0.2, rel=0.01)
    assert down == pytest.approx(-up)


@pytest.mark.parametrize("zero", [-4.618, 0.25, 4.618])
def test_the_velocity_does_not_depend_on_the_zero(zero: float) -> None:
    x = quantised(0.05 * np.sin(3.0 * np.arange(2000) * DT))
    here, there = track(x), track(x - zero)
    assert np.max(np.abs(there[:, 0] + zero - here[:, 0])) < 1e-12
    assert np.max(np.abs(there[:, 1] - here[:, 1])) < 1e-11
    assert np.max(np.abs(there[:, 2] - here[:, 2])) < 1e-9


@pytest.mark.parametrize("lost", [2, 5, 100])
def test_lost_periods_are_predicted(lost: int) -> None:
    """On the filter's own model, constant acceleration, a gap leaves no error at all."""
    a, v, x = 0.3, -0.2, 0.05
    motion, t = Estimate(x, v, a), 0.0
    for periods in (1, lost, 1, 1, lost, lost):
        t += periods * DT
        true = x + v * t + 0.5 * a * t * t
        motion = estimator.step(PARAMS, motion, true, periods, DT)
        assert motion.position == pytest.approx(true, abs=1e-12)
        assert motion.velocity == pytest.approx(v + a * t, abs=1e-11)
        assert motion.acceleration == pytest.approx(a, abs=1e-9)


def test_ignoring_a_gap_would_cost_velocity() -> None:
    before, after = Estimate(0.0, 0.5, 0.0), 0.5 * 0.02
    with_gap = estimator.step(PARAMS, before, after, 20, DT)
    without_gap = estimator.step(PARAMS, before, after, 1, DT)
    assert with_gap.velocity == pytest.approx(0.5, abs=1e-12)
    assert abs(without_gap.velocity - 0.5) > 0.1


def peak_gain() -> float:
    """Largest gain from an error of position to the velocity estimate (1/s), over all f."""
    f = np.linspace(0.01, 0.5 / DT, 5000)
    return float(np.max(np.abs(response(PARAMS, 2.0 * np.pi * f, DT).velocity)))


def test_at_rest_a_still_encoder_gives_no_velocity() -> None:
    got = track(quantised(np.full(2000, 0.4567)))
    assert np.all(got[:, 1] == 0.0)


@pytest.mark.parametrize("speed", [0.01, 0.1, 0.5])
def test_the_velocity_error_of_quantisation_is_bounded(speed: float) -> None:
    """Bound: the error's rms q/sqrt(12) times the largest gain, wherever its lines alias to."""
    bound = peak_gain() * COUNT / math.sqrt(12.0)
    assert bound < 1.5e-3  # m/s, 1.5 % of 0.1 m/s: 5 N of noise at Kp = -3000 N s/m
    got = track(quantised(speed * np.arange(6000) * DT))[2000:, 1]
    assert np.sqrt(np.mean((got - speed) ** 2)) < bound


@pytest.mark.parametrize("speed", [0.0, 0.1])
def test_the_velocity_noise_is_as_the_covariance_predicts(speed: float) -> None:
    """White noise of the designed size: rms by the filter's impulse response, within 25 %."""
    impulse, motion = [], REST
    for k in range(3000):
        motion = estimator.step(PARAMS, motion, float(k == 0), 1, DT)
        impulse.append(motion.velocity)
    sigma = math.sqrt(NOISE**2 + 1.0 / 12.0) * COUNT
    expected = sigma * math.sqrt(sum(h * h for h in impulse))
    assert expected < 0.8e-3  # m/s: 2 N at Kp = -3000 N s/m
    rng = np.random.default_rng(5)
    x = speed * np.arange(20_000) * DT + rng.normal(0.0, NOISE * COUNT, 20_000)
    got = track(quantised(x))[2000:, 1] - speed
    assert float(np.sqrt(np.mean(got**2))) == pytest.approx(expected, rel=0.25)
