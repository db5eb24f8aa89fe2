"""Run 120 of the MASK4 test, campaign file to effects table: what drive settings do.

MASK4 report (Sandia), 4.4: a lower switching frequency helps most, a higher bus voltage costs a
little, a velocity threshold helps marginally and not always. The table has to come out of losses:
without switching loss in the plant its order is another.

The compiled loop walks the rows; it has the bits of a rehearsal (tests/batch/test_batch_bits), and
two of the rows are rehearsed beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import (
    CONFIGS,
    assert_same_rows,
    campaign_file,
    run,
    sequentially_swept,
    table_of,
    yaml_file,
)

from rig.analysis.comparison import compare, power_difference
from rig.analysis.comparison_picture import write_comparison
from rig.analysis.comparison_table import as_text
from rig.analysis.effects import Effect, Effects, compute_effects
from rig.analysis.effects_table import effect_notes

SHORT = CONFIGS / "campaigns" / "mask4_run_120_short.yaml"
# Rows of three wave periods in place of four, and less of a wait before the first.
QUICK = {"timing": {"settle_s": 5, "periods": 3}, "start": {"lead_in_s": 20}}
NO_SWITCHING = {
    name: {"value": 0.0, "unit": unit, "source": "what if"}
    for name, unit in (("switching_loss", "W/kHz"), ("switching_linear_loss", "W/A/kHz"))
}


def campaign(folder: Path, **keys: Any) -> Path:
    """The short campaign, with keys changed."""
    return yaml_file(folder / "campaign.yaml", {"extends": str(SHORT), **QUICK, **keys})


def eight_rows(path: Path) -> Any:
    """The rows of a campaign from the compiled loop."""
    table = sequentially_swept(path)
    assert set(table.state.values.tolist()) == {"complete"}
    assert table.sizes["row"] == 8
    return table


def on_dc(table: Any) -> tuple[Effects, dict[str, Effect]]:
    """Main effects on DC power, and each by its column."""
    found = compute_effects(table, "dc")
    assert found is not None
    return found, {each.column.name: each for each in found.effects}


def below(effect: Effect) -> bool:
    """Whether the whole interval says that the column's upper end absorbs more."""
    return effect.watts + effect.half_width < 0.0


def size_interval(effect: Effect) -> tuple[float, float]:
    """Least and greatest size within the interval of a clear effect, W."""
    return abs(effect.watts) - effect.half_width, abs(effect.watts) + effect.half_width


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return eight_rows(campaign(tmp_path_factory.mktemp("run_120")))


def test_signs_and_ranks(table: Any, record_property: Callable[[str, object], None]) -> None:
    """Frequency, then voltage, then threshold; every sign and every place beyond the scatter.

    Frequency and voltage multiply, and eight rows of straight lines cannot tell their order
    against what that leaves: the page has to say so. The 36 rows of the whole run can.
    """
    found, named = on_dc(table)
    for name, effect in named.items():
        record_property(name, f"{effect.watts:+.2f} +- {effect.half_width:.2f} W")
    assert list(named) == ["switching_period", "bus_voltage", "velocity_threshold"]
    frequency, voltage, threshold = found.effects
    assert below(frequency)  # from 20 to 5 kHz
    assert voltage.watts - voltage.half_width > 0.0  # from 40 to 80 V
    assert below(threshold)
    assert found.lead > found.lead_half_width
    assert found.lead < found.lead_misfit_half_width
    assert "by misfit: not surely)" in "; ".join(effect_notes(found))
    assert size_interval(voltage)[0] > size_interval(threshold)[1]
    assert 6.0 < -frequency.watts < 12.0  # "about 10 W" at 75 V, half of that at 40 V
    assert 2.0 < voltage.watts < 8.0  # "a few watts"
    assert size_interval(threshold)[1] < 2.5


def test_a_rehearsal_measures_the_same_rows(tmp_path: Path) -> None:
    """Of the eight the two that differ in every setting, which is a change of all between them."""
    fixed = {"spring_n_per_m": -8508, "kp_n_s_per_m": -2500, "ki_n_per_m": 3000}
    names = ("bus_voltage_v", "switching_period_s", "velocity_threshold_m_per_s")
    corners = ((40, 5.0e-5, 0), (80, 2.0e-4, 0.1))
    grid = [fixed | dict(zip(names, corner, strict=True)) for corner in corners]
    path = campaign(tmp_path, matrix={"grid": grid})
    ended = run(path, tmp_path / "runs")
    assert ended.outcome.status == "complete"
    assert ended.outcome.dropped == ended.outcome.unsaved == 0
    assert_same_rows(table_of(ended), sequentially_swept(path))


def test_drive_settings_move_dc_power_alone(table: Any) -> None:
    """AC power changes by what the threshold forgoes, mechanical power no more than that."""
    for kind in ("ac", "mechanical_1"):
        found = compute_effects(table, kind)
        assert found is not None
        named = {each.column.name: each for each in found.effects}
        assert abs(named["switching_period"].watts) < 0.05
        assert abs(named["bus_voltage"].watts) < 0.05
        assert named["velocity_threshold"].watts > 0.0


def test_losses_are_the_stated_ones(table: Any) -> None:
    """DC - AC of the rows without threshold, from each row's own current and bus voltage.

    P = 4 + 0.4 f u + u2 + (1.5 + 0.06 f u) mean |i| + 0.015 i2, u = V/75 V, f in kHz; of a sine
    mean |i| is 0.9003 of the rms. 0.3 W of room: u is taken as the row's mean.
    """
    rows = table.where(table.velocity_threshold == 0.0, drop=True)
    assert rows.sizes["row"] == 4
    kilohertz = 1.0e-3 / rows.switching_period.values
    u = rows.bus_voltage_mean.values / 75.0
    rms = rows.current_rms.values
    loss = 4.0 + 0.4 * kilohertz * u + u**2 + 0.015 * rms**2
    loss += (1.5 + 0.06 * kilohertz * u) * rms * math.sqrt(8.0) / math.pi
    found = rows.power_dc.values - rows.power_ac.values
    np.testing.assert_allclose(found, loss, atol=0.3)


def test_40_volts_are_enough_in_this_sea(table: Any) -> None:
    """They fail near 0.27 m/s; the hull moves at 0.21 m/s."""
    assert float(table.velocity_peak.max()) < 0.23
    assert (table.share_saturated == 0.0).all()


def test_the_threshold_rests_the_drive(table: Any) -> None:
    gated = table.share_gated.values
    acting = table.velocity_threshold.values > 0.0
    assert (gated[~acting] == 0.0).all()
    assert ((gated[acting] > 0.05) & (gated[acting] < 0.5)).all()


def test_against_the_commercial_drive(tmp_path: Path) -> None:
    """Same row, same sea: 6.7 W are consumed by the one, 22.1 W captured by the other."""
    row = {"spring_n_per_m": -8508, "kp_n_s_per_m": -2500, "ki_n_per_m": 3000}
    folders = []
    for name in ("wavebot", "wavebot_custom"):
        path = campaign_file(
            tmp_path / name,
            rig=str(CONFIGS / "rigs" / f"{name}.yaml"),
            sea={"kind": "regular", "amplitude_m": 0.0635, "frequency_hz": 0.3},
            tare={"duration_s": 1},
            surge={"use": "off"},
            start={"lead_in_s": 12},
            timing={"settle_s": 5, "periods": 2},
            matrix={"list": [row]},
        )
        ended = run(path, tmp_path / "runs")
        assert ended.outcome.status == "complete"
        folders.append(ended.folder)
    told = compare(*folders)
    (pair,) = told.matched.pairs
    assert pair.a.power["dc"] == pytest.approx(6.7, abs=0.5)
    assert pair.b.power["dc"] == pytest.approx(-22.1, abs=0.5)
    for kind in ("mechanical_1", "mechanical_2", "ac"):  # the drive is behind them
        assert abs(power_difference(pair, kind).watts) < 0.1
    assert (told.a.rig, told.b.rig) == ("WaveBot", "WaveBot, custom drive")
    assert {each.group for each in told.differences} == {"drive", "plant", "rig"}
    text = as_text(told)
    assert "A cots" in text
    assert "B custom" in text
    assert write_comparison(told, tmp_path / "compared.png").stat().st_size > 10_000


def test_without_switching_loss_the_ranking_is_another(
    tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """Frequency, first before, is nothing; voltage leads by its ripple loss.

    That is 1 W at 75 V and goes with the square of voltage: 0.85 W between 40 and 80 V.
    """
    plant = yaml_file(
        tmp_path / "plant.yaml",
        {
            "extends": str(CONFIGS / "plants" / "wavebot_custom.yaml"),
            "name": "WaveBot, custom drive that switches for nothing",
            "drive": NO_SWITCHING,
        },
    )
    found, named = on_dc(eight_rows(campaign(tmp_path, plant=str(plant))))
    for name, effect in named.items():
        record_property(name, f"{effect.watts:+.3f} +- {effect.half_width:.3f} W")
    voltage = found.effects[0]
    assert voltage.column.name == "bus_voltage"
    assert voltage.watts - voltage.half_width > 0.0
    assert 0.7 < voltage.watts < 0.95
    assert found.lead > found.lead_half_width
    frequency = named["switching_period"]
    assert abs(frequency.watts) < 0.05
    assert size_interval(frequency)[1] < 0.1 * size_interval(voltage)[0]
