"""Lateness of the loop with the operator's page, three browsers and Foxglove, against without."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from benchmarks.support.live_run import live_run, resident_bytes
from benchmarks.support.recorded import write_campaign_file
from benchmarks.support.result import Result, figure, quantile, ratios
from rig.recording.runs import open_run

MAX_P99_RATIO = 1.1
BROWSERS = 3
_QUANTILES = {"p50": 0.5, "p99": 0.99}
_SETTLE_S = 3.0  # s after the start and the end of page and browsers that belong to no block


@contextmanager
def _page(folder: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """Yield process and addresses of the page of a run."""
    command = [sys.executable, "-m", "rig", "page", str(folder), "--foxglove", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield process.pid, json.loads(process.stdout.readline())["addresses"]
        finally:
            process.terminate()


@contextmanager
def _chromium(program: str, url: str, folder: Path) -> Iterator[None]:
    """Show the page in tabs of Chromium, which draws them without a screen."""
    options = ["--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}"]
    process = subprocess.Popen(
        [*_off_the_loops_core(), program, *options, *[url] * BROWSERS],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def _off_the_loops_core() -> list[str]:
    """Return the command that starts another one on all cores but the loop's.

    A browser on another computer does not use that one, either.
    """
    cores = sorted(os.sched_getaffinity(0))[:-1]
    return ["taskset", "--cpu-list", ",".join(map(str, cores))] if cores else []


@contextmanager
def _reader(url: str, first: dict[str, Any] | None, protocol: str | None) -> Iterator[None]:
    """Read all messages of a WebSocket in a thread."""
    protocols: Any = [protocol] if protocol else None
    client = connect(url, subprotocols=protocols, origin=None if protocol else _origin(url))
    if first is not None:
        client.send(json.dumps(first))

    def read() -> None:
        with suppress(WebSocketException, OSError):
            for message in client:
                if protocol and isinstance(message, str) and '"advertise"' in message:
                    channel = json.loads(message)["channels"][0]["id"]
                    subscription = {"id": 1, "channelId": channel}
                    client.send(json.dumps({"op": "subscribe", "subscriptions": [subscription]}))

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    try:
        yield
    finally:
        client.close()


def _origin(url: str) -> Any:
    return url.replace("ws://", "http://").removesuffix("/socket")


@contextmanager
def _watched(folder: Path, scratch: Path) -> Iterator[int]:
    """Let page, browsers and a Foxglove client watch a run; yield the page's process."""
    with ExitStack() as stack:
        process, addresses = stack.enter_context(_page(folder))
        program = shutil.which("chromium")
        url = addresses["page"]
        if program:
            profile = Path(tempfile.mkdtemp(dir=scratch))
            stack.enter_context(_chromium(program, url, profile))
        else:
            socket_url = url.replace("http://", "ws://") + "socket"
            for i in range(BROWSERS):
                stack.enter_context(_reader(socket_url, {"hello": {"session": str(i)}}, None))
        stack.enter_context(_reader(addresses["foxglove"], None, "foxglove.sdk.v1"))
        yield process


def measure(short: bool) -> Result:
    """Alternate blocks without and with page, browsers and Foxglove within one run."""
    seconds, pairs = (6.0, 2) if short else (60.0, 8)
    blocks: dict[bool, list[tuple[int, int]]] = {False: [], True: []}
    memory: list[float] = []
    with tempfile.TemporaryDirectory() as scratch:
        total = 2 * pairs * (seconds + 2 * _SETTLE_S) + 60.0
        campaign = write_campaign_file(Path(scratch), total)
        with live_run(campaign, Path(scratch) / "runs", real_clock=True) as run:
            run.wait_started()

            def block() -> tuple[int, int]:
                time.sleep(_SETTLE_S)
                begin = run.observe_tick().tick
                time.sleep(seconds)
                return begin, run.observe_tick().tick

            for _ in range(pairs):
                blocks[False].append(block())
                with _watched(run.folder, Path(scratch)) as process:
                    time.sleep(_SETTLE_S)
                    before = resident_bytes(process)["private"]
                    blocks[True].append(block())
                    memory.append((resident_bytes(process)["private"] - before) / 1e6)
            run.stop()
            outcome = run.wait_ended()
        data = open_run(run.folder, fields=["tick", "timing"])
        ticks, late = data["tick"].values, data["timing.lateness"].values * 1e6
        skipped = int(data["timing.skipped"].values[-1])
    found = {
        watched: [
            late[np.searchsorted(ticks, begin) : np.searchsorted(ticks, end)]
            for begin, end in spans
        ]
        for watched, spans in blocks.items()
    }
    figures = []
    for name, share in _QUANTILES.items():
        without = [quantile(each, share) for each in found[False]]
        with_page = [quantile(each, share) for each in found[True]]
        figures.append(figure(f"without the page, {name}", "us late", without))
        figures.append(figure(f"with page and clients, {name}", "us late", with_page))
        limit = MAX_P99_RATIO if name == "p99" else None
        compared = ratios(with_page, without)
        figures.append(figure(f"with / without, {name}", "ratio", compared, at_most=limit))
    figures.append(figure("growth of the page's private memory in its first minute", "MB", memory))
    figures.append(figure("periods skipped and counted in the run", "periods", [skipped]))
    browser = "tabs of Chromium" if shutil.which("chromium") else "WebSocket clients"
    return Result(
        "page",
        f"wake-up of the loop at 1 kHz with the page, {BROWSERS} {browser} and a Foxglove client",
        f"{pairs} blocks of {seconds:g} s without and {pairs} with, alternating in one run that "
        f"ended {outcome['status']}, on {len(os.sched_getaffinity(0))} cores",
        tuple(figures),
        ("page and browsers use all cores but the last, which is the loop's",),
    )
