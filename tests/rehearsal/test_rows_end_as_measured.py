"""Rows that settle, and end, as measured: in the rehearsed loop, its log, and its row table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import rig
from made_once import made_once
from rehearsing import CONFIGS, write_yaml

from rig.analysis.row_ends import PRECISE
from rig.analysis.rows import COMPLETE, row_table
from rig.config.problems import ConfigError
from rig.execution.replay import replay
from rig.kinds.wavebot.campaign import open_campaign
from rig.realtime.sequence import LEAD_IN, MEASURE, SETTLE
from rig.recording.runs import open_run

PERIOD_S = 2.0
KI = (0, 4000, 8000, 2000)
FIXED: dict[str, Any] = {"timing": {"settle_s": 20, "interval_s": 60}, "start": {"lead_in_s": 60}}
MEASURED: dict[str, Any] = {
    "timing": {
        "settle": "measured",
        "periods": 8,
        "end": {"precision_w": 0.05, "worse_rows": True, "least_periods": 2},
    },
    "start": {"lead_in": "measured", "lead_in_s": 60},
}


def write_campaign(folder: Path, **keys: Any) -> Path:
    gains = {"spring_n_per_m": -5715, "kp_n_s_per_m": -2000}
    return write_yaml(
        folder / "assessed.yaml",
        {
            "name": "assessed",
            "rig": str(CONFIGS / "rigs" / "wavebot.yaml"),
            "sea": {"kind": "regular", "amplitude_m": 0.127, "period_s": PERIOD_S},
            "tare": {"duration_s": 1},
            "matrix": {"list": [{**gains, "ki_n_per_m": ki} for ki in KI]},
            **MEASURED,
            **keys,
        },
    )


def make_run(folder: Path, *options: str, **keys: Any) -> Path:
    runs = folder / "runs"
    done = rig("run", write_campaign(folder, **keys), "--runs", runs, "--json", *options)
    assert done.returncode == 0, done.stderr
    (run,) = runs.iterdir()
    return Path(run)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = made_once(
        tmp_path_factory, "assessed", lambda folder: make_run(folder, "--interpreted")
    )
    (run,) = (place / "runs").iterdir()
    return Path(run)


def test_rows_end_early_with_the_powers_of_long_ones(measured: Path, tmp_path: Path) -> None:
    """The long rows have 20 s to settle and 20 periods: the truth of this plant."""
    table, long = row_table(measured), row_table(make_run(tmp_path, "--interpreted", **FIXED))
    assert table["state"].values.tolist() == [COMPLETE] * len(KI)
    assert table["samples"].values.tolist() == (2000 * table["periods"].values).tolist()
    assert table["periods"].values.tolist()[1:] == [2] * (len(KI) - 1)  # worse, or precise
    ended = float(table["start"].values[-1]) + 2.0 * PERIOD_S
    assert ended < 0.35 * (float(long["start"].values[-1]) + 40.0)
    for name in ("mechanical_1", "mechanical_2", "ac", "dc"):
        difference = np.abs(table[f"power_{name}"].values - long[f"power_{name}"].values)
        bound = 0.02 * np.abs(long[f"power_{name}"].values) + 0.1
        assert (difference <= bound).all(), (name, difference)


def test_the_table_gives_the_reason_for_the_end_of_each_row(measured: Path) -> None:
    """The simulated powers hardly scatter, so each row is precise as soon as that can be known."""
    assert row_table(measured)["end_reason"].values.tolist() == [PRECISE] * len(KI)


def test_each_segment_is_of_whole_periods(measured: Path) -> None:
    data = open_run(measured, fields=["plan"])
    row, phase = data["plan.row"].values, data["plan.phase"].values
    periods = 1000 * PERIOD_S
    for number in range(len(KI)):
        for kind in (SETTLE, MEASURE):
            ticks = int(((row == number) & (phase == kind)).sum())
            assert ticks % periods == 0
            assert ticks >= 2 * periods
    lead_in = int((phase == LEAD_IN).sum())
    assert 10_000 <= lead_in < 40_000  # of 60 s at most


def test_compiled_and_replayed_the_rows_end_on_the_same_ticks(
    measured: Path, tmp_path: Path
) -> None:
    assert replay(measured).identical
    compiled = make_run(tmp_path)
    one, other = open_run(measured), open_run(compiled)
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, other[name].values, err_msg=str(name))


def test_the_plan_and_the_check_have_least_and_longest_times(
    measured: Path, tmp_path: Path
) -> None:
    plan = json.loads((measured / "plan.json").read_text())
    assert {row["measure_s"] for row in plan["rows"]} == {8 * PERIOD_S}
    assert {row["least_measure_s"] for row in plan["rows"]} == {2 * PERIOD_S}
    path = write_campaign(tmp_path)
    report = json.loads(rig("check", path, "--json").stdout)
    assert report["duration_s"] - report["least_duration_s"] == pytest.approx(
        50.0 + len(KI) * (6 * PERIOD_S + 20.0 - 2 * PERIOD_S)
    )
    shown = rig("check", path).stdout
    assert "4 s = 2 periods to 16 s = 8 periods per row" in shown


def test_the_expected_duration_is_that_of_the_rehearsal(measured: Path, tmp_path: Path) -> None:
    """An assumed scatter of zero gives the same; a large one the longest measurement of each row.

    The first row needs five periods for its four degrees of freedom, the others the least two.
    """
    path = write_campaign(tmp_path)
    ticks = int(open_run(measured, fields=["tick"])["tick"].values[-1]) + 1
    measured_s = PERIOD_S * float(row_table(measured)["periods"].values.sum())

    def expected(*options: str) -> dict[str, Any]:
        found = rig("check", path, "--simulate", "--json", *options)
        assert found.returncode == 0, found.stderr
        return dict(json.loads(found.stdout))

    simulated = expected()
    assert simulated["expected_duration_s"] == pytest.approx(1e-3 * ticks, abs=0.05)
    assert simulated["least_duration_s"] < simulated["expected_duration_s"]
    assert simulated["expected_duration_s"] < simulated["duration_s"]
    even = expected("--scatter", "0")
    assert even["expected_duration_s"] == pytest.approx(simulated["expected_duration_s"])
    wide = expected("--scatter", "1e5")
    longest = simulated["expected_duration_s"] - measured_s + len(KI) * 8 * PERIOD_S
    assert wide["expected_duration_s"] == pytest.approx(longest, abs=2.0)
    assert wide["assumed_scatter_w"] == 1e5
    low, high = wide["expected_interval_s"]
    assert low <= wide["expected_duration_s"] <= high + 1e-3


def test_an_assumed_scatter_needs_rows_that_it_can_end(tmp_path: Path) -> None:
    for options, keys, text in (
        ((), MEASURED, "--scatter needs the simulated rows: add --simulate"),
        (("--simulate",), FIXED, "--scatter is for rows in a regular sea that end by their power"),
    ):
        path = write_campaign(tmp_path, **keys)
        done = rig("check", path, "--scatter", "0.5", *options)
        assert done.returncode == 2
        assert text in done.stderr


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"timing": {"end": {}}}, "timing.end: nothing ends a row; give precision_w"),
        (
            {"timing": {"end": {"precision_w": 1, "station": "foo"}}},
            "timing.end.station: unknown station 'foo'; allowed mechanical (column load cell) "
            "[mechanical_1]",
        ),
        (
            {"timing": {"settle": "measured", "interval_s": 20}},
            "timing.interval_s: rows that end by themselves have no interval",
        ),
        (
            {"timing": {"settle": "measured", "scheme": "mask4"}},
            "timing.scheme: its rows have a fixed length; allowed default",
        ),
        (
            {"timing": {"settle": "measured", "settle_s": 3}},
            "timing.settle_s: 3 s are less than 2 wave periods of 2 s; allowed from 4 s on",
        ),
        (
            {"timing": {"periods": 2, "end": {"precision_w": 1}}},
            "timing.periods: 2 is less than end.least_periods = 3",
        ),
        (
            {"reference": {"kind": "sine", "frequency_hz": 0.5, "amplitude_n": 100}},
            "timing.settle: rows with an open-loop reference have fixed times",
        ),
    ],
)
def test_refused(keys: dict[str, Any], text: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as error:
        open_campaign(write_campaign(tmp_path, **keys))
    assert text in "\n".join(each.text() for each in error.value.problems)
