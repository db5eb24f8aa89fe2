"""A process that takes a job on standard input and answers in JSON lines."""

import json
import queue
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import IO, Any


class Child:
    """A child of the supervisor; its errors go to a file of the run's folder."""

    def __init__(self, module: str, job: str, fds: tuple[int, ...], errors: Path) -> None:
        """Start ``python -m module`` with inherited file descriptors and hand it the job."""
        self.events: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._errors = errors
        with errors.open("ab") as sink:
            self.process = subprocess.Popen(
                [sys.executable, "-m", module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=sink,
                pass_fds=fds,
                text=True,
                process_group=0,  # a Ctrl-C on the terminal is the supervisor's alone
            )
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(job)
            self.process.stdin.close()
        except BrokenPipeError:
            pass  # it died at once: its exit code and its last words tell why
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
                    continue  # a library's print, not ours
                if isinstance(event, dict) and "event" in event:
                    self.events.put(event)

    def alive(self) -> bool:
        """Whether the process still runs."""
        return self.process.poll() is None

    def heard(self) -> list[dict[str, Any]]:
        """Events since the last call; after the process has ended, all of them."""
        if not self.alive():
            self._listener.join(timeout=5.0)
        found = []
        while not self.events.empty():
            found.append(self.events.get())
        return found

    def end(self, patience: float) -> None:
        """Wait ``patience`` seconds for the process to end, then kill it; take in what it said."""
        try:
            self.process.wait(timeout=patience)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._listener.join(timeout=5.0)

    def last_message(self) -> str:
        """The last line the process wrote to its error file, or its signal or exit code."""
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
    except ValueError:  # a real-time signal between the two that have names
        return f"signal {number}"


class Progress:
    """How long a counter has stood still."""

    def __init__(self) -> None:
        self._value = -1
        self._since = time.monotonic()

    def still(self, value: int) -> float:
        """Seconds since the counter last changed."""
        if value != self._value:
            self._value, self._since = value, time.monotonic()
        return time.monotonic() - self._since
