"""The process of the page: its address, its life, and its start beside a run."""

import asyncio
import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import uvicorn

from rig.page.access import Access
from rig.page.server import MAX_MESSAGE, Page
from rig.page.subject import Subject
from rig.people.request_client import RequestClient, RequestError
from rig.recording.runs import list_runs

PORT = 8765
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


def start_page(runs: Path) -> tuple[subprocess.Popen[bytes], str]:
    """Start the page of the run that this process begins in ``runs``; return it and its URL.

    The page is a process of its own: nothing that happens to it reaches the run.
    """
    listener = listen("127.0.0.1", 0)
    try:
        arguments = ["page", "--runs", str(runs), "--of-process", str(os.getpid())]
        process = subprocess.Popen(
            [sys.executable, "-m", "rig", *arguments, "--listener", str(listener.fileno())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(listener.fileno(),),
            start_new_session=True,  # Ctrl-C at the terminal is for the run
        )
        return process, address(listener)
    finally:
        listener.close()


def wait_for_run(runs: Path, process: int) -> Path:
    """Return the folder of the run of a process, once it listens; TimeoutError if none begins."""
    began = time.monotonic()
    while time.monotonic() - began < _RUN_TIMEOUT_S:
        for each in reversed(list_runs(runs)[-5:]):
            if each.status == "running" and _supervisor(each.path) == process:
                with suppress(RequestError):  # it does not listen yet
                    RequestClient(each.path).close()
                    return each.path
        try:
            os.kill(process, 0)
        except OSError:
            break
        time.sleep(0.2)
    raise TimeoutError(f"{runs}: no run of process {process} began")


def _supervisor(folder: Path) -> int:
    """Return the process that supervises a run."""
    with suppress(OSError, ValueError, KeyError):
        return int(json.loads((folder / "run.json").read_text())["pid"])
    return 0


def leave_the_loops_core() -> None:
    """Give way to the run: lower priority, and any core but the last, which is the loop's."""
    with suppress(OSError):
        os.nice(10)
        cores = sorted(os.sched_getaffinity(0))
        if len(cores) > 1:
            os.sched_setaffinity(0, cores[:-1])


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
