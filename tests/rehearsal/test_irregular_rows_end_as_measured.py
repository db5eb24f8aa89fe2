"""Rows in irregular seas that settle, and end, as measured: loop, log, replay and row table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import rig
from made_once import made_once
from rehearsing import CONFIGS, write_yaml
from scipy.stats import t as student_t

from rig.analysis.cut_rows import cut_message
from rig.analysis.points import error_source, gain_matrix
from rig.analysis.row_ends import FULL, PRECISE, WORSE
from rig.analysis.rows import COMPLETE, row_table
from rig.config.problems import ConfigError
from rig.execution.replay import replay
from rig.kinds.wavebot.campaign import open_campaign
from rig.realtime.sequence import MEASURE
from rig.recording.runs import open_run

REPEAT_S = 100.0
BIN_TICKS = 1000 * REPEAT_S / 60
KP_KI = ((-2000, 2000), (-2000, 0), (-1500, 0), (-3500, -4000), (-2000, 2000))
END: dict[str, Any] = {"precision_w": 0.15, "worse_rows": True}
TANK = {"depth_m": 2.74, "device_m": 28.688, "length_m": 76.224, "still_s": 1, "ramp_s": 2}


def write_campaign(folder: Path, **keys: Any) -> Path:
    gains = [{"kp_n_s_per_m": kp, "ki_n_per_m": ki} for kp, ki in KP_KI]
    return write_yaml(
        folder / "irregular.yaml",
        {
            "name": "irregular",
            "rig": str(CONFIGS / "rigs" / "wavebot.yaml"),
            "sea": {"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.5, "repeat_s": REPEAT_S, "seed": 5},
            "tare": {"duration_s": 1},
            "start": {"lead_in_s": 20},
            "matrix": {"list": [{"spring_n_per_m": -5715, **each} for each in gains]},
            "timing": {"settle": "measured", "end": END},
            **keys,
        },
    )


def make_run(folder: Path, *options: str, **keys: Any) -> Path:
    runs = folder / "runs"
    done = rig("run", write_campaign(folder, **keys), "--runs", runs, "--json", *options)
    assert done.returncode == 0, done.stderr
    (run,) = runs.iterdir()
    return Path(run)


def shared(factory: pytest.TempPathFactory, name: str, *options: str, **keys: Any) -> Path:
    place = made_once(factory, name, lambda folder: make_run(folder, *options, **keys))
    (run,) = (place / "runs").iterdir()
    return Path(run)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shared(tmp_path_factory, "irregular_measured")


@pytest.fixture(scope="module")
def fixed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shared(tmp_path_factory, "irregular_fixed", timing={"settle_s": 10})


def test_rows_end_early_and_their_powers_are_those_of_the_whole_period(
    measured: Path, fixed: Path
) -> None:
    """The truth is the run with a window of the whole repeat period for each row."""
    table, truth = row_table(measured), row_table(fixed)
    assert table["state"].values.tolist() == [COMPLETE] * len(KP_KI)
    bins = np.round(table["samples"].values / BIN_TICKS).astype(int)
    assert bins[0] == 60
    assert (bins[1:] < 60).all()
    assert (bins[1:] >= 10).all()
    assert table["batches"].values.tolist() == [0, *(bins[1:] // 2).tolist()]
    assert table["compared_with"].values.tolist() == [-1, 0, 0, 0, 0]
    for station in ("mechanical_1", "mechanical_2", "ac", "dc"):
        name = f"power_{station}"
        errors = np.abs(table[name].values - truth[name].values)
        assert errors[0] < 0.01  # the transient that is left after settling
        assert (errors[1:] < 4.0 * table[f"{name}_se"].values[1:] + 0.01).all(), (name, errors)
    # Equal gains have equal powers at all times, so a part of the period is sufficient.
    assert table["power_dc_se"].values[4] < 0.02
    assert table["power_dc"].values[4] == pytest.approx(truth["power_dc"].values[4], abs=0.02)
    # The means of the windows themselves are those of the waves in them.
    data = open_run(measured, fields=["plan", "power"])
    is_row = (data["plan.row"].values == 1) & (data["plan.phase"].values == MEASURE)
    window_mean = float(data["power.dc"].values[is_row].mean())
    assert abs(window_mean - truth["power_dc"].values[1]) > 10.0 * abs(
        table["power_dc"].values[1] - truth["power_dc"].values[1]
    )


def test_the_table_gives_the_reason_for_the_end_of_each_row(measured: Path) -> None:
    """The rule of each reason by Student's distribution of scipy."""
    table = row_table(measured)
    reasons, batches = table["end_reason"].values.tolist(), table["batches"].values
    power, error = table["power_dc"].values, table["power_dc_se"].values
    assert reasons[0] == FULL
    assert table.attrs["end_station"] == "dc"
    assert {PRECISE, WORSE} <= set(reasons)
    for row in range(1, len(KP_KI)):
        is_precise = batches[row] >= 8 and error[row] <= END["precision_w"]
        above = power[row] - power[:row].min()
        allowed = student_t.ppf(0.995, batches[row] - 2) * error[row]
        assert reasons[row] == (PRECISE if is_precise else WORSE)
        assert is_precise or above > 0.99 * allowed, row
    assert cut_message(table).startswith(f"Row{'s' * (reasons.count(WORSE) > 1)} ")


def test_interpreted_and_compiled_the_rows_end_on_the_same_ticks(measured: Path) -> None:
    assert replay(measured, interpreted=True).identical
    assert replay(measured).identical


def test_after_the_settling_time_what_a_row_inherits_is_small(tmp_path: Path) -> None:
    """Row 1 after other gains, and with its gains from the start, at equal times of the wave clock.

    Sensor noise is as small as the transient that is left.
    """
    gains = {"spring_n_per_m": -5715, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}
    others = {**gains, "kp_n_s_per_m": -1000, "ki_n_per_m": -4000}
    motions = []
    for name, first in (("same", gains), ("other", others)):
        run = make_run(
            tmp_path / name,
            timing={"settle": "measured"},
            sea={"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.5, "repeat_s": 20, "seed": 5},
            matrix={"list": [first, gains]},
            start={"lead_in_s": 10, "set_point_s": 0},
        )
        data = open_run(run, fields=["plan", "heave.estimate.position"])
        clock, phase = data["plan.wave_clock"].values, data["plan.phase"].values
        is_row = (data["plan.row"].values == 1) & (clock > 0.0)
        position = data["heave.estimate.position"].values[is_row]
        motions.append((clock[is_row], position, clock[is_row & (phase == MEASURE)][0]))
    (time, same, _), (other_time, position, begin) = motions
    assert 3.0 < begin - other_time[0] < 5.0  # the settling time
    apart = np.abs(np.interp(other_time, time, same) - position)
    is_known = other_time > time[0]
    assert apart[is_known & (other_time < begin - 2.0)].max() > 0.04 * np.abs(same).max()
    assert apart[is_known & (other_time > begin)][:3000].max() < 0.02 * np.abs(same).max()


def test_the_check_states_least_and_longest_times(tmp_path: Path) -> None:
    path = write_campaign(tmp_path, start={"lead_in": "measured", "lead_in_s": 90}, tank=TANK)
    text = rig("check", path).stdout
    assert "16.6667 s to 100 s = 1 period per row" in text
    report = json.loads(rig("check", path, "--json").stdout)
    assert report["duration_s"] - report["least_duration_s"] == pytest.approx(
        len(KP_KI) * (REPEAT_S * (1.0 - 1.0 / 6.0 + 1.0 / 60.0) + 0.004), abs=0.05
    )
    # The waves of the highest frequency have their full height, and then the transients decay.
    full = report["tank"]["full_s"]
    assert full + 3.0 < report["phases_s"]["lead_in"] < full + 7.0


JONSWAP = {"kind": "jonswap", "hs_m": 0.1, "tp_s": 2}


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        (
            {"timing": {"end": {**END, "least_periods": 3}}},
            "timing.end.least_periods: an irregular sea has end.least_s; leave the key out",
        ),
        (
            {"timing": {"end": {**END, "least_s": 10}}},
            "timing.end.least_s: 10 s are not within the repeat period; allowed 16.66",
        ),
        (
            {"timing": {"periods": 2, "end": END}},
            "timing.periods: rows that end by their power have one repeat period at most",
        ),
        (
            {"sea": {**JONSWAP, "repeat_s": 60}},
            "timing.end: a repeat period of 60 s is too short for rows that end before it; "
            "allowed from 100 s on",
        ),
        (
            {"sea": {"kind": "calm"}},
            "timing.settle: rows with a calm sea have fixed times; leave the key out",
        ),
        (
            {"start": {"lead_in": "measured"}},
            "start.lead_in: the travel of the waves gives its length: add the key tank",
        ),
        (
            {"tank": {**TANK, "windows": "end before the reflection"}},
            "timing.settle: the tank ends the rows before reflected waves arrive",
        ),
        (
            {"sea": {"kind": "regular", "amplitude_m": 0.1, "period_s": 2},
             "timing": {"end": {**END, "least_s": 20}}},
            "timing.end.least_s: a regular sea has end.least_periods; leave the key out",
        ),
    ],
)  # fmt: skip
def test_refused(keys: dict[str, Any], text: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as error:
        open_campaign(write_campaign(tmp_path, **keys))
    assert text in "\n".join(each.text() for each in error.value.problems)


def test_points_have_the_estimates_and_their_errors(measured: Path) -> None:
    table = row_table(measured)
    points = {point.rows: point for point in gain_matrix(table).points}
    point = points[(2,)]
    assert point.power["dc"] == table["power_dc"].values[2]
    assert point.error["dc"] == table["power_dc_se"].values[2]
    assert point.dof["dc"] == table["batches"].values[2] - 2
    assert error_source([point]) == "scatter of differences from a reference row"
