"""Campaigns in the compiled loop: times real time, a long campaign, ten thousand rows, memory."""

import json
import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.start import rig_command
from benchmarks.support.campaigns import open_checked
from benchmarks.support.recorded import ROOT, build_loop_parts
from benchmarks.support.result import Figure, Result, figure, ratios
from rig.kinds.wavebot.simulation.simulation import CampaignSimulator
from rig.kinds.wavebot.tick import KIND
from rig.realtime import cycle
from rig.realtime.requests import NO_REQUEST
from rig.sweeps.executors import available_processors

MIN_RATIO = 40.0  # of the interpreted loop to a pass
MAX_RESTART_SECONDS = 2.0
_INTERPRETED_S = 60.0  # simulated

_HEAD = """\
name: benchmark_batch
rig: {rig}
tare: {{duration_s: 1}}
"""
IRREGULAR = """\
sea: {{kind: jonswap, hs_m: 0.127, tp_s: 2.5, repeat_s: {seconds}}}
timing: {{settle_s: 10}}
matrix:
  grid:
    - spring_n_per_m: [490.9, -2763, -5715]
      kp_n_s_per_m: {{from: -1000, to: {last}, step: -100}}
      ki_n_per_m: [0, 2000, 4000]
"""
_REGULAR = """\
sea: {{kind: regular, amplitude_m: 0.127, frequency_hz: 0.5}}
matrix:
  grid:
    - spring_n_per_m: -2763
      kp_n_s_per_m: {{from: -1000, to: {last}, step: -20}}
      ki_n_per_m: {{from: 0, to: 4950, step: {step}}}
"""


class SweepCost(NamedTuple):
    """Cost of one `rig sweep` in its own process."""

    seconds: float  # from its start to its end, pictures included
    processor: float  # s, of all threads
    rows: int
    simulated: float  # s
    megabytes: float  # most memory


def write_campaign_file(folder: Path, text: str) -> Path:
    """Write a campaign on the WaveBot; return its path."""
    path = folder / "benchmark_batch.yaml"
    rig = json.dumps(str(ROOT / "configs" / "rigs" / "wavebot.yaml"))
    path.write_text(_HEAD.format(rig=rig) + text)
    return path


def run_pass(path: Path) -> float:
    """Return the processor time (us) of a tick, over all rows of a campaign without analysis."""
    campaign, plan = open_checked(path)
    simulator = CampaignSimulator(campaign, plan)
    simulator.prepare()
    rows = simulator.simulate(plan)
    began = time.process_time()
    for _ in rows:
        pass
    return (time.process_time() - began) / rows.seconds * plan.dt * 1e6


def run_interpreted(path: Path) -> float:
    """Return the processor time (us) of a tick of the interpreted loop, its plant compiled."""
    parts = build_loop_parts(path)
    devices, dt = parts.connect(), parts.plan.dt
    step, state = cycle.make(KIND), cycle.start(KIND, parts.params, 0)
    timing, ticks = cycle.Timing(0.0, 0.0, 0), round(_INTERPRETED_S / dt)
    began = time.process_time()
    for tick in range(ticks):
        sense = devices.read(tick * dt)
        state, command, _ = step(parts.params, state, sense, NO_REQUEST, tick, timing, 1, dt)
        devices.write(command)
    return (time.process_time() - began) / ticks * 1e6


def run_sweep(path: Path, folder: Path) -> SweepCost:
    """Run `rig sweep` of a campaign from start to end."""
    command = [*rig_command(), "sweep", str(path), "--sweeps", str(folder), "--json"]
    began = time.perf_counter()
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        output = process.stdout.read()
        _, status, used = os.wait4(process.pid, 0)  # memory of this process alone
        process.returncode = os.waitstatus_to_exitcode(status)
    seconds = time.perf_counter() - began
    if process.returncode != 0:
        raise RuntimeError(f"the sweep ended with {process.returncode}: {output}")
    report = json.loads(output)
    processor, max_memory = used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0
    rows = sum(report["rows"].values())
    return SweepCost(seconds, processor, rows, report["simulated_s"], max_memory)


def _sweep_figures(name: str, swept: SweepCost, tick_us: float, dt: float) -> list[Figure]:
    ticks_s = swept.simulated / dt * tick_us * 1e-6
    return [
        figure(name, "s", swept.seconds),
        figure("  of it", "s of processor", swept.processor),
        figure("  of it", "x real time", swept.simulated / swept.seconds),
        figure("  processor time / that of its ticks alone", "x", swept.processor / ticks_s),
    ]


def measure(short: bool) -> Result:
    """Passes through a plan, a long campaign, many rows, and restarts of a finished sweep."""
    repeats, seconds, last, to, step = (1, 20, -1100, -1100, 1650) if short else (
        5, 300, -2000, -2980, 50,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        irregular = write_campaign_file(folder, IRREGULAR.format(seconds=seconds, last=-1000))
        dt = open_checked(irregular)[1].dt
        pairs = [(run_interpreted(irregular), run_pass(irregular)) for _ in range(repeats)]
        small = run_sweep(irregular, folder / "few")
        long = run_sweep(
            write_campaign_file(folder, IRREGULAR.format(seconds=seconds, last=last)),
            folder / "long",
        )
        regular = write_campaign_file(folder, _REGULAR.format(last=to, step=step))
        many = run_sweep(regular, folder / "many")
        restarts = [run_sweep(regular, folder / "many") for _ in range(repeats)]

    interpreted, passes = ([pair[i] for pair in pairs] for i in (0, 1))
    return Result(
        "batch",
        "campaigns in the compiled loop, from file to NetCDF and pictures",
        f"{repeats} passes over {small.rows} rows of {seconds} s; {long.rows} rows of {seconds} s "
        f"and {many.rows} rows of a regular sea by `rig sweep` on {available_processors()} cores, "
        "once each; "
        f"{repeats} starts when all is finished",
        (
            figure("interpreted loop", "us of processor a tick", interpreted),
            figure("one pass", "us of processor a tick", passes),
            figure("one pass", "x real time", [dt * 1e6 / us for us in passes]),
            figure(
                "interpreted / pass", "x", ratios(interpreted, passes),
                at_least=None if short else MIN_RATIO,
            ),
            *_sweep_figures(f"{long.rows} irregular rows", long, float(np.median(passes)), dt),
            *_sweep_figures(f"{many.rows} regular rows", many, float(np.median(passes)), dt),
            figure(f"most memory, {small.rows} rows", "MB", small.megabytes),
            figure(f"most memory, {long.rows} rows", "MB", long.megabytes),
            figure(f"most memory, {many.rows} regular rows", "MB", many.megabytes),
            figure(
                "started again, all finished", "s", [one.seconds for one in restarts],
                at_most=MAX_RESTART_SECONDS,
            ),
        ),
        (f"load of the host before: {os.getloadavg()[0]:.1f}",),
    )  # fmt: skip
