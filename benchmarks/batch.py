"""Campaigns in the compiled loop: times real time, a long campaign, ten thousand rows, memory."""

import json
import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.start import rig_command
from benchmarks.support.campaigns import open_checked
from benchmarks.support.recorded import ROOT
from benchmarks.support.reference_cpu import NORMALISED, REFERENCE_CPU_US, reference_cost
from benchmarks.support.result import Figure, Result, figure
from rig.kinds.wavebot.simulation.simulation import CampaignSimulator
from rig.sweep.executors import available_processors

MIN_TIMES_REAL = 2000.0
MAX_LONG_SECONDS, MAX_MANY_SECONDS, MAX_RESTART_SECONDS = 20.0, 120.0, 2.0
REFERENCE_REPEATS = 2000  # repetitions of the reference

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
    reference: float  # us for 100 NamedTuples, mean of before and after

    @property
    def normalised_seconds(self) -> float:
        """Seconds normalised to the reference CPU, including the mutual slowing of two cores."""
        return self.seconds * REFERENCE_CPU_US / self.reference


def write_campaign_file(folder: Path, text: str) -> Path:
    """Write a campaign on the WaveBot; return its path."""
    path = folder / "benchmark_batch.yaml"
    rig = json.dumps(str(ROOT / "configs" / "rigs" / "wavebot.yaml"))
    path.write_text(_HEAD.format(rig=rig) + text)
    return path


class BatchPass(NamedTuple):
    """Time of one pass through a plan, without analysis."""

    speed: float  # simulated seconds a second of processor time
    reference: float  # us for 100 NamedTuples, meanwhile


def run_pass(path: Path) -> BatchPass:
    """Time all rows of a campaign, one after another, with the reference measured between them."""
    campaign, plan = open_checked(path)
    simulator = CampaignSimulator(campaign, plan)
    simulator.prepare()
    rows = simulator.simulate(plan)
    windows, references, seconds, more = iter(rows), list[float](), 0.0, True
    while more:
        references.append(reference_cost(100))
        began = time.process_time()
        more = next(windows, None) is not None
        seconds += time.process_time() - began
    return BatchPass(rows.seconds / seconds, sum(references) / len(references))


def run_sweep(path: Path, folder: Path) -> SweepCost:
    """Run `rig sweep` of a campaign from start to end."""
    command = [*rig_command(), "sweep", str(path), "--sweeps", str(folder), "--json"]
    before = reference_cost(REFERENCE_REPEATS)
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
    rows, reference = (
        sum(report["rows"].values()),
        (before + reference_cost(REFERENCE_REPEATS)) / 2.0,
    )
    return SweepCost(seconds, processor, rows, report["simulated_s"], max_memory, reference)


def _sweep_figures(name: str, swept: SweepCost, at_most: float | None) -> list[Figure]:
    return [
        figure(name, "s", swept.seconds),
        figure(f"{name}, {NORMALISED}", "s", swept.normalised_seconds, at_most=at_most),
        figure("  of it", "s of processor", swept.processor),
        figure("  of it", "x real time", swept.simulated / swept.seconds),
        figure("  100 NamedTuples, before and after", "us", swept.reference),
    ]


def measure(short: bool) -> Result:
    """Passes through a plan, a long campaign, many rows, and restarts of a finished sweep."""
    repeats, seconds, last, to, step = (1, 20, -1100, -1100, 1650) if short else (
        5, 300, -2000, -2980, 50,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        irregular = write_campaign_file(folder, IRREGULAR.format(seconds=seconds, last=-1000))
        passes = [run_pass(irregular) for _ in range(repeats)]
        small = run_sweep(irregular, folder / "few")
        long = run_sweep(
            write_campaign_file(folder, IRREGULAR.format(seconds=seconds, last=last)),
            folder / "long",
        )
        regular = write_campaign_file(folder, _REGULAR.format(last=to, step=step))
        many = run_sweep(regular, folder / "many")
        restarts = [run_sweep(regular, folder / "many") for _ in range(repeats)]

    return Result(
        "batch",
        "campaigns in the compiled loop, from file to NetCDF and pictures",
        f"{repeats} passes over {small.rows} rows of {seconds} s; {long.rows} rows of {seconds} s "
        f"and {many.rows} rows of a regular sea by `rig sweep` on {available_processors()} cores, "
        "once each; "
        f"{repeats} starts when all is finished",
        (
            figure("one pass, by processor time", "x real time", [one.speed for one in passes]),
            figure(
                f"one pass, {NORMALISED}", "x real time",
                [one.speed * one.reference / REFERENCE_CPU_US for one in passes],
                at_least=MIN_TIMES_REAL,
            ),
            figure("100 NamedTuples (reference)", "us", [one.reference for one in passes]),
            *_sweep_figures(
                f"{long.rows} irregular rows", long, None if short else MAX_LONG_SECONDS
            ),
            *_sweep_figures(f"{many.rows} regular rows", many, None if short else MAX_MANY_SECONDS),
            figure(f"most memory, {small.rows} rows", "MB", small.megabytes),
            figure(f"most memory, {long.rows} rows", "MB", long.megabytes),
            figure(f"most memory, {many.rows} regular rows", "MB", many.megabytes),
            figure("started again, all finished", "s", [one.seconds for one in restarts]),
            figure(
                f"started again, {NORMALISED}", "s", [one.normalised_seconds for one in restarts],
                at_most=MAX_RESTART_SECONDS,
            ),
        ),
        (f"load of the host before: {os.getloadavg()[0]:.1f}",),
    )  # fmt: skip
