"""Phase shift, amplitude difference, their trends and the corrections made of them."""

import numpy as np
import play_operator as bench
import pytest

from rig.analysis.session import deflection, periods, regressions

DT = 0.001


@pytest.fixture(scope="module")
def motions() -> list[deflection.Motion]:
    signals = bench.run(bench.THESIS, periods=3, dt=DT)
    of = periods.cut(len(signals.motor), 1.5, DT)
    return [
        deflection.motion(*(each[:, 0, j] for each in signals), of)
        for j in range(len(bench.TABLE_2_1))
    ]


@pytest.fixture(scope="module")
def points(motions: list[deflection.Motion]) -> list[deflection.Behind]:
    return [deflection.behind(each) for each in motions]


def test_a_known_delay_and_loss_are_found() -> None:
    """A shaft that is the motor 3 ms later and 1 % smaller, both drifting."""
    t = DT * np.arange(26 * 1500)
    motor = 0.2 * np.cos(2.0 * np.pi * t / 1.5) + 0.01 * t
    shaft = 0.198 * np.cos(2.0 * np.pi * (t - 0.003) / 1.5) + 0.01 * t
    of = periods.cut(len(t), 1.5, DT)
    assert of.whole == 26
    found = deflection.behind(deflection.motion(motor, shaft, 10.0 * np.sin(t * 0.0 + 1.0), of))
    assert found.phase_shift == pytest.approx(0.002, abs=1e-6)
    assert found.amplitude_difference == pytest.approx(0.002, rel=1e-3)
    assert found.rms_velocity == pytest.approx(0.2 * 2 * np.pi / 1.5 / np.sqrt(2), rel=1e-3)
    assert periods.drift(motor, of) == pytest.approx(0.01, rel=1e-3)


def test_a_line_alone_would_tilt_a_sine() -> None:
    t = DT * np.arange(26 * 1500)
    sine = np.sin(2.0 * np.pi * t / 1.5)
    of = periods.cut(len(t), 1.5, DT)
    assert np.abs(periods.detrended(sine, of) - sine).max() < 1e-9


def test_periods_begin_where_the_reference_is_largest() -> None:
    t = DT * np.arange(6000)
    assert periods.begin(np.cos(2.0 * np.pi * (t - 0.4) / 1.5), 1.5, DT) == 400
    assert periods.begin(np.zeros(6000), 1.5, DT) == 0


def test_periods_of_no_whole_number_of_samples() -> None:
    of = periods.cut(10_000, 0.9995, DT)
    assert of.whole == 10
    assert of.edges[-1] == 9995
    with pytest.raises(ValueError, match="no whole period"):
        periods.cut(1000, 1.5, DT)


def test_the_thesis_trends_come_out_of_backlash_and_stiffness(
    points: list[deflection.Behind],
) -> None:
    """Signs of figures 2.4 and 2.5, from a model that knows neither."""
    found = regressions.regress(points)
    assert found.amplitude.slope > 0.0
    assert found.amplitude.r_squared > 0.85
    assert found.phase.slope < 0.0
    assert 0.5 < found.phase.r_squared < 0.9
    assert regressions.explained(points) > 0.97
    worst = max(each.deflection_high for each in points) / bench.DEGREE
    assert 0.24 < worst < 0.26


@pytest.mark.parametrize("by_torque", [False, True])
def test_equation_2_6_halves_the_deflection(
    motions: list[deflection.Motion], points: list[deflection.Behind], by_torque: bool
) -> None:
    """Judged on set points that the regressions have not seen."""
    before = deflection.pooled([each.deflection for each in motions])
    after = deflection.pooled(
        [
            regressions.offline(
                each,
                regressions.predicted(regressions.without(points, i), point, by_torque=by_torque),
                point.amplitude,
            )
            - each.shaft
            for i, (each, point) in enumerate(zip(motions, points, strict=True))
        ]
    )
    assert after < (0.6 if by_torque else 0.5) * before


def test_a_pure_delay_and_loss_are_undone_whole() -> None:
    t = DT * np.arange(3000)
    motor, shaft = (a * np.cos(2.0 * np.pi * (t - s) / 1.5) for a, s in ((0.2, 0.0), (0.19, 0.01)))
    of = deflection.motion(motor, shaft, t, periods.cut(len(t), 1.5, DT))
    by = regressions.Correction(0.01, 0.01 / 1.5)
    assert regressions.offline(of, by, 0.2) == pytest.approx(of.shaft, abs=1e-9)


def test_two_set_points_make_no_trend(points: list[deflection.Behind]) -> None:
    with pytest.raises(ValueError, match="2 set points"):
        regressions.regress(points[:2])
