"""Gap, soft zone and stiffness of benches that the fit has not seen."""

import numpy as np
import play_operator as bench
import pytest

from rig.analysis.session import deflection, periods, torque_map

DT = 0.002
BENCHES = 40
POINTS = bench.TABLE_2_1


def _maps(truth: bench.Truth, signals: bench.Signals) -> list[torque_map.TorqueMap]:
    of = periods.cut(len(signals.motor), 1.5, DT)
    return [
        torque_map.fit(
            [
                torque_map.loaded(deflection.motion(*(each[:, i, j] for each in signals), of))
                for j in range(len(POINTS))
            ]
        )
        for i in range(len(truth.gap))
    ]


@pytest.fixture(scope="module")
def blind() -> tuple[bench.Truth, list[torque_map.TorqueMap]]:
    truth = bench.drawn(BENCHES, seed=71)
    signals = bench.run(truth, periods=2, dt=DT, seed=5, wander=0.02)
    return truth, _maps(truth, signals)


@pytest.mark.parametrize(
    ("name", "key", "near"),
    [("half_gap", "gap", 0.05), ("soft_zone", "soft", 0.05), ("stiffness", "stiffness", 0.02)],
)
def test_hidden_constants_lie_within_the_interval(
    blind: tuple[bench.Truth, list[torque_map.TorqueMap]], name: str, key: str, near: float
) -> None:
    """95 % of the time; of 40 benches fewer than 34 or only useless intervals would tell."""
    truth, maps = blind
    hidden = getattr(truth, key)[:, 0]
    found = [getattr(each, name) for each in maps]
    assert sum(f.holds(h) for f, h in zip(found, hidden, strict=True)) >= 34
    assert np.median([f.uncertainty / h for f, h in zip(found, hidden, strict=True)]) < near
    assert np.corrcoef([f.value for f in found], hidden)[0, 1] > 0.99


def test_the_map_says_what_the_deflection_is() -> None:
    known = _maps(bench.THESIS, bench.run(bench.THESIS, periods=2, dt=DT, noise=0.0))[0]
    bent = torque_map.deflection(known, np.array([-95.0, 95.0])) / bench.DEGREE
    by_hand = 0.0228 + 0.039 + 95.0 / 28483.0 / bench.DEGREE
    assert bent == pytest.approx([-by_hand, by_hand], rel=0.005)
    assert known.r_squared > 0.999


def test_too_few_set_points_have_no_map() -> None:
    signals = bench.run(bench.THESIS, POINTS[:2], periods=2, dt=DT)
    of = periods.cut(len(signals.motor), 1.5, DT)
    motions = [deflection.motion(*(e[:, 0, j] for e in signals), of) for j in range(2)]
    with pytest.raises(ValueError, match="2 set points under load"):
        torque_map.fit([torque_map.loaded(each) for each in motions])
