"""The default campaign shows the MASK4 finding: the spring changes electrical power only.

Equal effective stiffness (Ki - Ks) gives equal mechanical power, but the magnetic spring gives it
without motor current, so AC and DC power gain (MASK4 report, section 4.3). The optima of AC and DC
power differ because the drive's own losses grow with current.

All 66 rows come from the compiled loop, which has the bits of a rehearsal (tests/batch/
test_batch_bits). A short form of the campaign is rehearsed as well, including its products. The
whole rehearsal is `make run`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import (
    CONFIGS,
    assert_same_rows,
    load_rows,
    rehearse,
    sweep_sequentially,
    write_yaml,
)

from rig.analysis.report import write_products
from rig.analysis.slices import find_optima

STIFF, SOFT = 490.9, -5715.0
SHORT: dict[str, Any] = {
    "start": {"lead_in_s": 10},
    "timing": {"settle_s": 2, "interval_s": 8},
    "matrix": {
        "grid": [
            {"spring_n_per_m": spring, "kp_n_s_per_m": [-1500, -2500], "ki_n_per_m": ki}
            for spring, ki in ((STIFF, [2000, 4000]), (SOFT, [-2000, 0]))
        ]
    },
}


def campaign(folder: Path, **keys: Any) -> Path:
    """Write the default campaign with changed keys."""
    default = str(CONFIGS / "campaigns" / "default.yaml")
    return write_yaml(folder / "campaign.yaml", {"extends": default, **keys})


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return sweep_sequentially(campaign(tmp_path_factory.mktemp("default")))


@pytest.fixture(scope="module")
def best(table: Any) -> dict[tuple[str, float], Any]:
    return {(o.station.name, o.point.setting["spring_rate"]): o for o in find_optima(table)}


def test_all_rows_are_complete(table: Any) -> None:
    assert table.sizes["row"] == 66
    assert set(table.state.values.tolist()) == {"complete"}
    assert (table["samples"] == 14_000).all()  # 7 periods of 2 s at 1 kHz


def test_motion_and_current_stay_within_bounds(table: Any) -> None:
    assert float(table.position_peak.max()) <= 0.12
    assert float(table.velocity_peak.max()) <= 0.38
    assert float(table.current_peak.max()) <= 16.0
    assert float(np.abs(table.position_mean).max()) < 0.005


def test_optima_lie_inside_the_grid(best: dict[tuple[str, float], Any]) -> None:
    for kind in ("mechanical_1", "ac", "dc"):
        for spring in (STIFF, SOFT):
            assert not best[kind, spring].at_edge, (kind, spring)


def test_ac_and_dc_optima_differ_without_the_spring(best: dict[tuple[str, float], Any]) -> None:
    ac, dc = best["ac", STIFF].point.setting, best["dc", STIFF].point.setting
    assert (ac["kp"], ac["ki"]) != (dc["kp"], dc["ki"])


def test_the_spring_changes_electrical_power_only(
    best: dict[tuple[str, float], Any],
) -> None:
    mechanical = [best["mechanical_1", spring].power for spring in (STIFF, SOFT)]
    assert mechanical[0] == pytest.approx(-91.0, rel=0.01)  # W, from an earlier model of the plant
    assert mechanical[1] == pytest.approx(mechanical[0], rel=0.03)
    assert best["ac", SOFT].power <= 1.08 * best["ac", STIFF].power  # negative is absorbed
    assert best["dc", SOFT].power <= best["dc", STIFF].power - 5.0  # W; no ratio near zero


def test_equal_effective_stiffness_gives_equal_mechanical_power(table: Any) -> None:
    """For each Kp the two springs have one curve of power over Ki - Ks.

    The tolerance is 5 % and 1 W: the curves are interpolated over steps of 2000 N/m, and the
    magnetic spring softens with stroke while Ki does not.
    """
    for kp in np.unique(table.kp):
        curves = []
        for spring in (STIFF, SOFT):
            rows = table.where((table.kp == kp) & (table.spring_rate == spring), drop=True)
            stiffness = rows.ki.values - spring
            order = np.argsort(stiffness)
            curves.append((stiffness[order], rows.power_mechanical_1.values[order]))
        (x, y), (at, power) = curves
        inside = (at >= x[0]) & (at <= x[-1])
        assert inside.sum() >= 4
        np.testing.assert_allclose(power[inside], np.interp(at[inside], x, y), rtol=0.05, atol=1.0)


def test_short_form_is_rehearsed_with_its_products(tmp_path: Path) -> None:
    """Two springs, four gains each: no row is lost, the rows are those of the compiled loop."""
    path = campaign(tmp_path, **SHORT)
    result = rehearse(path, tmp_path / "runs")
    assert result.outcome.status == "complete"
    assert result.outcome.dropped == result.outcome.unsaved == 0
    table = load_rows(result)
    assert table.sizes["row"] == 8
    assert_same_rows(table, sweep_sequentially(path))
    products = {path.name for path in write_products(result.folder)}
    assert {"rows.csv", "rows.nc", "surfaces.png", "summary.pdf"} <= products
