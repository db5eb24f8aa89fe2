"""The process of the page: its address, its life, and its start beside a run."""

import asyncio
import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO

import uvicorn

from rig.page.access import Access
from rig.page.server import MAX_MESSAGE, Page
from rig.page.subject import Subject
from rig.people.request_client import RequestClient, RequestError
from rig.recording.runs.folder import SOCKET, STATUS

PORT = 8765
ERRORS = "page.stderr"  # in the run's folder
_UNREAD_MS = 15_000
_IDLE_END_S = 60.0  # s without a browser until the page of an ended run ends
_RUN_TIMEOUT_S = 600.0  # s for a run to begin: its code may be compiled first


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket; on any free port if that of ``port`` 0 is taken.

    OSError if the address cannot be had.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for number in (port,) if port else (PORT, 0):
        listener = socket.socket(family, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # Connections inherit it: the kernel ends one whose browser does not read any more.
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNREAD_MS)
        try:
            listener.bind((host, number))
            listener.listen(128)
        except OSError:
            listener.close()
            if number in (port, 0):
                raise
        else:
            return listener
    raise OSError("no free port")


def address(listener: socket.socket) -> str:
    """Return the URL of a listening socket."""
    host, port = listener.getsockname()[:2]
    return f"http://{f'[{host}]' if ':' in host else host}:{port}/"


class PageOfRun:
    """The page of the run that this process begins: a process of its own.

    Nothing that happens to it reaches the run. It learns the run's folder from its input.
    """

    def __init__(self, runs: Path, before: "PageOfRun | None" = None) -> None:
        """Start it for a run in the folder ``runs``; OSError if that is impossible.

        ``before``: the page of the stage before, which ends; browsers find this one in its place.
        """
        runs.mkdir(parents=True, exist_ok=True)
        self.port = before.end() if before is not None else 0
        listener = listen("127.0.0.1", self.port)
        self._errors = runs / f".page_{os.getpid()}.stderr"  # until the run has a folder
        self._settled = threading.Event()  # it has one, or gets none
        self._is_replaced = False  # by the page of the next stage
        arguments = ["page", "--of-process", str(os.getpid()), "--listener", str(listener.fileno())]
        try:
            with self._errors.open("wb") as errors:
                self._process = subprocess.Popen(
                    [sys.executable, "-m", "rig", *arguments],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=errors,
                    pass_fds=(listener.fileno(),),
                    start_new_session=True,  # Ctrl-C at the terminal is for the run
                )
            self.url, self.port = address(listener), listener.getsockname()[1]
        finally:
            listener.close()

    def run_began(self, folder: Path) -> None:
        """Tell the page the folder of its run, which gets the page's error output, too."""
        with suppress(OSError):
            self._errors = self._errors.replace(folder / ERRORS)
        self._settled.set()
        assert self._process.stdin is not None
        with suppress(OSError):  # it is gone: `failure` says why
            self._process.stdin.write(os.fsencode(folder.absolute()) + b"\n")
            self._process.stdin.flush()

    def end(self) -> int:
        """End the page at once; return its port."""
        self._is_replaced = True
        self._process.terminate()
        self._process.wait()
        return self.port

    def failure(self) -> str:
        """Wait for the end of the page; return why it failed in one line.

        Empty if it did not fail, or if no run began.
        """
        code = self._process.wait()
        self._settled.wait()
        if code == 0 or self._is_replaced or self._errors.name != ERRORS:
            return ""
        lines = self._errors.read_text(errors="replace").strip().splitlines() or [f"code {code}"]
        return f"the page ended: {lines[-1]} ({self._errors})"

    def close(self) -> None:
        """Leave the page alone; one whose run never began ends, too."""
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.close()
        if self._errors.name != ERRORS:
            self._errors.unlink(missing_ok=True)
        self._settled.set()


def wait_for_run(source: IO[bytes]) -> Path:
    """Return the folder of the run that began this page, once it listens.

    The folder comes from ``source``, the page's input. TimeoutError if no run begins.
    """
    folder = Path(os.fsdecode(source.readline().rstrip(b"\n")))
    end = time.monotonic() + _RUN_TIMEOUT_S
    while folder.is_absolute() and time.monotonic() < end:
        if (folder / SOCKET).exists():
            with suppress(RequestError):  # it does not listen yet
                RequestClient(folder).close()
                return folder
        if ended := read_status(folder):
            raise TimeoutError(f"{folder}: the run is {ended} already")
        time.sleep(0.1)
    raise TimeoutError("no run began")


def read_status(folder: Path) -> str:
    """Return the status of a run that has ended; empty while it has not."""
    with suppress(OSError, ValueError, KeyError):
        status = str(json.loads((folder / STATUS).read_text())["status"])
        return "" if status == "running" else status
    return ""


def serve(subject: Subject, access: Access, listener: socket.socket, *, ends: bool) -> None:
    """Serve the page until it is interrupted; with ``ends`` until run and browsers are gone."""
    page = Page(subject, access)
    config = uvicorn.Config(
        page.app,
        log_level="error",
        ws="websockets-sansio",
        ws_max_size=4 * MAX_MESSAGE,
        proxy_headers=False,
        server_header=False,
        timeout_graceful_shutdown=2,
    )
    server = uvicorn.Server(config)

    async def run() -> None:
        watching = asyncio.create_task(_end_when_idle(server, page, subject)) if ends else None
        await server.serve(sockets=[listener])
        if watching is not None:
            watching.cancel()

    asyncio.run(run())


async def _end_when_idle(server: uvicorn.Server, page: Page, subject: Subject) -> None:
    await _idle(lambda: subject.tap.status()["ended"] and not page.browsers)
    server.should_exit = True


async def _idle(is_idle: Callable[[], bool]) -> None:
    """Return after a minute without anybody."""
    since = time.monotonic()
    while time.monotonic() - since < _IDLE_END_S:
        if not is_idle():
            since = time.monotonic()
        await asyncio.sleep(1.0)
