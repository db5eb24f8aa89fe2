"""Memory of the operator's page and of a browser, over an hour of traces."""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scipy.stats import theilslopes

from benchmarks.support.chromium import Chromium
from benchmarks.support.live_run import resident_bytes
from benchmarks.support.recorded import write_campaign_file
from benchmarks.support.result import Result, figure

MAX_GROWTH_MB = 5.0  # from the time at which the traces are full
TRACE_S = 600.0  # s that the traces show


@contextmanager
def _replay(folder: Path) -> Iterator[tuple[int, str]]:
    """Yield process and address of the page that replays a run."""
    command = [sys.executable, "-m", "rig", "page", str(folder), "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield process.pid, json.loads(process.stdout.readline())["addresses"]["page"]
        finally:
            process.terminate()


def _record(folder: Path, seconds: float) -> Path:
    """Rehearse a campaign of at least ``seconds``; return the folder of the run."""
    campaign = write_campaign_file(folder, seconds)
    command = [sys.executable, "-m", "rig", "run", str(campaign), "--runs", str(folder / "runs")]
    subprocess.run([*command, "--json"], check=True, stdout=subprocess.DEVNULL)
    (run,) = (folder / "runs").iterdir()
    return run


def measure(short: bool) -> Result:
    """Replay an hour of a run at its own speed; in the short form 30 min, 50 times as fast."""
    seconds, speed, samples = (1800.0, 50.0, 12) if short else (3600.0, 1.0, 60)
    page_mb, heap_mb, drawn = list[float](), list[float](), 0
    with tempfile.TemporaryDirectory() as scratch:
        run = _record(Path(scratch), seconds)
        with _replay(run) as (process, url):
            browser = Chromium(Path(scratch) / "profile")
            try:
                browser.size(1600, 1000)
                browser.open(url)
                browser.wait("document.querySelectorAll('canvas').length > 1", 60.0)
                browser.run(f"document.getElementById('span').value = '{TRACE_S:g}'")
                browser.run("document.getElementById('span').dispatchEvent(new Event('change'))")
                browser.run(f"document.getElementById('speed').value = '{speed:g}'")
                browser.run("document.getElementById('speed').dispatchEvent(new Event('change'))")
                for _ in range(samples):
                    time.sleep(seconds / speed / samples)
                    browser.call("HeapProfiler.collectGarbage")
                    heap = browser.call("Runtime.getHeapUsage")["usedSize"]
                    heap_mb.append(heap / 1e6)
                    page_mb.append(resident_bytes(process)["private"] / 1e6)
                drawn = browser.run("document.querySelectorAll('canvas').length")
                failed = len(browser.failed)
            finally:
                browser.close()
    full = round(samples * TRACE_S / seconds)
    figures = (
        figure("private memory of the page's process", "MB", page_mb),
        figure("heap of the browser after garbage collection", "MB", heap_mb),
        figure("growth of the page's process", "MB", [_growth(page_mb[full:])],
               at_most=MAX_GROWTH_MB),
        figure("growth of the browser's heap", "MB", [_growth(heap_mb[full:])],
               at_most=MAX_GROWTH_MB),
        figure("failed requests and scripts", "failures", [failed], at_most=0),
    )  # fmt: skip
    return Result(
        "page_memory",
        "memory of the operator's page and of Chromium while they show a run",
        f"{seconds:g} s of a run at {speed:g} times its speed, {drawn} canvases, {samples} samples",
        figures,
        (
            "growth: median slope between samples times their span, after the first "
            f"{full} samples, in which the traces of {TRACE_S:g} s fill",
        ),
    )


def _growth(values: list[float]) -> float:
    """Return the growth of values by the median of the slopes between them (Theil and Sen).

    Memory that is in use for the length of one sample alone does not change it; a leak does.
    """
    return float(theilslopes(values).slope * (len(values) - 1))
