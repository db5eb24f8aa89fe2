"""The part that all I/O processes share: read the job, report events, end with the loop.

The supervisor sends a job on standard input and reads JSON lines. An I/O process outlives the loop,
never the other way round: a loop whose supervisor was killed still needs its wires to bring the rig
to rest. An I/O process therefore ends when it is terminated or when the loop has ended. It detects
the end of the loop by a pipe, the lifeline, whose other end only the loop holds (before the loop
has started: the supervisor).
"""

import json
import select
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any


def report_event(**event: Any) -> None:
    """Print one JSON line for the supervisor. A supervisor that is gone is detected elsewhere."""
    with suppress(BrokenPipeError):
        print(json.dumps(event), flush=True)


def ignore_terminal_signals() -> None:
    """Ignore Ctrl-C and a closed terminal: the supervisor alone reacts to them."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


def run_io_process(serve: Callable[[dict[str, Any]], None]) -> None:
    """Read a job from standard input and pass it to ``serve``."""
    ignore_terminal_signals()
    serve(json.loads(sys.stdin.read()))


def end_condition(lifeline: int) -> Callable[[], bool]:
    """Return a function that is true once the process was terminated or the loop has ended.

    ``lifeline``: descriptor of the pipe's reading end; nothing is ever written into the pipe.
    """
    terminated = False
    hung_up = select.poll()
    hung_up.register(lifeline, 0)

    def end(*_: object) -> None:
        nonlocal terminated
        terminated = True

    signal.signal(signal.SIGTERM, end)
    return lambda: terminated or bool(hung_up.poll(0))
