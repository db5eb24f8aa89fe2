"""What every I/O process does besides its own work: take the job, answer, know when to end.

The supervisor hands a job over on standard input and reads JSON lines. An I/O process outlives the
loop, never the other way round: a loop whose supervisor was killed still needs its wires to bring
the rig to rest. So it ends when it is terminated, or when the loop has ended. It sees the latter by
a pipe whose other end only the loop holds (before the loop is there: the supervisor).
"""

import json
import select
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any


def report(**event: Any) -> None:
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


def until_ended(lifeline: int) -> Callable[[], bool]:
    """Return a function that is true when it is time to end: terminated, or the loop has ended.

    ``lifeline``: descriptor of the pipe's reading end; nothing is ever written into it.
    """
    terminated = False
    hung_up = select.poll()
    hung_up.register(lifeline, 0)

    def end(*_: object) -> None:
        nonlocal terminated
        terminated = True

    signal.signal(signal.SIGTERM, end)
    return lambda: terminated or bool(hung_up.poll(0))
