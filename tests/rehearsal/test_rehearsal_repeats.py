"""Rehearsals repeat to the bit, however the plant is executed; the real clock is certified."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import CONFIGS, campaign_file, run, sequentially_swept, table_of, yaml_file

from rig.execution.rehearsal import job
from rig.execution.rehearsal.devices import connect
from rig.kinds.wavebot import KIND, WaveBotRow
from rig.kinds.wavebot.build import wavebot_params
from rig.planning.campaign import Campaign, Plan, check_campaign
from rig.processes.mailbox import Mailbox, Request, create
from rig.realtime import loop
from rig.realtime.clock import VirtualClock
from rig.recording.row_layout import layout, packer
from rig.recording.runs import attachments, open_run


def short(folder: Path, **keys: Any) -> Path:
    """A campaign of two rows and a spring move, 28 s of rig time."""
    return campaign_file(
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


def opened(path: Path) -> tuple[Campaign, Plan]:
    report = check_campaign(path)
    assert report.campaign is not None
    assert report.plan is not None
    return report.campaign, report.plan


class Rows:
    """In place of the ring: keeps the packed rows."""

    def __init__(self) -> None:
        self.packed = bytearray()
        self._pack = packer(WaveBotRow)
        self._blank = bytes(layout(WaveBotRow).size)

    def put(self, row: WaveBotRow) -> None:
        self.packed += self._blank
        self._pack(self.packed, len(self.packed) - len(self._blank), row)

    def finish(self) -> None:
        pass


def rows_of(campaign: Campaign, plan: Plan, *, compiled: bool) -> bytes:
    """All rows of a rehearsal in this process, packed."""
    devices = connect(job.devices_of(campaign) | {"compiled": compiled}, plan.dt)
    params = wavebot_params(
        campaign.file, campaign.rig, campaign.limits, plan.segments, plan.setpoints
    )
    rows: Any = Rows()
    loop.run(
        KIND,
        params,
        devices,
        VirtualClock(plan.dt),
        rows,
        Mailbox(create(), Request),
        lambda: 0,
        measure_work=False,
    )
    return bytes(rows.packed)


def test_interpreted_and_compiled_plant_give_the_same_bytes(tmp_path: Path) -> None:
    campaign, plan = opened(short(tmp_path))
    assert rows_of(campaign, plan, compiled=True) == rows_of(campaign, plan, compiled=False)


def test_two_rehearsals_log_identical_rows(tmp_path: Path) -> None:
    path = short(tmp_path)
    first, second = (open_run(run(path, tmp_path / "runs").folder) for _ in range(2))
    assert set(first.variables) == set(second.variables)
    for name in first.variables:
        assert first[name].values.tobytes() == second[name].values.tobytes(), name
    assert (first["timing.lateness"] == 0).all()


def test_another_seed_is_another_record(tmp_path: Path) -> None:
    one, other = (rows_of(*opened(short(tmp_path, seed=s)), compiled=True) for s in (1, 2))
    assert one != other


def test_every_tick_carries_row_and_phase(tmp_path: Path) -> None:
    """The measured windows hold exactly the planned ticks, whatever the stator's travel took."""
    ended = run(short(tmp_path), tmp_path / "runs")
    data = open_run(ended.folder, fields=["plan.row", "plan.phase", "spring_sense.position"])
    _, plan = opened(short(tmp_path))
    for row in plan.rows:
        inside = (data["plan.row"] == row.row) & (data["plan.phase"] == 4)
        assert int(inside.sum()) == 10_000
        # the stator stood still at the position that gives the row's spring rate
        np.testing.assert_allclose(
            data["spring_sense.position"].values[inside.values], row.stator_position, atol=0.5
        )


def test_a_recorded_elevation_is_played(tmp_path: Path) -> None:
    """The elevation logged in the measured window has the record's Hm0.

    20 s of the record are rehearsed; the compiled loop walks the shipped campaign whole.
    """
    shipped = {"extends": str(CONFIGS / "campaigns" / "recorded.yaml")}
    whole = sequentially_swept(yaml_file(tmp_path / "whole" / "campaign.yaml", shipped))
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
    path = yaml_file(tmp_path / "campaign.yaml", shipped | keys)
    ended = run(path, tmp_path / "runs")
    assert ended.outcome.status == "complete"
    campaign, plan = opened(path)
    assert campaign.elevation is not None
    data = open_run(ended.folder, fields=["plan.phase", "wave.elevation"], rows=[0])
    measured = data["wave.elevation"].values[data["plan.phase"].values == 4]
    assert measured.size == 20_000
    assert 4 * measured.std() == pytest.approx(4 * campaign.elevation.elevation.std(), rel=0.01)
    assert len(plan.rows) == table_of(ended).sizes["row"] == 1


@pytest.mark.realtime
def test_real_clock_run_is_certified(tmp_path: Path) -> None:
    path = short(
        tmp_path,
        sea={"kind": "calm"},
        start={"set_point_s": 0.5, "lead_in_s": 1},
        timing={"settle_s": 0.5, "interval_s": 2},
        matrix={"list": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}]},
    )
    ended = run(path, tmp_path / "runs", real_clock=True)
    assert ended.outcome.status == "complete"
    certificate = json.loads(attachments(ended.folder)["timing.json"])
    assert certificate["clock"] == "real"
    assert certificate["ticks"] == ended.outcome.ticks
    assert certificate["skipped"] == ended.outcome.skipped
    tick = open_run(ended.folder, fields=["tick", "timing.skipped", "timing.lateness"])
    # executed and skipped periods are all the periods there were
    last = int(tick["tick"].values[-1])
    assert ended.outcome.ticks + ended.outcome.skipped == last + 1
    assert (tick["timing.lateness"].values >= 0).all()
    assert set(certificate["privileges"]) == {"fifo", "core", "memory_lock", "latency"}
