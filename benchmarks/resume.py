"""Campaigns that are killed at random moments and resumed until they are complete.

Every process of a run dies at once (SIGKILL), while it starts, ticks, ends or draws. The row table
at the end is compared with that of a run that nothing disturbed.
"""

import os
import random
import signal
import sys
import tempfile
import time
import uuid
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.support.campaigns import write_yaml
from benchmarks.support.kills import ENVIRONMENT_MARK, living_processes
from benchmarks.support.live_run import LiveRun, wait_until
from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Result, figure
from rig.analysis.rows import COMPLETE, row_table, stations_of

GAINS = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000}
CAMPAIGN: dict[str, Any] = {  # 42 s of rig time: a kill costs the time up to it
    "name": "killed",
    "rig": str(ROOT / "configs" / "rigs" / "wavebot.yaml"),
    "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
    "tare": {"duration_s": 1},
    "start": {"lead_in_s": 8},
    "timing": {"settle_s": 2, "interval_s": 8},
    "matrix": {"list": [{**GAINS, "ki_n_per_m": ki} for ki in (0, 1000, 2000, 4000)]},
}
SEED = 20_261_126  # of the moments
KILLS, SHORT_KILLS = 1000, 10
LATEST = 0.9  # of the time of an undisturbed run, from the start of a command
STANDARD_ERRORS = 4.0
"""Allowed difference from the undisturbed run: of the many means of 1,000 runs, one in 16,000 is
farther by chance."""
FLOOR_W = 0.02
"""Added to it: a stage begins with other phases of the plant's noise, and each row with what is
left of the transients of its own lead-in, which the scatter of four periods does not show."""


class ResumedRun(NamedTuple):
    """A campaign that was killed, and resumed to its end."""

    kills: int
    failures: tuple[str, ...]
    largest: float  # largest difference from the undisturbed run, W


def measure(short: bool = False) -> Result:
    """Kill and resume campaigns until the given number of kills is reached."""
    kills = SHORT_KILLS if short else KILLS
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        began = time.monotonic()
        undisturbed = row_table(_run_to_end(place / "undisturbed"))
        latest = LATEST * (time.monotonic() - began)
        with ThreadPoolExecutor(2) as pool:
            shares = pool.map(
                lambda worker: _worker(
                    place / f"worker{worker}", worker, kills // 2, latest, undisturbed
                ),
                range(2),
            )
            runs = [run for share in shares for run in share]
    failures = [failure for run in runs for failure in run.failures]
    return Result(
        "resume",
        "All processes of rehearsed campaigns killed at random moments; resumed until complete.",
        f"{sum(run.kills for run in runs)} kills in {len(runs)} campaigns of "
        f"{len(CAMPAIGN['matrix']['list'])} rows, interpreted, uniformly in {latest:.1f} s from "
        "the start of each command",
        (
            figure("kills", "times", sum(run.kills for run in runs), at_least=kills),
            figure("kills in a campaign", "times", [run.kills for run in runs]),
            figure("rows lost, twice or different", "rows", len(failures), at_most=0),
            figure("largest difference of a mean power", "W", max(run.largest for run in runs)),
        ),
        tuple(failures[:20]),
    )


def _worker(
    folder: Path, number: int, kills: int, latest: float, undisturbed: Any
) -> list[ResumedRun]:
    dice, runs = random.Random(SEED + number), list[ResumedRun]()
    while sum(run.kills for run in runs) < kills:
        runs.append(kill_and_resume(folder / f"{len(runs)}", dice, latest, undisturbed))
    return runs


def kill_and_resume(runs: Path, dice: random.Random, latest: float, undisturbed: Any) -> ResumedRun:
    """Run the campaign, kill it up to ``latest`` s after each start, and resume it; compare rows.

    It goes on until the campaign is complete.
    """
    kills = 0
    while True:
        ended, output = _run_and_kill(runs, dice.uniform(0.0, latest))
        kills += not ended
        if ended:
            break
    folder = _folder(runs)
    assert folder is not None, "the campaign ran"
    failures, largest = _compare(row_table(folder), undisturbed)
    if failures:
        failures = [f"{runs}: {failure} ({output})" for failure in failures]
    return ResumedRun(kills, tuple(failures), largest)


def _folder(runs: Path) -> Path | None:
    folders = sorted(path for path in runs.iterdir() if path.is_dir()) if runs.exists() else []
    return folders[-1] if folders else None


def _command(runs: Path) -> list[str]:
    """Return the command that begins the campaign, or resumes it once rows have been recorded."""
    folder = _folder(runs)
    recorded = folder is not None and any(
        path.suffix == ".mcap" or path.stat().st_size for path in folder.glob("*.mcap*")
    )
    file = runs.with_name(f"{runs.name}.yaml")
    file.parent.mkdir(parents=True, exist_ok=True)
    write_yaml(file, CAMPAIGN)
    what = ["--resume", str(folder)] if recorded else [str(file)]
    return [sys.executable, "-m", "rig", "run", *what, "--interpreted", "--runs", str(runs)]


def _run_and_kill(runs: Path, after: float) -> tuple[bool, str]:
    """Run or resume, and kill every process after so many s.

    Return whether it ended before, and its last line.
    """
    token = uuid.uuid4().hex
    with LiveRun(_command(runs), runs, {ENVIRONMENT_MARK: token}) as run:
        end = time.monotonic() + after
        while time.monotonic() < end and run.process.poll() is None:
            time.sleep(0.01)
        ended = run.process.poll() == 0
        while pids := living_processes(run, token):
            for pid in pids:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(0.01)
        run.process.wait()
        return ended or run.process.returncode > 0, run.last_output_line()


def _run_to_end(runs: Path) -> Path:
    with LiveRun(_command(runs), runs) as run:
        wait_until(lambda: run.process.poll() is not None, "the end of the undisturbed run")
    folder = _folder(runs)
    assert folder is not None, "the campaign ran"
    return folder


def _compare(table: Any, undisturbed: Any) -> tuple[list[str], float]:
    """Return what is wrong with a row table, and its largest difference of a mean power (W)."""
    failures, largest = list[str](), 0.0
    if table["row"].values.tolist() != undisturbed["row"].values.tolist():
        return [f"its rows are {table['row'].values.tolist()}"], 0.0
    for i, state in enumerate(table["state"].values.tolist()):
        if state != COMPLETE:
            failures.append(f"row {i}: {state}, {table['incomplete_reason'].values[i]}")
        for name in ("samples", "periods"):
            if table[name].values[i] != undisturbed[name].values[i]:
                failures.append(f"row {i}: {table[name].values[i]} {name}")
    for station in (each.name for each in stations_of(table)):
        one, other = table[f"power_{station}"].values, undisturbed[f"power_{station}"].values
        errors = [each[f"power_{station}_se"].values for each in (table, undisturbed)]
        difference = np.abs(one - other)
        allowed = STANDARD_ERRORS * np.hypot(*errors) + FLOOR_W
        failures += [
            f"row {i}: {station} {one[i]:.3f} W, undisturbed {other[i]:.3f} W"
            for i in np.flatnonzero(~(difference <= allowed))
        ]
        largest = max(largest, float(np.nanmax(difference)))
    return failures, largest
