"""The supervisor's side of the compiler: whether it runs beside a run."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rig.processes import tick_compiler
from rig.processes.tick_compiler import TickCompiler


@pytest.fixture(name="compiler")
def of_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> TickCompiler:
    monkeypatch.setattr(tick_compiler, "compile_job", lambda *_: None)
    monkeypatch.setattr(tick_compiler.handover, "dumps", lambda _: "")
    segments = SimpleNamespace(ticks=[1_000_000])
    task: Any = SimpleNamespace(tick="t", params=SimpleNamespace(segments=segments), dt=1e-3)
    mode: Any = SimpleNamespace(coupled=True, real_clock=False)
    return TickCompiler(task, mode, tmp_path / "errors")


def wait_until_ended(compiler: TickCompiler) -> None:
    end = time.monotonic() + 30.0
    while compiler.running and time.monotonic() < end:
        time.sleep(0.01)


def test_it_runs_from_its_start_to_the_end_of_its_process(
    compiler: TickCompiler, monkeypatch: pytest.MonkeyPatch
) -> None:
    may_start = threading.Event()

    def start(*_: object) -> subprocess.Popen[str]:
        may_start.wait(30.0)
        command = [sys.executable, "-c", "input()"]
        return subprocess.Popen(command, stdin=subprocess.PIPE, text=True)

    monkeypatch.setattr(tick_compiler, "start_process", start)
    assert not compiler.running
    compiler.start()
    assert compiler.running  # the process is not there yet
    may_start.set()
    assert compiler._thread is not None
    compiler._thread.join()
    assert compiler.running
    assert compiler._process is not None
    compiler._process.communicate("\n")
    wait_until_ended(compiler)
    assert not compiler.running
    compiler.end()


def test_a_process_that_cannot_start_does_not_run(
    compiler: TickCompiler, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> subprocess.Popen[str]:
        raise OSError("no more processes")

    monkeypatch.setattr(tick_compiler, "start_process", refuse)
    compiler.start()
    wait_until_ended(compiler)
    assert not compiler.running
