"""Run 120 of the MASK4 test, campaign file to effects table: the effects of drive settings.

MASK4 report (Sandia), 4.4: a lower switching frequency helps most, a higher bus voltage costs a
little, a velocity threshold helps marginally and not always. The table must result from losses:
without switching loss in the plant its order is another.

The compiled loop runs the rows; it has the bits of a rehearsal (tests/batch/test_batch_bits), and
two of the rows are rehearsed for comparison.
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
    load_rows,
    rehearse,
    sweep_sequentially,
    write_campaign,
    write_yaml,
)

from rig.analysis.comparison import compare, power_difference
from rig.analysis.comparison_picture import write_comparison
from rig.analysis.comparison_text import as_text
from rig.analysis.effects import Effect, Effects, compute_effects, effect_notes

SHORT = CONFIGS / "campaigns" / "mask4_run_120_short.yaml"
# Rows of three wave periods in place of four, and a shorter lead-in.
QUICK = {"timing": {"settle_s": 5, "periods": 3}, "start": {"lead_in_s": 20}}
NO_SWITCHING = {
    name: {"value": 0.0, "unit": unit, "source": "what if"}
    for name, unit in (("switching_loss", "W/kHz"), ("switching_linear_loss", "W/A/kHz"))
}


def campaign(folder: Path, **keys: Any) -> Path:
    """Write the short campaign with changed keys."""
    return write_yaml(folder / "campaign.yaml", {"extends": str(SHORT), **QUICK, **keys})


def sweep_eight_rows(path: Path) -> Any:
    """Return the rows of a campaign from the compiled loop."""
    table = sweep_sequentially(path)
    assert set(table.state.values.tolist()) == {"complete"}
    assert table.sizes["row"] == 8
    return table


def dc_effects(table: Any) -> tuple[Effects, dict[str, Effect]]:
    """Return the main effects on DC power, and each by its column."""
    found = compute_effects(table, "dc")
    assert found is not None
    return found, {each.column.name: each for each in found.effects}


def is_negative(effect: Effect) -> bool:
    """Return whether the whole interval is negative: the column's upper level absorbs more."""
    return effect.watts + effect.half_width < 0.0


def size_interval(effect: Effect) -> tuple[float, float]:
    """Return the least and greatest magnitude within the interval of a clear effect, W."""
    return abs(effect.watts) - effect.half_width, abs(effect.watts) + effect.half_width


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return sweep_eight_rows(campaign(tmp_path_factory.mktemp("run_120")))


def test_signs_and_ranks(table: Any, record_property: Callable[[str, object], None]) -> None:
    """Frequency, then voltage, then threshold; every sign and every rank exceeds the scatter.

    Frequency and voltage multiply. Against that misfit, eight rows of a linear model cannot
    separate the first two ranks, and the page must state it. The 36 rows of the whole run can.
    """
    found, named = dc_effects(table)
    for name, effect in named.items():
        record_property(name, f"{effect.watts:+.2f} +- {effect.half_width:.2f} W")
    assert list(named) == ["switching_period", "bus_voltage", "velocity_threshold"]
    frequency, voltage, threshold = found.effects
    assert is_negative(frequency)  # from 20 to 5 kHz
    assert voltage.watts - voltage.half_width > 0.0  # from 40 to 80 V
    assert is_negative(threshold)
    assert found.lead > found.lead_half_width
    assert found.lead < found.lead_misfit_half_width
    assert "by misfit: not significant)" in "; ".join(effect_notes(found))
    assert size_interval(voltage)[0] > size_interval(threshold)[1]
    assert 6.0 < -frequency.watts < 12.0  # "about 10 W" at 75 V, half of that at 40 V
    assert 2.0 < voltage.watts < 8.0  # "a few watts"
    assert size_interval(threshold)[1] < 2.5


def test_a_rehearsal_measures_the_same_rows(tmp_path: Path) -> None:
    """Rehearse the two of the eight rows that differ in every setting."""
    fixed = {"spring_n_per_m": -8508, "kp_n_s_per_m": -2500, "ki_n_per_m": 3000}
    names = ("bus_voltage_v", "switching_period_s", "velocity_threshold_m_per_s")
    corners = ((40, 5.0e-5, 0), (80, 2.0e-4, 0.1))
    grid = [fixed | dict(zip(names, corner, strict=True)) for corner in corners]
    path = campaign(tmp_path, matrix={"grid": grid})
    result = rehearse(path, tmp_path / "runs")
    assert result.outcome.status == "complete"
    assert result.outcome.dropped == result.outcome.unsaved == 0
    assert_same_rows(load_rows(result), sweep_sequentially(path))


def test_drive_settings_move_dc_power_alone(table: Any) -> None:
    """Only the threshold changes AC and mechanical power, by the power that it forgoes."""
    for kind in ("ac", "mechanical_1"):
        found = compute_effects(table, kind)
        assert found is not None
        named = {each.column.name: each for each in found.effects}
        assert abs(named["switching_period"].watts) < 0.05
        assert abs(named["bus_voltage"].watts) < 0.05
        assert named["velocity_threshold"].watts > 0.0


def test_losses_are_the_stated_ones(table: Any) -> None:
    """DC - AC of the rows without threshold follows from each row's own current and bus voltage.

    P = 4 + 0.4 f u + u2 + (1.5 + 0.06 f u) mean |i| + 0.015 i2, u = V/75 V, f in kHz; of a sine
    mean |i| is 0.9003 of the rms. The tolerance is 0.3 W, because u is the row's mean.
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
    """The drive would saturate near 0.27 m/s; the hull moves at 0.21 m/s."""
    assert float(table.velocity_peak.max()) < 0.23
    assert (table.share_saturated == 0.0).all()


def test_the_threshold_gates_the_drive(table: Any) -> None:
    gated = table.share_gated.values
    acting = table.velocity_threshold.values > 0.0
    assert (gated[~acting] == 0.0).all()
    assert ((gated[acting] > 0.05) & (gated[acting] < 0.5)).all()


def test_custom_against_commercial_drive(tmp_path: Path) -> None:
    """Same row, same sea: the commercial drive consumes 6.7 W, the custom one captures 22.1 W."""
    row = {"spring_n_per_m": -8508, "kp_n_s_per_m": -2500, "ki_n_per_m": 3000}
    folders = []
    for name in ("wavebot", "wavebot_custom"):
        path = write_campaign(
            tmp_path / name,
            rig=str(CONFIGS / "rigs" / f"{name}.yaml"),
            sea={"kind": "regular", "amplitude_m": 0.0635, "frequency_hz": 0.3},
            tare={"duration_s": 1},
            surge={"use": "off"},
            start={"lead_in_s": 12},
            timing={"settle_s": 5, "periods": 2},
            matrix={"list": [row]},
        )
        result = rehearse(path, tmp_path / "runs")
        assert result.outcome.status == "complete"
        folders.append(result.folder)
    comparison = compare(*folders)
    (pair,) = comparison.matched.pairs
    assert pair.a.power["dc"] == pytest.approx(6.7, abs=0.5)
    assert pair.b.power["dc"] == pytest.approx(-22.1, abs=0.5)
    for kind in ("mechanical_1", "mechanical_2", "ac"):  # upstream of the drive
        assert abs(power_difference(pair, kind).watts) < 0.1
    assert (comparison.a.rig, comparison.b.rig) == ("WaveBot", "WaveBot, custom drive")
    assert {each.group for each in comparison.differences} == {"drive", "plant", "rig"}
    text = as_text(comparison)
    assert "A cots" in text
    assert "B custom" in text
    assert write_comparison(comparison, tmp_path / "compared.png").stat().st_size > 10_000


def test_without_switching_loss_the_ranking_changes(
    tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """Frequency, first before, has no effect; voltage leads by its ripple loss.

    That is 1 W at 75 V and goes with the square of voltage: 0.85 W between 40 and 80 V.
    """
    plant = write_yaml(
        tmp_path / "plant.yaml",
        {
            "extends": str(CONFIGS / "plants" / "wavebot_custom.yaml"),
            "name": "WaveBot, custom drive that switches for nothing",
            "drive": NO_SWITCHING,
        },
    )
    found, named = dc_effects(sweep_eight_rows(campaign(tmp_path, plant=str(plant))))
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
