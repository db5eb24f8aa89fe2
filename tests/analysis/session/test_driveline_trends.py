"""Phase shift, amplitude difference, their trends and the corrections computed from them."""

import numpy as np
import play_operator as bench
import pytest

from rig.kinds.oswec_bench.products import deflection, driveline, periods

DT = 0.001


@pytest.fixture(scope="module")
def motions() -> list[deflection.Motion]:
    signals = bench.simulate(bench.THESIS, periods=3, dt=DT)
    cut = periods.cut_periods(len(signals.motor), 1.5, DT)
    return [
        deflection.trim_motion(*(each[:, 0, j] for each in signals), cut)
        for j in range(len(bench.TABLE_2_1))
    ]


@pytest.fixture(scope="module")
def points(motions: list[deflection.Motion]) -> list[deflection.ShaftLag]:
    return [deflection.shaft_lag(each) for each in motions]


def test_a_known_delay_and_amplitude_loss_are_recovered() -> None:
    """The shaft follows the motor 3 ms later and 1 % smaller; both drift."""
    t = DT * np.arange(26 * 1500)
    motor = 0.2 * np.cos(2.0 * np.pi * t / 1.5) + 0.01 * t
    shaft = 0.198 * np.cos(2.0 * np.pi * (t - 0.003) / 1.5) + 0.01 * t
    cut = periods.cut_periods(len(t), 1.5, DT)
    assert cut.period_count == 26
    lag = deflection.shaft_lag(
        deflection.trim_motion(motor, shaft, 10.0 * np.sin(t * 0.0 + 1.0), cut)
    )
    assert lag.phase_shift == pytest.approx(0.002, abs=1e-6)
    assert lag.amplitude_difference == pytest.approx(0.002, rel=1e-3)
    assert lag.rms_velocity == pytest.approx(0.2 * 2 * np.pi / 1.5 / np.sqrt(2), rel=1e-3)
    assert periods.drift(motor, cut) == pytest.approx(0.01, rel=1e-3)


def test_detrending_leaves_a_pure_sine_unchanged() -> None:
    t = DT * np.arange(26 * 1500)
    sine = np.sin(2.0 * np.pi * t / 1.5)
    cut = periods.cut_periods(len(t), 1.5, DT)
    assert np.abs(periods.detrend(sine, cut) - sine).max() < 1e-9


def test_periods_start_at_the_maximum_of_the_reference() -> None:
    t = DT * np.arange(6000)
    assert periods.first_maximum(np.cos(2.0 * np.pi * (t - 0.4) / 1.5), 1.5, DT) == 400
    assert periods.first_maximum(np.zeros(6000), 1.5, DT) == 0


def test_periods_may_last_a_fraction_of_a_sample() -> None:
    cut = periods.cut_periods(10_000, 0.9995, DT)
    assert cut.period_count == 10
    assert cut.edges[-1] == 9995
    with pytest.raises(ValueError, match="no whole period"):
        periods.cut_periods(1000, 1.5, DT)


def test_backlash_and_stiffness_reproduce_the_thesis_trends(
    points: list[deflection.ShaftLag],
) -> None:
    """The signs of figures 2.4 and 2.5 follow from a model without explicit trends."""
    trends = driveline.fit_regressions(points)
    assert trends.amplitude.slope > 0.0
    assert trends.amplitude.r_squared > 0.85
    assert trends.velocity_phase.slope < 0.0
    assert 0.5 < trends.velocity_phase.r_squared < 0.9
    assert driveline.explained_variance(points) > 0.97
    worst = max(each.deflection_high for each in points) / bench.DEGREE
    assert 0.24 < worst < 0.26


@pytest.mark.parametrize("by_torque", [False, True])
def test_equation_2_6_halves_the_deflection(
    motions: list[deflection.Motion], points: list[deflection.ShaftLag], by_torque: bool
) -> None:
    """Each set point is rated by regressions that exclude it."""
    before = deflection.pooled_percentile([each.deflection for each in motions])
    after = deflection.pooled_percentile(
        [
            driveline.correct_offline(
                each,
                driveline.predict_correction(
                    driveline.fit_regressions([*points[:i], *points[i + 1 :]]),
                    point,
                    delay_over_torque=by_torque,
                ),
                point.amplitude,
            )
            - each.shaft
            for i, (each, point) in enumerate(zip(motions, points, strict=True))
        ]
    )
    assert after < (0.6 if by_torque else 0.5) * before


def test_the_offline_correction_undoes_a_pure_delay_and_loss() -> None:
    t = DT * np.arange(3000)
    motor, shaft = (a * np.cos(2.0 * np.pi * (t - s) / 1.5) for a, s in ((0.2, 0.0), (0.19, 0.01)))
    motion = deflection.trim_motion(motor, shaft, t, periods.cut_periods(len(t), 1.5, DT))
    correction = driveline.Correction(0.01, 0.01 / 1.5)
    assert driveline.correct_offline(motion, correction, 0.2) == pytest.approx(
        motion.shaft, abs=1e-9
    )


def test_regressions_refuse_two_set_points(points: list[deflection.ShaftLag]) -> None:
    with pytest.raises(ValueError, match="2 set points"):
        driveline.fit_regressions(points[:2])
