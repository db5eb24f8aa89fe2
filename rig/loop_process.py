"""What every loop process does besides its devices: take the job, tick, say how it ended.

The supervisor hands a job over on standard input and inherited file descriptors; the process
answers with one JSON line when it is about to tick and one at the end. It ignores Ctrl-C (the
supervisor decides what that means) and takes a termination as an abort.
"""

import json
import os
import signal
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

from rig import cycle, handover, loop, realtime, safety
from rig.clock import Clock, RealClock, VirtualClock
from rig.devices import Devices
from rig.mailbox import Mailbox, Request
from rig.ring import Writer


class Job(NamedTuple):
    """What the supervisor asks of the loop process."""

    real_clock: int  # 1: real time, 0: virtual
    realtime_required: int  # 1: refuse to run without every privilege
    dt: float  # s
    ring: int  # file descriptor
    mailbox: int  # file descriptor
    supervisor: int  # process id
    params: cycle.Params
    devices: str  # JSON for whoever makes the devices


REFUSED = 77  # exit code: the host did not grant what the rig file requires


def main(kind: cycle.Kind, connect: Callable[[Any, float], Devices]) -> None:
    """Run the job on standard input with the devices that ``connect(config, dt)`` makes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    job: Job = handover.loads(Job, sys.stdin.read(), rig=kind.params_type)
    mailbox = Mailbox(job.mailbox, Request)
    devices = connect(json.loads(job.devices), job.dt)
    ring = Writer(job.ring, kind.row_type, wait=job.real_clock == 0)
    if job.real_clock == 1:
        granted = realtime.acquire()
        if granted.refused and job.realtime_required == 1:
            _say(event="refused", privileges=granted._asdict())
            ring.finish()
            sys.exit(REFUSED)
        _say(event="start", privileges=granted._asdict())
    else:
        realtime.quiet_memory()
        _say(event="start", privileges=None)

    terminated = False

    def abort(*_: object) -> None:
        nonlocal terminated
        terminated = True

    signal.signal(signal.SIGTERM, abort)

    def supervised() -> int:
        if terminated:
            return safety.REQUEST_ABORT
        return 0 if os.getppid() == job.supervisor else safety.REQUEST_SUPERVISOR_LOST

    clock: Clock = RealClock(job.dt) if job.real_clock == 1 else VirtualClock(job.dt)
    end = loop.run(
        kind,
        job.params,
        devices,
        clock,
        ring,
        mailbox,
        supervised,
        measure_work=job.real_clock == 1,
    )
    _say(event="end", ticks=end.ticks, skipped=end.skipped, reason=end.reason)


def _say(**event: Any) -> None:
    print(json.dumps(event), flush=True)
