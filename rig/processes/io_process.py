"""The part that all I/O processes share: read the job, end with the loop.

An I/O process outlives the loop,
never the other way round: a loop whose supervisor was killed still needs its wires to bring the rig
to rest. An I/O process therefore ends when it is terminated or when the loop has ended. It detects
the end of the loop by a pipe, the lifeline, whose other end only the loop holds (before the loop
has started: the supervisor).
"""

import select
import signal
import sys
from collections.abc import Callable

from drivers.errors import CodecError
from rig.processes import handover
from rig.processes.messages import IoJob, Notice, Refused, report
from rig.realtime import scheduling


def ignore_terminal_signals() -> None:
    """Ignore Ctrl-C and a closed terminal: the supervisor alone reacts to them."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


def run_io_process(serve: Callable[[IoJob], None], *, prioritised: bool = True) -> None:
    """Read a job from standard input and pass it to ``serve``; report the error of a device.

    ``prioritised``: at a priority above ordinary work.
    """
    ignore_terminal_signals()
    job = handover.loads(IoJob, sys.stdin.read())
    if prioritised and (refused := scheduling.acquire_for_io()):
        report(Notice(f"no priority over other work: {refused}"))
    try:
        serve(job)
    except (OSError, CodecError) as error:
        report(Refused(str(error)))
        raise


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
