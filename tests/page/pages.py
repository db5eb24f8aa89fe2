"""Pages and runs for the tests of the page."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import uvicorn
from websockets import Origin
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from rig.page.access import Access
from rig.page.process import listen
from rig.page.server import Page
from rig.page.subject import Subject


@contextmanager
def served(subject: Subject, access: Access) -> Iterator[tuple[Page, int]]:
    """Serve a page in a thread; yield it and its port."""
    page, listener = Page(subject, access), listen("127.0.0.1", 0)
    config = uvicorn.Config(
        page.app, log_level="error", ws="websockets-sansio", timeout_graceful_shutdown=1
    )
    server = uvicorn.Server(config)
    server.capture_signals = _no_signals  # type: ignore[method-assign]
    thread = threading.Thread(target=lambda: asyncio.run(server.serve(sockets=[listener])))
    thread.start()
    try:
        wait_until(lambda: server.started)
        yield page, listener.getsockname()[1]
    finally:
        server.should_exit = True
        thread.join(20)
        subject.close()
        listener.close()


@contextmanager
def _no_signals() -> Iterator[None]:
    yield


def wait_until(condition: Callable[[], Any], seconds: float = 20.0) -> Any:
    """Return the first true value of a condition."""
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.02)
    return found


def get(
    port: int, path: str = "/", method: str = "GET", body: str = "", **headers: str
) -> tuple[int, dict[str, str], bytes]:
    """Return status, headers and body of a request; `Host` may be another one."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.request(method, path, body, headers)
    answer = connection.getresponse()
    found = answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read()
    connection.close()
    return found


@contextmanager
def browse(
    port: int, *, cookie: str = "", origin: str = "", session: str = "x"
) -> Iterator[ClientConnection]:
    """Yield a WebSocket as a browser opens it, after its greeting."""
    with connect(
        f"ws://127.0.0.1:{port}/socket",
        origin=Origin(origin or f"http://127.0.0.1:{port}"),
        additional_headers={"Cookie": cookie} if cookie else {},
        max_size=None,
        open_timeout=60,  # the page of a run answers when the run has begun
        compression=None,
    ) as socket:
        with suppress(ConnectionClosed):  # the caller reads why
            socket.send(json.dumps({"hello": {"session": session, "person": "Ada"}}))
        yield socket


def receive(socket: ClientConnection, kind: str, seconds: float = 20.0) -> dict[str, Any]:
    """Return the next message of a type."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        message: dict[str, Any] = json.loads(socket.recv(timeout=seconds))
        if message["type"] == kind:
            return message
    raise AssertionError(f"no {kind}")


def ask(socket: ClientConnection, name: str, **arguments: Any) -> dict[str, Any]:
    """Ask something of the run and return the answer."""
    socket.send(json.dumps({"ask": name, "arguments": arguments}))
    while True:
        answer = receive(socket, "answer")
        if answer["ask"] == name:
            return answer


class Command:
    """A command `rig` in the background, in a folder of its own, and the page it prints."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self._errors = folder, folder / "stderr.txt"
        with self._errors.open("w") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "rig", *arguments],
                cwd=folder,
                stdout=errors,
                stderr=errors,
            )

    def text(self) -> str:
        return self._errors.read_text()

    def url(self) -> str:
        found = wait_until(lambda: re.search(r"page: (http://\S+)", self.text()), 60)
        return str(found[1])

    def port(self) -> int:
        return int(self.url().rstrip("/").rpartition(":")[2])

    def page_process(self, seconds: float = 60.0) -> int:
        """Return the process of the page that the command started."""
        argument = f"--of-process\0{self.process.pid}\0".encode()

        def find() -> int:
            for each in Path("/proc").glob("[0-9]*/cmdline"):
                try:
                    if argument in each.read_bytes():
                        return int(each.parent.name)
                except OSError:
                    continue
            return 0

        return int(wait_until(find, seconds))

    def end(self) -> None:
        """End the command, whatever became of it, and its page."""
        self.process.kill()
        self.process.wait()
        with suppress(AssertionError, ProcessLookupError):
            os.kill(self.page_process(seconds=0.0), signal.SIGTERM)

    def run_folder(self) -> Path:
        return next(each for each in (self.folder / "runs").iterdir() if each.is_dir())

    def status(self) -> dict[str, Any]:
        return dict(json.loads((self.run_folder() / "run.json").read_text()))


CONFIGS = Path(__file__).resolve().parents[2] / "configs"
TWO_ROWS = """\
  list:
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0}
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 4000}
"""


def short_campaign(folder: Path, matrix: str = "") -> Path:
    """Write a campaign of two short rows, for a host that pauses now and then; return it.

    With a ``matrix`` (YAML) it has its rows, still shorter ones.
    """
    folder.mkdir(parents=True, exist_ok=True)
    limits, rig = CONFIGS / "limits" / "wavebot.yaml", CONFIGS / "rigs" / "wavebot.yaml"
    (folder / "limits.yaml").write_text(f"extends: {limits}\nloop: {{lost_ticks_stop: 9999}}\n")
    (folder / "rig.yaml").write_text(f"extends: {rig}\nlimits: limits.yaml\n")
    timing = "{settle_s: 1, interval_s: 3}" if matrix else "{settle_s: 2, interval_s: 6}"
    lines = (
        "name: quick",
        "rig: rig.yaml",
        "sea: {kind: regular, amplitude_m: 0.127, frequency_hz: 0.5}",
        "tare: {duration_s: 1}",
        "start: {set_point_s: 1, lead_in_s: 2}",
        f"timing: {timing}",
        "matrix:",
        matrix or TWO_ROWS,
    )
    campaign = folder / "quick.yaml"
    campaign.write_text("\n".join(lines))
    return campaign
