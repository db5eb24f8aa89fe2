"""The loop at its real rate through real drivers: lateness, tick time, ages of every device."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.lateness import (
    MAX_P50_RATIO,
    MAX_P99_RATIO,
    NO_CYCLICTEST,
    LatenessBlock,
    run_cyclictest,
    summarise,
)
from benchmarks.ring import refused_privileges
from benchmarks.support.live_run import wait_realtime_free
from benchmarks.support.recorded import ROOT, write_campaign_file
from benchmarks.support.result import Figure, Result, figure, quantile, ratios
from rig.recording.runs import open_run

MIN_EXECUTED = 99.0  # % of the periods
AGE_FIELDS = {
    "encoder and drive, heave": "heave.sense.encoder_age",
    "encoder and drive, surge": "surge.sense.encoder_age",
    "stator": "spring_sense.age",
    "load cells (slowest)": "load.age",
    "power analyser": "power_sense.age",
    "wave probes": "probes.age",
    "panel": "panel.age",
}


class HilRun(NamedTuple):
    """Measurements of one run on emulated devices."""

    lateness: LatenessBlock
    work: tuple[float, float, float]  # us per tick: p50, p99, p99.9
    executed: float  # % of the elapsed periods
    imbalance: int  # executed + skipped - elapsed periods
    lost: int  # rows dropped or not saved
    ages: dict[str, float]  # ms, p99
    refused: tuple[str, ...]


def run_wired(campaign: Path, rig: Path, runs: Path, *devices: str) -> dict[str, Any]:
    """Run a campaign on emulated devices to its end; return its outcome, with its ``folder``.

    ``devices``: another module of the loop's devices. RuntimeError if the run is not complete.
    """
    wait_realtime_free()
    module = "benchmarks.support.run_process"
    done = subprocess.run(
        [sys.executable, "-m", module, campaign, runs, "hil", rig, *devices],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise RuntimeError((done.stderr.strip().splitlines() or ["no output"])[-1])
    outcome: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    if outcome["status"] != "complete":
        raise RuntimeError(f"the run is not complete: {outcome['status']}, {outcome['reason']}")
    return outcome


def run_hil(campaign: Path, rig: Path, runs: Path) -> HilRun:
    """Run a campaign on emulated devices and measure its ticks."""
    outcome = run_wired(campaign, rig, runs)
    folder = Path(outcome["folder"])
    data = open_run(folder, fields=["tick", "timing", *AGE_FIELDS.values()])
    ticks, skipped = data["tick"].values, data["timing.skipped"].values
    elapsed = int(ticks[-1]) + 1
    work = data["timing.work"].values[1:] * 1e6
    return HilRun(
        summarise((data["timing.lateness"].values * 1e6).astype(np.int64)),
        (quantile(work, 0.5), quantile(work, 0.99), quantile(work, 0.999)),
        100.0 * len(ticks) / elapsed,
        len(ticks) + int(skipped[-1]) - elapsed,
        outcome["dropped"] + outcome["unsaved"],
        {name: 1e3 * quantile(data[field].values, 0.99) for name, field in AGE_FIELDS.items()},
        refused_privileges(folder),
    )


def measure(short: bool) -> Result:
    """Alternate runs on emulated devices and cyclictest; delete each run after its analysis."""
    seconds, runs = (18.0, 1) if short else (120.0, 5)
    has_cyclictest = shutil.which("cyclictest") is not None
    hil_runs, cyclictest_blocks = list[HilRun](), list[LatenessBlock]()
    rig = ROOT / "configs" / "rigs" / "wavebot_hil.yaml"
    with tempfile.TemporaryDirectory() as scratch:
        campaign = write_campaign_file(Path(scratch), seconds)
        for i in range(runs):
            folder = Path(scratch) / f"runs{i}"
            hil_runs.append(run_hil(campaign, rig, folder))
            shutil.rmtree(folder)
            if has_cyclictest:
                cyclictest_blocks.append(run_cyclictest(20.0 if not short else 2.0))
    figures: list[Figure] = []
    for name, ours, cyclictest, limit in (
        (
            "p50",
            [r.lateness.p50 for r in hil_runs],
            [b.p50 for b in cyclictest_blocks],
            MAX_P50_RATIO,
        ),
        (
            "p99",
            [r.lateness.p99 for r in hil_runs],
            [b.p99 for b in cyclictest_blocks],
            MAX_P99_RATIO,
        ),
        ("worst", [r.lateness.worst for r in hil_runs], [b.worst for b in cyclictest_blocks], None),
    ):
        figures.append(figure(f"lateness, {name}", "us", ours))
        if cyclictest_blocks and all(cyclictest):
            compared = ratios(ours, cyclictest)
            figures.append(figure(f"loop / cyclictest, {name}", "ratio", compared, at_most=limit))
    for i, name in enumerate(("p50", "p99", "p99.9")):
        figures.append(
            figure(f"tick with all drivers, {name}", "us", [r.work[i] for r in hil_runs])
        )
    figures += [
        figure("executed of elapsed", "%", [r.executed for r in hil_runs], at_least=MIN_EXECUTED),
        figure(
            "executed + skipped - elapsed",
            "periods",
            [abs(r.imbalance) for r in hil_runs],
            at_most=0,
            criterion="worst",
        ),
        figure("rows lost", "rows", [r.lost for r in hil_runs], at_most=0, criterion="worst"),
        *(
            figure(f"age, p99: {name}", "ms", [r.ages[name] for r in hil_runs])
            for name in AGE_FIELDS
        ),
    ]
    notes = [
        "two CAN axes and the actuator over socketcand, five Modbus blocks on three lines, "
        "emulated devices on the other core; cyclictest runs without them, so it has less to do",
        *(() if has_cyclictest else (NO_CYCLICTEST,)),
        *sorted(
            {f"not granted to the loop: {reason}" for run in hil_runs for reason in run.refused}
        ),
    ]
    return Result(
        "hil",
        "a WaveBot on real wires with emulated devices at 1 kHz",
        f"{runs} runs of {seconds:g} s"
        + (", alternating with cyclictest" if has_cyclictest else "")
        + f" on {len(os.sched_getaffinity(0))} cores",
        tuple(figures),
        tuple(notes),
    )
