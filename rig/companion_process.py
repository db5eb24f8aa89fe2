"""What every companion process does besides its own work: take the job, answer, know when to end.

The supervisor hands a job over on standard input and hears JSON lines; a companion ends when it is
told to, or when it is left alone.
"""

import json
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any


def say(**event: Any) -> None:
    """One line for the supervisor; if it is gone, that is found out elsewhere."""
    with suppress(BrokenPipeError):
        print(json.dumps(event), flush=True)


def leave_terminal_alone() -> None:
    """Ctrl-C and a closed terminal are meant for the supervisor, who decides what they mean."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


def run(serve: Callable[[dict[str, Any]], None]) -> None:
    """Serve the job on standard input."""
    leave_terminal_alone()
    serve(json.loads(sys.stdin.read()))


def until_ended(supervisor: int) -> Callable[[], bool]:
    """Give what tells whether it is time to end: terminated, or the supervisor is gone."""
    terminated = False

    def end(*_: object) -> None:
        nonlocal terminated
        terminated = True

    signal.signal(signal.SIGTERM, end)
    return lambda: terminated or os.getppid() != supervisor
