"""An EtherCAT segment, emulated: pysoem alone at 1 kHz, and the loop at 1 and 4 kHz."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.hil import AGE_FIELDS, MIN_EXECUTED, HilRun, run_hil
from benchmarks.lateness import (
    MAX_P50_RATIO,
    MAX_P99_RATIO,
    NO_CYCLICTEST,
    LatenessBlock,
    run_cyclictest,
)
from benchmarks.support.campaigns import write_yaml
from benchmarks.support.recorded import ROOT, write_campaign_file
from benchmarks.support.result import Figure, Result, figure, quantile, ratios
from rig.emulation.cable import Cable, cable_problem

LINE = (
    "torque_drive", "position_drive", "coupler", "digital_in:4", "digital_in:8", "digital_out:4",
    "analog_in", "encoder:2",
)  # fmt: skip
PERIOD_S = 0.001
_ANSWER_US = 2_000_000  # longer than any stall of a shared host
_WATCHDOG_MS = 5000.0


class PysoemRun(NamedTuple):
    """An independent master on the emulated segment."""

    to_op: float  # s
    wrong: int  # frames whose working counter was wrong, or that did not come back
    trips: tuple[float, float, float]  # us: p50, p99, p99.9 of send and receive


def run_pysoem(seconds: float) -> PysoemRun:
    """Bring two drives and six terminals to OP with pysoem, unchanged, and exchange at 1 kHz."""
    import pysoem  # noqa: PLC0415 - an optional dependency

    cable = Cable(f"wep{os.getpid()}")
    cable.plug()
    command = [sys.executable, "-m", "sim_plant.emulators.ethercat", cable.far]
    with subprocess.Popen(
        [*command, "--slaves", ",".join(LINE)], cwd=ROOT,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as emulator:  # fmt: skip
        try:
            assert emulator.stdout is not None
            emulator.stdout.readline()
            began = time.perf_counter()
            master = pysoem.Master()
            master.open(cable.interface)
            if master.config_init() != len(LINE):
                raise RuntimeError("pysoem does not find all slaves")
            master.config_map()
            for slave in master.slaves[:2]:
                slave.set_watchdog("processdata", _WATCHDOG_MS)
            master.slaves[5].set_watchdog("processdata", _WATCHDOG_MS)
            return _exchange(master, pysoem.OP_STATE, began, seconds)
        finally:
            emulator.terminate()
            emulator.wait(10.0)
            cable.unplug()


def _exchange(master: Any, operational: int, began: float, seconds: float) -> PysoemRun:
    master.send_processdata()
    right = master.receive_processdata(_ANSWER_US)
    master.state = operational
    master.write_state()
    while master.state_check(operational, 1000) != operational:
        master.send_processdata()
        right = max(right, master.receive_processdata(_ANSWER_US))
    to_op = time.perf_counter() - began
    # What LRW counts: 2 for outputs and 1 for inputs of both drives, 1 or 2 of each terminal.
    expected = 3 + 3 + 0 + 1 + 1 + 2 + 1 + 1
    wrong, trips, due = 0, [], time.perf_counter()
    for _ in range(round(seconds / PERIOD_S)):
        due += PERIOD_S
        sent = time.perf_counter()
        master.send_processdata()
        wrong += master.receive_processdata(_ANSWER_US) != expected
        trips.append(1e6 * (time.perf_counter() - sent))
        time.sleep(max(0.0, due - time.perf_counter()))
    master.close()
    ranked = np.array(trips)
    return PysoemRun(
        to_op, wrong, (quantile(ranked, 0.5), quantile(ranked, 0.99), quantile(ranked, 0.999))
    )


def write_rig(folder: Path, rate: int) -> Path:
    """Write the WaveBot on a segment of its own at a rate (Hz)."""
    tick_us = round(1e6 / rate)
    objects = {"interpolation_time": tick_us % 1000 or 1, "interpolation_exponent": -6}
    if tick_us == 1000:
        objects = {"interpolation_time": 1, "interpolation_exponent": -3}
    drive = {"objects": objects}
    rig = {
        "extends": str(ROOT / "configs" / "rigs" / "wavebot_ethercat.yaml"),
        "rate_hz": rate,
        "wiring": {
            "ethercat": {"interface": f"web{os.getpid()}"},
            "heave": drive,
            "surge": drive,
        },
    }
    return write_yaml(folder / f"rig_{rate}.yaml", rig)


class SegmentRun(NamedTuple):
    """A run of the loop on the emulated segment."""

    hil: HilRun
    frames: dict[str, Any]  # of the run's report on its wires


def run_loop(campaign: Path, rig: Path, folder: Path, tries: int = 3) -> SegmentRun:
    """Run a campaign on the emulated segment and read its report.

    A run that a stall of the host ended is repeated.
    """
    for _ in range(tries - 1):
        with suppress(RuntimeError):
            return _run_once(campaign, rig, folder)
        shutil.rmtree(folder)
    return _run_once(campaign, rig, folder)


def _run_once(campaign: Path, rig: Path, folder: Path) -> SegmentRun:
    found = run_hil(campaign, rig, folder)
    (report,) = folder.glob("*/wires.json")
    return SegmentRun(found, json.loads(report.read_text())["ethercat"])


def measure(short: bool) -> Result:
    """Alternate runs at 1 kHz with cyclictest; then one run at 4 kHz, and pysoem for 10 min."""
    if problem := cable_problem(f"web{os.getpid()}"):
        raise RuntimeError(problem)
    seconds, runs, alone = (15.0, 1, 10.0) if short else (90.0, 5, 600.0)
    has_cyclictest = shutil.which("cyclictest") is not None
    ours, blocks = list[SegmentRun](), list[LatenessBlock]()
    with tempfile.TemporaryDirectory() as scratch:
        campaign = write_campaign_file(Path(scratch), seconds)
        slow, fast = (write_rig(Path(scratch), rate) for rate in (1000, 4000))
        for i in range(runs):
            ours.append(run_loop(campaign, slow, Path(scratch) / f"runs{i}"))
            if has_cyclictest:
                blocks.append(run_cyclictest(2.0 if short else 20.0))
        notes = []
        try:  # 12 emulated slaves take some 0.2 ms of a core for a frame, and a tick is 0.25 ms
            quick = [run_loop(campaign, fast, Path(scratch) / "quick", 1)]
        except RuntimeError as error:
            quick = []
            notes.append(f"at 4 kHz: {error}; the emulated line takes longer than a tick")
    pysoem = run_pysoem(alone)
    figures = [
        *_loop_figures("1 kHz", ours, MIN_EXECUTED),
        *_ratio_figures(ours, blocks),
        *_loop_figures("4 kHz", quick, None),
        figure("pysoem: from open to OP", "s", [pysoem.to_op]),
        figure("pysoem: frames with a wrong working counter", "frames", [pysoem.wrong], at_most=0),
        *(
            figure(f"pysoem: round trip, {name}", "us", [value])
            for name, value in zip(("p50", "p99", "p99.9"), pysoem.trips, strict=True)
        ),
    ]
    return Result(
        "ethercat",
        "an emulated EtherCAT segment: the WaveBot's 12 slaves, and pysoem with 8",
        f"{runs} runs of {seconds:g} s at 1 kHz, one at 4 kHz, pysoem for {alone:g} s at 1 kHz, on "
        f"{len(os.sched_getaffinity(0))} cores",
        tuple(figures),
        (
            "the emulated slaves are on the same host and take about half a core at 1 kHz",
            *(() if has_cyclictest else (NO_CYCLICTEST,)),
            *notes,
            *sorted({f"not granted to the loop: {why}" for run in ours for why in run.hil.refused}),
        ),
    )


def _loop_figures(rate: str, runs: list[SegmentRun], least: float | None) -> list[Figure]:
    if not runs:
        return []
    frames = [run.frames for run in runs]
    return [
        figure(f"{rate}: executed of elapsed", "%", [r.hil.executed for r in runs], at_least=least),
        figure(f"{rate}: rows lost", "rows", [r.hil.lost for r in runs], at_most=0),
        figure(f"{rate}: frames with a wrong working counter", "frames",
               [f["wrong_working_counter"] for f in frames], at_most=0),
        figure(f"{rate}: frames lost", "frames", [f["lost"] for f in frames]),
        *(
            figure(f"{rate}: tick with all drivers, {name}", "us", [r.hil.work[i] for r in runs])
            for i, name in enumerate(("p50", "p99", "p99.9"))
        ),
        *(
            figure(f"{rate}: age of the inputs, {name}", "ms", [1e3 * f[key] for f in frames])
            for name, key in (("p50", "age_p50_s"), ("p99", "age_p99_s"), ("p99.9", "age_p99_9_s"))
        ),
        figure(f"{rate}: age of heave's encoder, p99", "ms",
               [r.hil.ages[next(iter(AGE_FIELDS))] for r in runs]),
    ]  # fmt: skip


def _ratio_figures(runs: list[SegmentRun], blocks: list[LatenessBlock]) -> list[Figure]:
    found = []
    for name, limit in (("p50", MAX_P50_RATIO), ("p99", MAX_P99_RATIO), ("worst", None)):
        ours = [float(getattr(run.hil.lateness, name)) for run in runs]
        found.append(figure(f"1 kHz: lateness, {name}", "us", ours))
        theirs = [float(getattr(block, name)) for block in blocks]
        if theirs and all(theirs):
            compared = ratios(ours, theirs)
            found.append(
                figure(f"1 kHz: loop / cyclictest, {name}", "ratio", compared, at_most=limit)
            )
    return found
