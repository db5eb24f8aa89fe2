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

MAX_US = {"p50": 150.0, "p99": 300.0}
_QUANTILES = {"p50": 0.5, "p99": 0.99}
_REST = "loop, mailbox and ring"
_RIG = ROOT / "configs" / "rigs" / "wavebot_hil.yaml"

Times = npt.NDArray[np.float64]


class RunTimes(NamedTuple):
    """Times of the compiled ticks of a run in us, one entry a tick."""

    whole: Times  # from the wake-up to the last action, by the loop itself
    parts: dict[str, Times]  # by `timed_wires.PARTS` and the rest; empty without stamps


def time_run(campaign: Path, folder: Path, *, stamped: bool) -> RunTimes:
    """Run a campaign on emulated devices; RuntimeError if no tick ran compiled."""
    stamps_file = folder / "stamps"
    os.environ[timed_wires.STAMPS_FILE] = str(stamps_file)
    devices = (timed_wires.__name__,) if stamped else ()
    outcome = run_wired(campaign, _RIG, folder / "runs", *devices)
    begin = outcome["compiled_from"] + 1
    if begin == 0:
        raise RuntimeError("no tick ran compiled: compile the campaign first (rig compile)")
    # The row of a tick has the work of the tick before.
    work = open_run(Path(outcome["folder"]), fields=["timing.work"])["timing.work"].values[1:] * 1e6
    if not stamped:
        return RunTimes(work[begin:], {})
    stamps = np.frombuffer(stamps_file.read_bytes(), dtype=np.int64)
    parts = np.diff(stamps.reshape(-1, timed_wires.STAMPS)).T / 1e3
    ticks = min(len(work), parts.shape[1])
    whole, parts = work[begin:ticks], parts[:, begin:ticks]
    named = dict(zip(timed_wires.PARTS, parts, strict=True))
    return RunTimes(whole, named | {_REST: whole - parts.sum(axis=0)})


def measure(short: bool) -> Result:
    """Alternate runs of a WaveBot on emulated devices without and with stamps in its ticks."""
    seconds, pairs = (18.0, 1) if short else (30.0, 4)
    plain, stamped = list[RunTimes](), list[RunTimes]()
    with tempfile.TemporaryDirectory() as scratch:
        campaign = write_campaign_file(Path(scratch), seconds)
        for i in range(pairs):
            for has_stamps, runs in ((False, plain), (True, stamped)):
                folder = Path(scratch) / f"{i}{has_stamps}"
                folder.mkdir()
                runs.append(time_run(campaign, folder, stamped=has_stamps))
    measured = {
        "whole": [run.whole for run in plain],
        "whole with stamps": [run.whole for run in stamped],
        **{part: [run.parts[part] for run in stamped] for part in (*timed_wires.PARTS, _REST)},
    }
    return Result(
        "hil_tick",
        "a tick of a WaveBot with all drivers on real wires, part by part",
        f"{pairs} runs of {seconds:g} s without stamps and {pairs} with, alternating, emulated "
        f"devices on {len(os.sched_getaffinity(0))} cores",
        tuple(
            figure(
                f"{part}, {name}",
                "us",
                [quantile(times, share) for times in runs],
                at_most=MAX_US[name] if part == "whole" else None,
            )
            for part, runs in measured.items()
            for name, share in _QUANTILES.items()
        ),
        (
            "the whole is the loop's own measure, from the wake-up to the last action of a tick; "
            "each part lasts from stamp to stamp and contains the cost of one, some 2 us with cold "
            "caches",
        ),
    )
