"""How long a person waits: `rig --help`, and `rig run` until the first tick."""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.support.live import LiveRun, wait_realtime_free
from benchmarks.support.recorded import ROOT, campaign_file
from benchmarks.support.result import Result, figure, ratios

HELP_SECONDS = 0.4
RIG = [sys.executable, "-c", "import rig.cli; rig.cli.app(prog_name='rig')"]


def command() -> list[str]:
    """The installed `rig`, or what it does where the script is not installed."""
    script = Path(sys.executable).parent / "rig"
    return [str(script)] if script.exists() else RIG


def seconds_of(words: list[str]) -> float:
    """Wall time of a command that has to succeed."""
    began = time.perf_counter()
    subprocess.run(words, cwd=ROOT, capture_output=True, check=True)
    return time.perf_counter() - began


def first_tick(folder: Path, *, real_clock: bool, env: dict[str, str] | None = None) -> float:
    """Seconds from `rig run` until a row of its first ticks is in the ring."""
    campaign = campaign_file(folder, 40.0)
    if real_clock:
        wait_realtime_free(env)
    options = ["--realtime"] if real_clock else []
    words = [*command(), "run", str(campaign), "--runs", str(folder / "runs"), "--json", *options]
    with LiveRun(words, folder / "watched", env) as run:
        return run.wait_started().at - run.began


def measure(short: bool) -> Result:
    """Start the command line again and again."""
    helps, runs = (3, 1) if short else (10, 5)
    help_words, bare_words = [*command(), "--help"], [sys.executable, "-c", "pass"]
    shown, bare = list[float](), list[float]()
    virtual, real = list[float](), list[float]()
    for _ in range(helps):
        shown.append(seconds_of(help_words))
        bare.append(seconds_of(bare_words))
    for _ in range(runs):
        for into, real_clock in ((virtual, False), (real, True)):
            with tempfile.TemporaryDirectory() as scratch:
                into.append(first_tick(Path(scratch), real_clock=real_clock))
    return Result(
        "start",
        "waiting for the command line",
        f"{helps} times --help, alternating with a bare interpreter; {runs} starts on each clock",
        (
            figure("rig --help", "s", shown, at_most=HELP_SECONDS),
            figure("bare interpreter", "s", bare),
            figure("rig --help / bare interpreter", "ratio", ratios(shown, bare)),
            figure("rig run to the first tick", "s", virtual),
            figure("rig run --realtime to the first tick", "s", real),
        ),
    )
