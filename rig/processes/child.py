"""Child processes that read a job from standard input and report events as JSON lines."""

import json
import queue
import signal
import subprocess
import threading
import time
from pathlib import Path
from typing import IO, Any

from rig.module_process import module_command


class Child:
    """A child process of the supervisor. Its standard error goes to a file in the run's folder."""

    def __init__(
        self, module: str, job: str, fds: tuple[int, ...], errors: Path, *arguments: str
    ) -> None:
        """Start ``python -m module`` with inherited file descriptors and send it the job."""
        self.events: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._errors = errors
        with errors.open("ab") as sink:
            self.process = subprocess.Popen(
                module_command(module, *arguments),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=sink,
                pass_fds=fds,
                text=True,
                process_group=0,  # Ctrl-C on the terminal reaches the supervisor only
            )
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(job)
            self.process.stdin.close()
        except BrokenPipeError:
            pass  # the process died at once; `last_message` gives the reason
        self._listener = threading.Thread(
            target=self._listen, args=(self.process.stdout,), daemon=True
        )
        self._listener.start()

    def _listen(self, lines: IO[str]) -> None:
        with lines:
            for line in lines:
                try:
                    event = json.loads(line)
                except ValueError:
                    continue  # printed by a library
                if isinstance(event, dict) and "event" in event:
                    self.events.put(event)

    def alive(self) -> bool:
        """Return whether the process still runs."""
        return self.process.poll() is None

    def read_events(self) -> list[dict[str, Any]]:
        """Return the events since the last call; after the process has ended, all that remain."""
        if not self.alive():
            self._listener.join(timeout=5.0)
        events = []
        while not self.events.empty():
            events.append(self.events.get())
        return events

    def end(self, timeout_s: float) -> None:
        """Wait ``timeout_s`` for the process to end, then kill it; read its last events."""
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
