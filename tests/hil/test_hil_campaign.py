"""One campaign in rehearsal and on real wires: the same powers, and every period accounted for."""

from __future__ import annotations

import itertools
import json
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hil_processes import run_emulated
from rehearsing import CONFIGS, SilentView, load_rows

from benchmarks.support.emulated_wavebot import (
    write_campaign_file,
    write_ethercat_rig_file,
    write_rig_file,
)
from benchmarks.support.host import ProcessorTime, other_load
from rig.emulation.cable import cable_problem
from rig.execution.task import RunResult, run_task
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.tasks import execution_task, rehearsal_mode
from rig.processes.io_processes import FACTS_FILE
from rig.processes.run_types import Snapshot
from rig.recording.runs import open_run

pytestmark = pytest.mark.realtime

SHARE, LEAST = 0.02, 0.3  # of the mechanical power; W
EXECUTED = 0.99
LOADED, EXECUTED_LOADED = 0.5, 0.9  # cores of other work; executed share that is then sufficient
LATE = 0.5  # s by which the supervisor's newest row may be behind the wall clock
TRIES = 8  # a shared host has bad minutes; each try takes 20 s
POWERS = ("power_mechanical_1", "power_mechanical_2", "power_ac", "power_dc")
AGES = (
    "heave.sense.encoder_age", "surge.sense.encoder_age", "spring_sense.age", "load.age",
    "power_sense.age", "probes.age",
)  # fmt: skip
GAINS = (
    {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0},
    {"spring_n_per_m": 490.9, "kp_n_s_per_m": -3000, "ki_n_per_m": 2000},
)


class TickTimes:
    """A view that stores wall-clock times with the newest ticks."""

    def __init__(self) -> None:
        self.notice = ""
        self.times: list[tuple[float, int]] = []

    def __call__(self, snapshot: Snapshot) -> None:
        if snapshot.row:
            self.times.append((time.monotonic(), int(snapshot.row["tick"])))


class Pair(NamedTuple):
    rehearsed: RunResult
    wired: RunResult
    clock: TickTimes
    others: float  # cores of other work during the run


def executed_share(result: RunResult) -> float:
    outcome = result.outcome
    return outcome.ticks / max(1, outcome.ticks + outcome.skipped)


ON_EACH_BUS = pytest.mark.parametrize(
    "pair",
    [
        pytest.param(write_rig_file, id="CAN"),
        pytest.param(
            write_ethercat_rig_file, id="EtherCAT", marks=pytest.mark.long(group="EtherCAT")
        ),
    ],
    indirect=True,
    scope="module",
)


@pytest.fixture(scope="module")
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Pair:
    if request.param is write_ethercat_rig_file:
        pytest.importorskip("pysoem")
        if problem := cable_problem("wectest"):
            pytest.skip(problem)
    folder = tmp_path_factory.mktemp("campaign")
    path = write_campaign_file(
        folder,
        request.param,
        sea={"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
        start={"set_point_s": 0, "lead_in_s": 6},
        timing={"settle_s": 2, "interval_s": 6},  # 2 periods of the sea are measured
        matrix={"list": list(GAINS)},
    )
    report = check_campaign(path, rig=CONFIGS / "rigs" / "wavebot.yaml")
    assert report.campaign is not None, report.text()
    assert report.plan is not None
    mode = rehearsal_mode(report.campaign, real_clock=False)
    rehearsed = run_task(execution_task(report.campaign, report.plan), folder, SilentView(), mode)
    on_wires = check_campaign(path)
    assert on_wires.campaign is not None, on_wires.text()
    assert on_wires.plan is not None
    for attempt in range(TRIES):
        clock, before = TickTimes(), ProcessorTime.now()
        result = run_emulated(on_wires.campaign, on_wires.plan, folder, clock)
        load = other_load(before, ProcessorTime.now())["other_work_cores"]
        if result.outcome.status == "complete" and executed_share(result) >= EXECUTED:
            break
        print(f"attempt {attempt}: {result.outcome.status}, {result.outcome.reason}, executed "
              f"{executed_share(result):.4f}: the host had other work; repeated")  # fmt: skip
    return Pair(rehearsed, result, clock, load)


@ON_EACH_BUS
def test_both_run_the_plan_to_its_end(pair: Pair) -> None:
    for result in (pair.rehearsed, pair.wired):
        outcome = result.outcome
        assert (outcome.status, outcome.reason) == ("complete", "PLAN_END")
        assert outcome.dropped == outcome.unsaved == outcome.logger_restarts == 0
    assert pair.wired.outcome.died == ""


@ON_EACH_BUS
def test_row_powers_agree(pair: Pair) -> None:
    rehearsed, wired = load_rows(pair.rehearsed), load_rows(pair.wired)
    assert wired.sizes["row"] == rehearsed.sizes["row"] == len(GAINS)
    for row in range(len(GAINS)):
        mechanical = abs(float(rehearsed["power_mechanical_1"].values[row]))
        allowed = max(SHARE * mechanical, LEAST)
        for name in POWERS:
            before, after = float(rehearsed[name].values[row]), float(wired[name].values[row])
            print(f"row {row} {name}: {before:.2f} W rehearsed, {after:.2f} W on wires")
            assert abs(after - before) <= allowed, (row, name, before, after, allowed)


@ON_EACH_BUS
def test_every_period_is_accounted_for(pair: Pair) -> None:
    outcome = pair.wired.outcome
    ticks = open_run(pair.wired.folder, fields=["tick", "timing.skipped"])
    numbers = ticks["tick"].values
    assert len(numbers) == outcome.ticks
    assert np.all(np.diff(numbers) > 0)
    gaps = int(np.sum(np.diff(numbers) - 1))
    assert gaps + int(numbers[0]) == outcome.skipped == int(ticks["timing.skipped"].values[-1])
    assert outcome.ticks + outcome.skipped == int(numbers[-1]) + 1
    print(f"executed {executed_share(pair.wired):.5f}, {outcome.skipped} periods skipped, "
          f"{pair.others:.2f} cores of other work")  # fmt: skip
    assert executed_share(pair.wired) >= (EXECUTED if pair.others < LOADED else EXECUTED_LOADED)


@ON_EACH_BUS
def test_the_ticks_follow_the_wall_clock(pair: Pair) -> None:
    times = pair.clock.times
    moving = [one for one, after in itertools.pairwise(times) if after[1] > one[1]]
    (began, first), (ended, last) = moving[0], moving[-1]
    assert abs((ended - began) - 1e-3 * (last - first)) <= LATE


@ON_EACH_BUS
def test_ages_of_values_are_small(pair: Pair) -> None:
    data: Any = open_run(pair.wired.folder, fields=list(AGES))
    for name in AGES:
        ages = np.sort(data[name].values)
        p99 = float(ages[int(0.99 * (len(ages) - 1))])
        print(f"{name}: p50 {1e3 * ages[len(ages) // 2]:.1f} ms, p99 {1e3 * p99:.1f} ms")
        assert p99 <= 0.2, name


@ON_EACH_BUS
def test_the_folder_has_the_facts_of_the_io_processes(pair: Pair) -> None:
    assert (Path(pair.wired.folder) / FACTS_FILE).exists()


@ON_EACH_BUS
def test_the_record_has_a_report_of_the_segment(pair: Pair) -> None:
    file = Path(pair.wired.folder) / "wires.json"
    if not file.exists():  # on CAN
        assert "ethercat" not in json.loads((Path(pair.wired.folder) / FACTS_FILE).read_text())
        return
    report = json.loads(file.read_text())["ethercat"]
    print(report)
    assert report["wrong_working_counter"] == report["foreign"] == 0
    assert report["lost"] <= 0.01 * report["sent"]  # frames that the host left lying for 3 ms
    assert report["sent"] >= pair.wired.outcome.ticks
    assert report["age_p50_s"] <= 0.0012  # sent in the last tick
