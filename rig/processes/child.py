"""Child processes of the supervisor, which read a job and send reports."""

import queue
import signal
import subprocess
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

from rig.module_process import module_command
from rig.processes.handover import HandoverError
from rig.processes.messages import Report, read_report


def start_process(
    module: str,
    job: str,
    fds: tuple[int, ...],
    errors: Path,
    *arguments: str,
    stdout: int = subprocess.DEVNULL,
) -> "subprocess.Popen[str]":
    """Start ``python -m module`` with inherited file descriptors and send it the job.

    Its standard error is appended to the file ``errors``.
    """
    with errors.open("ab") as sink:
        process = subprocess.Popen(
            module_command(module, *arguments),
            stdin=subprocess.PIPE,
            stdout=stdout,
            stderr=sink,
            pass_fds=fds,
            text=True,
            process_group=0,  # Ctrl-C on the terminal reaches the supervisor only
        )
    assert process.stdin is not None
    # A process that died at once breaks the pipe; `Child.last_message` gives the reason.
    with suppress(BrokenPipeError), process.stdin:
        process.stdin.write(job)
    return process


class Child:
    """A child process of the supervisor. Its standard error goes to a file in the run's folder."""

    def __init__(
        self, module: str, job: str, fds: tuple[int, ...], errors: Path, *arguments: str
    ) -> None:
        """Start ``python -m module`` with inherited file descriptors and send it the job."""
        self._reports: queue.SimpleQueue[Report] = queue.SimpleQueue()
        self._errors = errors
        self.process = start_process(module, job, fds, errors, *arguments, stdout=subprocess.PIPE)
        self._listener = threading.Thread(
            target=self._listen, args=(self.process.stdout,), daemon=True
        )
        self._listener.start()

    def _listen(self, lines: IO[str]) -> None:
        with lines:
            for line in lines:
                if not line.endswith("\n"):
                    return  # cut off: the process was killed
                try:
                    report = read_report(line)
                except HandoverError as error:
                    # So that `last_message` gives it; the folder may be deleted, the disk full.
                    with suppress(OSError), self._errors.open("a") as sink:
                        sink.write(f"its report cannot be read: {error}\n")
                else:
                    if report is not None:
                        self._reports.put(report)

    def alive(self) -> bool:
        """Return whether the process still runs."""
        return self.process.poll() is None

    def read_reports(self) -> list[Report]:
        """Return the reports since the last call; after the process has ended, all that remain."""
        if not self.alive():
            self._listener.join(timeout=5.0)
        reports = []
        while not self._reports.empty():
            reports.append(self._reports.get())
        return reports

    def end(self, timeout_s: float) -> None:
        """Wait ``timeout_s`` for the process to end, then kill it; receive its last reports."""
        try:
            self.process.wait(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._listener.join(timeout=5.0)

    def last_message(self) -> str:
        """Return the last line of the process's error file, or its signal or exit code."""
        text = self._errors.read_text(errors="replace").strip() if self._errors.exists() else ""
        if text:
            return text.splitlines()[-1]
        code = self.process.returncode
        if code is not None and code < 0:
            return f"killed by {_signal_name(-code)}"
        return f"exit code {code}"


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # a real-time signal other than SIGRTMIN and SIGRTMAX, which have names
        return f"signal {number}"


class StallTimer:
    """Measures for how long a counter has not changed."""

    def __init__(self) -> None:
        self._value = -1
        self._since = time.monotonic()

    def seconds_unchanged(self, value: int) -> float:
        """Return the seconds since the counter last changed."""
        if value != self._value:
            self._value, self._since = value, time.monotonic()
        return time.monotonic() - self._since
