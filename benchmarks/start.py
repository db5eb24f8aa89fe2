"""Start-up time: `rig --help`, `rig run` to its first tick, `rig sweep` to its first case."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.support.live_run import LiveRun, wait_realtime_free
from benchmarks.support.recorded import ROOT, write_campaign_file
from benchmarks.support.result import Result, figure, ratios

MAX_HELP_SECONDS, MAX_CASE_SECONDS = 0.4, 2.0
RIG_MODULE = [sys.executable, "-c", "import rig.cli.app as c; c.app(prog_name='rig')"]


def rig_command() -> list[str]:
    """Return the command of the installed `rig`, or an equivalent one if it is not installed."""
    script = Path(sys.executable).parent / "rig"
    return [str(script)] if script.exists() else RIG_MODULE


def time_command(command: list[str]) -> float:
    """Return the wall time (s) of a command; raises CalledProcessError if it fails."""
    began = time.perf_counter()
    subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    return time.perf_counter() - began


def time_first_tick(folder: Path, *, real_clock: bool) -> float:
    """Return the seconds from `rig run` until the ring has a row."""
    campaign = write_campaign_file(folder, 40.0)
    if real_clock:
        wait_realtime_free()
    options = ["--realtime"] if real_clock else []
    command = [
        *rig_command(),
        "run",
        str(campaign),
        "--runs",
        str(folder / "runs"),
        "--json",
        *options,
    ]
    with LiveRun(command, folder / "watched") as run:
        return run.wait_started().time - run.start_time


def time_first_case(folder: Path) -> float:
    """Return the processor seconds of `rig sweep` until its journal has the first case."""
    campaign = ROOT / "configs" / "campaigns" / "quick.yaml"
    command = [
        *rig_command(),
        "sweep",
        str(campaign),
        "--sweeps",
        str(folder),
        "--jobs",
        "1",
        "--json",
    ]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as process:
        while not any(path.stat().st_size for path in folder.glob("*/cases.jsonl")):
            if process.poll() is not None:
                raise RuntimeError(f"the sweep ended with {process.returncode} before its cases")
            time.sleep(0.002)
        fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure(short: bool) -> Result:
    """Time starts of the command line."""
    helps, runs = (3, 1) if short else (10, 5)
    help_command, bare_command = [*rig_command(), "--help"], [sys.executable, "-c", "pass"]
    shown, bare = list[float](), list[float]()
    virtual, real = list[float](), list[float]()
    for _ in range(helps):
        shown.append(time_command(help_command))
        bare.append(time_command(bare_command))
    cases = list[float]()
    for attempt in range(1 + helps):
        with tempfile.TemporaryDirectory() as scratch:
            took = time_first_case(Path(scratch))
        if attempt > 0:  # the first attempt may have compiled
            cases.append(took)
    for _ in range(runs):
        for starts, real_clock in ((virtual, False), (real, True)):
            with tempfile.TemporaryDirectory() as scratch:
                starts.append(time_first_tick(Path(scratch), real_clock=real_clock))
    return Result(
        "start",
        "waiting for the command line",
        f"{helps} times --help, alternating with a bare interpreter; {helps} sweeps that "
        f"compile nothing; {runs} starts on each clock",
        (
            figure("rig --help", "s", shown, at_most=MAX_HELP_SECONDS),
            figure("bare interpreter", "s", bare),
            figure("rig --help / bare interpreter", "ratio", ratios(shown, bare)),
            figure(
                "rig sweep to its first case", "s of processor", cases, at_most=MAX_CASE_SECONDS
            ),
            figure("rig run to the first tick", "s", virtual),
            figure("rig run --realtime to the first tick", "s", real),
        ),
    )
