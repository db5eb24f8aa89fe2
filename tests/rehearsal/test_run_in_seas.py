"""A campaign with several seeds: its rows in the sea of each seed, one sea after the other."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import CompletedCommand, rig
from made_once import made_once
from rehearsing import CONFIGS, write_yaml

from rig.analysis.points import gain_matrix
from rig.analysis.rows import COMPLETE, row_table, stations_of
from rig.api import campaign_run
from rig.campaign import build_plan, open_campaign
from rig.cli import run as run_command
from rig.execution.replay import replay
from rig.kinds.wavebot.campaign import CAMPAIGNS
from rig.kinds.wavebot.twin.records import read_records
from rig.recording.runs import create, run_info
from rig.recording.runs.folder import MCAP, STATUS
from rig.recording.runs.reader import check_record

SEEDS = [7, 3]
KP = (-2000, -3000, -2500)


def write_campaign(folder: Path, seed: Any, **keys: Any) -> Path:
    gains = {"spring_n_per_m": 490.9, "ki_n_per_m": 0}
    return write_yaml(
        folder / "seas.yaml",
        {
            "name": "seas",
            "rig": str(CONFIGS / "rigs" / "wavebot.yaml"),
            "seed": seed,
            "sea": {"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.0, "repeat_s": 10, "seed": 5},
            "tare": {"duration_s": 1},
            "start": {"lead_in_s": 6},
            "timing": {"settle_s": 2, "interval_s": 12},
            "matrix": {"list": [{**gains, "kp_n_s_per_m": kp} for kp in KP]},
            "order": "random",
            **keys,
        },
    )


def run(folder: Path, *options: object) -> CompletedCommand:
    done = rig("run", *options, "--runs", folder / "runs", "--interpreted", "--json")
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="module")
def seas(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run in two seas."""
    place = made_once(
        tmp_path_factory, "seas", lambda folder: run(folder, write_campaign(folder, SEEDS))
    )
    (folder,) = (place / "runs").iterdir()
    return Path(folder)


def test_each_sea_is_that_of_its_seed_alone(seas: Path, tmp_path: Path) -> None:
    """The rows of a seed have the powers of a campaign with that seed, to the bit."""
    table = row_table(seas)
    assert table["row"].values.tolist() == [*range(2 * len(KP))]
    assert table["state"].values.tolist() == [COMPLETE] * 2 * len(KP)
    assert table["seed"].values.tolist() == [7] * len(KP) + [3] * len(KP)
    for place, seed in enumerate(SEEDS):
        alone = tmp_path / str(seed)
        own = {"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.0, "repeat_s": 10}
        run(alone, write_campaign(alone, seed, sea=own))
        (single,) = (alone / "runs").iterdir()
        expected, rows = row_table(single), slice(place * len(KP), (place + 1) * len(KP))
        for name in ("point", "kp", *(f"power_{each.name}" for each in stations_of(table))):
            np.testing.assert_array_equal(table[name].values[rows], expected[name].values)
    record = check_record(seas)
    assert (record.lost, record.damage) == (0, ())
    assert replay(seas).identical
    sea = "JONSWAP, Hs 0.127 m, Tp 2 s, gamma 3.3, repeats after 10 s, seeds 7, 3"
    assert json.loads((seas / "summary.json").read_text())["sea"] == sea


def test_points_are_means_over_the_seas_with_the_scatter_between_them(seas: Path) -> None:
    table = row_table(seas)
    assert np.isnan(table["power_dc_se"].values).all()  # one period a row
    for point in gain_matrix(table).points:
        powers = [float(table["power_dc"].values[row]) for row in point.rows]
        assert len(powers) == len(SEEDS)
        assert point.power["dc"] == pytest.approx(np.mean(powers))
        assert point.error["dc"] == pytest.approx(abs(powers[0] - powers[1]) / 2.0)
        assert point.by_seed.keys() == {*SEEDS}


def test_the_twin_takes_each_row_in_its_own_sea(seas: Path) -> None:
    found = read_records(seas)
    assert not found.excluded
    phases = [tuple(record.sea["phase_rad"]) for record in found.records if record.sea]
    assert len(phases) == 2 * len(KP)
    assert len({*phases}) == len(SEEDS)


def test_a_run_killed_in_the_second_sea_goes_on_there(seas: Path, tmp_path: Path) -> None:
    killed = tmp_path / "runs" / seas.name
    shutil.copytree(seas, killed)
    data, status = (killed / MCAP).read_bytes(), json.loads((killed / STATUS).read_text())
    (killed / MCAP).unlink()
    (killed / f"{MCAP}.part0").write_bytes(data[: int(0.55 * len(data))])
    for key in ("reason", "reason_text", "ticks", "last_tick", "skipped", "record", "ended_utc"):
        del status[key]
    create.write_json(killed, STATUS, status | {"status": "running", "pid_started": 1})
    before = row_table(killed)["state"].values.tolist()
    assert before[: len(KP)] == [COMPLETE] * len(KP)
    assert COMPLETE in before[len(KP) :]
    assert before[-1] != COMPLETE
    done = run(tmp_path, write_campaign(tmp_path, SEEDS), "--resume", "last")
    table = row_table(killed)
    assert table["state"].values.tolist() == [COMPLETE] * 2 * len(KP)
    assert table["seed"].values.tolist() == [7] * len(KP) + [3] * len(KP)
    assert len(run_info(killed).status["resumed_utc"]) == 2
    assert json.loads(done.stdout)["status"] == "complete"
    assert "\nstages   " in rig("show", killed).stdout
    assert replay(killed).identical


def test_on_wires_the_next_sea_waits_for_people(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The wave maker needs another sea, and the water must calm."""
    wired = str(CONFIGS / "rigs" / "wavebot_hil.yaml")
    monkeypatch.setattr(
        campaign_run,
        "_execution_mode",
        lambda tasks, checked, options: tasks.rehearsal_mode(checked, real_clock=False),
    )
    path = write_campaign(tmp_path, SEEDS, rig=wired)
    options = campaign_run.RunOptions(interpreted=True)
    code = run_command.run_named("run", path, tmp_path / "runs", options, as_json=True)
    output = capsys.readouterr()
    (folder,) = (tmp_path / "runs").iterdir()
    assert code == 0
    assert f"wait for calm water, then: rig run --resume {folder}" in output.err
    assert row_table(folder)["state"].values.tolist()[len(KP) :] == ["not run"] * len(KP)
    assert json.loads((folder / STATUS).read_text())["rows_done"] == len(KP)


def test_each_sea_has_an_order_and_a_plan_of_its_own(tmp_path: Path) -> None:
    campaign = open_campaign(CAMPAIGNS, write_campaign(tmp_path, [1, 2, 3], repeat=2))
    plan = build_plan(campaign)
    assert [row.row for row in plan.rows] == [*range(3 * 2 * len(KP))]
    orders = [
        [(row.point, row.repetition) for row in plan.rows if row.seed == seed] for seed in (1, 2, 3)
    ]
    assert all(sorted(order) == sorted(orders[0]) for order in orders)
    assert orders[0] != orders[1]
    assert {*plan.segments.row} == {-1, *range(2 * len(KP))}
