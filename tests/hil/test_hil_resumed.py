"""A campaign on emulated devices that is stopped or killed, and goes on with `rig run --resume`."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import CONFIGS, write_yaml

from benchmarks.support.emulated_wavebot import write_campaign_file
from benchmarks.support.live_run import LiveRun, TimeOutError, wait_realtime_free, wait_until
from benchmarks.support.recorded import ROOT
from benchmarks.support.wired_rigs import ENVIRONMENT_MARK, processes, wait_for_end
from rig.analysis.rows import COMPLETE, row_table
from rig.kinds.wavebot.tick import WaveBotRow
from rig.processes.io_processes import FACTS_FILE
from rig.recording.row_layout import layout, leaves
from rig.recording.runs import open_run, run_info
from rig.recording.runs.folder import STATUS
from rig.recording.runs.state import read_json

pytestmark = [pytest.mark.realtime, pytest.mark.long]

GAINS = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000}
ROWS, PERIODS, MEASURE = 2, 2, 4
SECOND_ROW = 1
TRIES = 6  # a shared host has bad minutes


def write_campaign(folder: Path) -> Path:
    """Write a campaign of two rows of 5 s on wires with free ports.

    Values may be 1 s late, for a host with other work: this is no test of those limits.
    """
    patient = {
        "encoder_age_stop_s": 1.0,
        "encoder_jump_stop_m": 0.2,
        "drive_age_stop_s": 1.0,
        "current_difference_time_s": 2.0,
    }
    limits = {
        "extends": str(CONFIGS / "limits" / "wavebot.yaml"),
        "heave": patient,
        "surge": patient,
        "loop": {"load_cell_age_stop_s": 1.0, "lost_ticks_stop": 1000},
    }
    write_yaml(folder / "limits.yaml", limits)
    path = write_campaign_file(
        folder,
        timing={"settle_s": 1, "interval_s": 5},
        matrix={"list": [{**GAINS, "ki_n_per_m": ki} for ki in (0, 1000)]},
    )
    with (folder / "rig.yaml").open("a") as rig:
        rig.write("\nlimits: limits.yaml\n")
    return path


def begin_and_end_early(campaign: Path, runs: Path, number: signal.Signals) -> Path:
    """Run a campaign with --sim, send its supervisor a signal in the second row; return the run."""
    wait_realtime_free()
    command = [sys.executable, "-m", "rig", "run", str(campaign), "--sim", "--runs", str(runs)]
    with LiveRun(command, runs, {ENVIRONMENT_MARK: str(runs)}) as live:

        def in_second_row() -> bool:
            if live.process.poll() is not None:
                raise TimeOutError(f"the run has ended: {live.last_output_line()}")
            return measured_row(live) == SECOND_ROW

        live.wait_started()
        wait_until(in_second_row, "the second row", interval=0.05)
        os.kill(live.process.pid, number)
        wait_until(lambda: live.process.poll() is not None, "the end of the command")
        wait_for_end(runs)
        assert not processes(runs), "emulated devices or other processes go on"
        return live.folder


def measured_row(live: LiveRun) -> int:
    """Return the row that a run measures now; -1 in other phases."""
    newest = live.ring.latest()
    if newest is None:
        return -1
    names = [leaf.name for leaf in leaves(WaveBotRow)]
    row = dict(zip(names, layout(WaveBotRow).unpack(newest), strict=True))
    return int(row["plan.row"]) if row["plan.phase"] == MEASURE else -1


def resume(runs: Path) -> subprocess.CompletedProcess[str]:
    """Let the newest run go on, without --sim."""
    wait_realtime_free()
    command = [sys.executable, "-m", "rig", "run", "--resume", "last", "--runs", str(runs)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_it_goes_on_with_emulated_devices(tmp_path: Path, number: signal.Signals) -> None:
    """All rows are complete, and the second stage has neither row 0 nor the rig's devices."""
    campaign = write_campaign(tmp_path)
    for attempt in range(TRIES):
        runs = tmp_path / f"runs_{attempt}"
        try:
            run = begin_and_end_early(campaign, runs, number)
            break
        except TimeOutError as error:
            print(f"attempt {attempt}: {error}: the host had other work; repeated")
    else:
        pytest.fail(f"no run of {TRIES} came to its second row")
    first = read_json(run / STATUS)
    assert first["mode"] == "hil"
    assert (first["status"] == "running") == (number == signal.SIGKILL)
    for stages in range(1, TRIES + 1):  # a stage that a busy host stops is resumed likewise
        done = resume(runs)
        assert f"{run.name}: devices are emulated, as in its stages before" in done.stderr
        if stages == 1:
            assert f"1 of {ROWS} rows are still to be measured" in done.stderr
        assert read_json(run / STATUS)["mode"] == "hil"
        if done.returncode == 0:
            break
    assert done.returncode == 0, done.stdout + done.stderr
    status: dict[str, Any] = read_json(run / STATUS)
    assert (status["mode"], status["status"]) == ("hil", "complete")
    assert status["started_utc"] == first["started_utc"]
    assert len(status["resumed_utc"]) == stages
    assert (run / FACTS_FILE).is_file()  # which only processes of wires write
    table = row_table(run)
    assert table["row"].values.tolist() == [*range(ROWS)]
    assert table["state"].values.tolist() == [COMPLETE] * ROWS
    expected = PERIODS * np.ones(ROWS)  # less those with ticks that a busy host lost
    assert (table["periods"].values >= 1).all()
    assert ((table["periods"].values == expected) | (table["lost_ticks"].values > 0)).all()
    assert (table["power_mechanical_1"].values < 0.0).all()
    record = open_run(run, ["plan", "tick"])
    plan = run_info(run).plan["resumed"]
    assert 0 in plan["rows"]
    assert plan["stage"] == stages + 1
    later = record["plan.row"].values[record["tick"].values > plan["last_tick"]]
    assert later.size
    assert not np.any(later == 0)
