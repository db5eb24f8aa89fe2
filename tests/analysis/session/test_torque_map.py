"""Gap, soft zone and stiffness of benches with hidden constants."""

import numpy as np
import play_operator as bench
import pytest

from rig.kinds.oswec_bench.products import deflection, periods, torque_map

DT = 0.002
BENCHES = 40
POINTS = bench.TABLE_2_1


def _fit_maps(truth: bench.Truth, signals: bench.Signals) -> list[torque_map.TorqueMap]:
    cut = periods.cut_periods(len(signals.motor), 1.5, DT)
    return [
        torque_map.fit_map(
            [
                torque_map.bin_deflection(
                    deflection.trim_motion(*(each[:, i, j] for each in signals), cut)
                )
                for j in range(len(POINTS))
            ]
        )
        for i in range(len(truth.gap))
    ]


@pytest.fixture(scope="module")
def blind() -> tuple[bench.Truth, list[torque_map.TorqueMap]]:
    truth = bench.draw_truth(BENCHES, seed=71)
    signals = bench.simulate(truth, periods=2, dt=DT, seed=5, gap_scatter=0.02)
    return truth, _fit_maps(truth, signals)


@pytest.mark.parametrize(
    ("name", "key", "max_width"),
    [("half_gap", "gap", 0.05), ("soft_zone", "soft", 0.05), ("stiffness", "stiffness", 0.02)],
)
def test_hidden_constants_lie_within_the_interval(
    blind: tuple[bench.Truth, list[torque_map.TorqueMap]], name: str, key: str, max_width: float
) -> None:
    """At least 34 of 40 intervals of 95 % contain the truth, and they are narrow."""
    truth, maps = blind
    hidden = getattr(truth, key)[:, 0]
    estimates = [getattr(each, name) for each in maps]
    assert sum(f.covers(h) for f, h in zip(estimates, hidden, strict=True)) >= 34
    assert (
        np.median([f.uncertainty / h for f, h in zip(estimates, hidden, strict=True)]) < max_width
    )
    assert np.corrcoef([f.value for f in estimates], hidden)[0, 1] > 0.99


def test_the_map_returns_the_deflection_of_a_torque() -> None:
    fitted_map = _fit_maps(bench.THESIS, bench.simulate(bench.THESIS, periods=2, dt=DT, noise=0.0))[
        0
    ]
    deflection = torque_map.map_deflection(fitted_map, np.array([-95.0, 95.0])) / bench.DEGREE
    by_hand = 0.0228 + 0.039 + 95.0 / 28483.0 / bench.DEGREE
    assert deflection == pytest.approx([-by_hand, by_hand], rel=0.005)
    assert fitted_map.residual < 1e-3 * deflection[1] * bench.DEGREE


def test_the_map_fit_refuses_two_set_points() -> None:
    signals = bench.simulate(bench.THESIS, POINTS[:2], periods=2, dt=DT)
    cut = periods.cut_periods(len(signals.motor), 1.5, DT)
    motions = [deflection.trim_motion(*(e[:, 0, j] for e in signals), cut) for j in range(2)]
    with pytest.raises(ValueError, match="2 set points under load"):
        torque_map.fit_map([torque_map.bin_deflection(each) for each in motions])
