"""A tick on real wires, part by part: frames, decoding, sense, compiled step, encoding, sending."""

import os
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.hil import run_wired
from benchmarks.support import timed_wires
from benchmarks.support.recorded import ROOT, write_campaign_file
from benchmarks.support.result import Result, figure, quantile
from rig.recording.runs import open_run

MAX_P50_US, MAX_P99_US = 150.0, 300.0
_REST = "loop, mailbox and ring"
_QUANTILES = (("p50", 0.5), ("p99", 0.99))


class TickParts(NamedTuple):
    """Times of one run in us, one entry a tick."""

    whole: npt.NDArray[np.float64]  # from the wake-up to the last action, by the loop itself
    parts: dict[str, npt.NDArray[np.float64]]
    compiled_from: int  # first tick that ran compiled; -1: none


def time_run(campaign: Path, rig: Path, folder: Path) -> TickParts:
    """Run a campaign on emulated devices with stamped parts of its ticks."""
    os.environ[timed_wires.STAMPS_FILE] = str(folder / "stamps")
    outcome = run_wired(campaign, rig, folder / "runs", timed_wires.__name__)
    stamps = np.frombuffer((folder / "stamps").read_bytes(), dtype=np.int64)
    parts = np.diff(stamps.reshape(-1, timed_wires.STAMPS)).T / 1e3
    # The row of a tick has the work of the tick before.
    whole = 1e6 * open_run(Path(outcome["folder"]), fields=["timing.work"])["timing.work"].values
    ticks = min(len(whole), parts.shape[1]) - 1
    whole, parts = whole[1 : ticks + 1], parts[:, :ticks]
    named = dict(zip(timed_wires.PARTS, parts, strict=True))
    return TickParts(whole, named | {_REST: whole - parts.sum(axis=0)}, outcome["compiled_from"])


def measure(short: bool) -> Result:
    """Runs of a WaveBot on emulated devices; only the compiled ticks count."""
    seconds, runs = (18.0, 1) if short else (120.0, 5)
    rig = ROOT / "configs" / "rigs" / "wavebot_hil.yaml"
    found: list[TickParts] = []
    with tempfile.TemporaryDirectory() as scratch:
        campaign = write_campaign_file(Path(scratch), seconds)
        for i in range(runs):
            folder = Path(scratch) / str(i)
            folder.mkdir()
            found.append(time_run(campaign, rig, folder))
    if any(run.compiled_from < 0 for run in found):
        raise RuntimeError("a run had no compiled tick: compile the campaign first (rig compile)")

    def values(run: TickParts, part: str) -> npt.NDArray[np.float64]:
        times = run.whole if part == "whole" else run.parts[part]
        return times[run.compiled_from + 1 :]

    limits = {"p50": MAX_P50_US, "p99": MAX_P99_US}
    return Result(
        "hil_tick",
        "a tick of a WaveBot with all drivers on real wires, part by part",
        f"{runs} runs of {seconds:g} s with emulated devices on {len(os.sched_getaffinity(0))} "
        "cores",
        tuple(
            figure(
                f"{part}, {name}",
                "us",
                [quantile(values(run, part), share) for run in found],
                at_most=limits[name] if part == "whole" else None,
            )
            for part in ("whole", *timed_wires.PARTS, _REST)
            for name, share in _QUANTILES
        ),
        (
            "the whole is the loop's own measure, from the wake-up to the last action of the tick; "
            "it has the stamps in it, some 0.2 us each",
        ),
    )
