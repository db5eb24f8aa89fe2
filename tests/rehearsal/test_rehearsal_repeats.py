"""Rehearsals repeat to the bit, compiled or interpreted; real-clock runs have a certificate."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import CONFIGS, load_rows, rehearse, sweep_sequentially, write_campaign, write_yaml

from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import Campaign, Plan, check_campaign
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.rehearsal.devices import connect
from rig.kinds.wavebot.tick import KIND, WaveBotRow
from rig.processes.mailbox import LoopMailbox, create
from rig.realtime import loop
from rig.realtime.clock import VirtualClock
from rig.recording.row_layout import layout, packer
from rig.recording.runs import attachments, open_run


def short(folder: Path, **keys: Any) -> Path:
    """Write a campaign of two rows and a spring move, 28 s of rig time."""
    return write_campaign(
        folder,
        **{
            "sea": {"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.5, "repeat_s": 10, "seed": 3},
            "tare": {"duration_s": 1},
            "start": {"set_point_s": 1, "lead_in_s": 3},
            "timing": {"settle_s": 1, "interval_s": 11},
            "matrix": {
                "list": [
                    {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 4000},
                    {"spring_n_per_m": -2763, "kp_n_s_per_m": -2000, "ki_n_per_m": 0},
                ]
            },
        }
        | keys,
    )


def load_plan(path: Path) -> tuple[Campaign, Plan]:
    report = check_campaign(path)
    assert report.campaign is not None
    assert report.plan is not None
    return report.campaign, report.plan


class RowCollector:
    """A substitute for the ring that keeps the packed rows."""

    def __init__(self) -> None:
        self.packed = bytearray()
        self._pack = packer(WaveBotRow)
        self._blank = bytes(layout(WaveBotRow).size)

    def put(self, row: WaveBotRow) -> None:
        self.packed += self._blank
        self._pack(self.packed, len(self.packed) - len(self._blank), row)

    def finish(self) -> None:
        pass


def rehearse_in_process(campaign: Campaign, plan: Plan, *, compiled: bool) -> bytes:
    """Rehearse in this process and return all packed rows."""
    devices = connect(job.plant_settings(campaign) | {"compiled": compiled}, plan.dt)
    params = wavebot_params(campaign, plan.segments, plan.setpoints)
    rows: Any = RowCollector()
    loop.run(
        KIND,
        params,
        devices,
        VirtualClock(plan.dt),
        rows,
        LoopMailbox(create(), -1, ()),
        lambda: 0,
        measure_work=False,
    )
    return bytes(rows.packed)


def test_interpreted_and_compiled_plant_give_the_same_bytes(tmp_path: Path) -> None:
    campaign, plan = load_plan(short(tmp_path))
    assert rehearse_in_process(campaign, plan, compiled=True) == rehearse_in_process(
        campaign, plan, compiled=False
    )


def test_two_rehearsals_log_identical_rows(tmp_path: Path) -> None:
    path = short(tmp_path)
    first, second = (open_run(rehearse(path, tmp_path / "runs").folder) for _ in range(2))
    assert set(first.variables) == set(second.variables)
    for name in first.variables:
        assert first[name].values.tobytes() == second[name].values.tobytes(), name
    assert (first["timing.lateness"] == 0).all()


def test_another_seed_gives_another_record(tmp_path: Path) -> None:
    one, other = (
        rehearse_in_process(*load_plan(short(tmp_path, seed=s)), compiled=True) for s in (1, 2)
    )
    assert one != other


def test_every_tick_has_row_and_phase(tmp_path: Path) -> None:
    """The measured windows have exactly the planned ticks, however long the stator moved."""
    result = rehearse(short(tmp_path), tmp_path / "runs")
    data = open_run(result.folder, fields=["plan.row", "plan.phase", "spring_sense.position"])
    _, plan = load_plan(short(tmp_path))
    for row in plan.rows:
        inside = (data["plan.row"] == row.row) & (data["plan.phase"] == 4)
        assert int(inside.sum()) == 10_000
        # the stator was at the position that gives the row's spring rate
        np.testing.assert_allclose(
            data["spring_sense.position"].values[inside.values], row.place, atol=0.5
        )


def test_a_recorded_elevation_is_played(tmp_path: Path) -> None:
    """The elevation logged in the measured window has the record's Hm0.

    20 s of the record are rehearsed; the compiled loop runs the whole shipped campaign.
    """
    shipped = {"extends": str(CONFIGS / "campaigns" / "recorded.yaml")}
    whole = sweep_sequentially(write_yaml(tmp_path / "whole" / "campaign.yaml", shipped))
    assert whole.state.values.tolist() == ["complete"] * 3
    assert (whole["samples"] == 60_000).all()
    point = {"spring_n_per_m": -2763, "kp_n_s_per_m": -2500, "ki_n_per_m": 0}
    keys = {
        "sea": {"end_s": 20},
        "tare": {"duration_s": 1},
        "start": {"set_point_s": 1, "lead_in_s": 10},
        "timing": {"settle_s": 1},
        "matrix": {"grid": [point]},
    }
    path = write_yaml(tmp_path / "campaign.yaml", shipped | keys)
    result = rehearse(path, tmp_path / "runs")
    assert result.outcome.status == "complete"
    campaign, plan = load_plan(path)
    assert campaign.elevation is not None
    data = open_run(result.folder, fields=["plan.phase", "wave.elevation"], rows=[0])
    measured = data["wave.elevation"].values[data["plan.phase"].values == 4]
    assert measured.size == 20_000
    assert 4 * measured.std() == pytest.approx(4 * campaign.elevation.elevation.std(), rel=0.01)
    assert len(plan.rows) == load_rows(result).sizes["row"] == 1


@pytest.mark.realtime
@pytest.mark.paired
def test_real_clock_run_is_certified(tmp_path: Path) -> None:
    path = short(
        tmp_path,
        sea={"kind": "calm"},
        start={"set_point_s": 0.5, "lead_in_s": 1},
        timing={"settle_s": 0.5, "interval_s": 2},
        matrix={"list": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}]},
    )
    result = rehearse(path, tmp_path / "runs", real_clock=True)
    assert result.outcome.status == "complete"
    certificate = json.loads(attachments(result.folder)["timing.json"])
    assert certificate["clock"] == "real"
    assert certificate["ticks"] == result.outcome.ticks
    assert certificate["skipped"] == result.outcome.skipped
    tick = open_run(result.folder, fields=["tick", "timing.skipped", "timing.lateness"])
    # executed and skipped periods add up to all periods
    last = int(tick["tick"].values[-1])
    assert result.outcome.ticks + result.outcome.skipped == last + 1
    assert (tick["timing.lateness"].values >= 0).all()
    assert set(certificate["privileges"]) == {"fifo", "core", "memory_lock", "latency"}
