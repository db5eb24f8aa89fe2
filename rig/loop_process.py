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
from typing import Any, NamedTuple, NoReturn

from rig import cycle, handover, loop, realtime, safety
from rig.clock import Clock, RealClock, VirtualClock, utc_of_zero
from rig.companion_process import leave_terminal_alone, say
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


ALONE = 76  # exit code: the supervisor was gone before the first tick
UNREADY = 78  # exit code: the devices are not there
REFUSED = 77  # exit code: the host did not grant what the rig file requires


def main(kind: cycle.Kind, connect: Callable[[Any, float], Devices]) -> None:
    """Run the job on standard input with the devices that ``connect(config, dt)`` makes."""
    leave_terminal_alone()
    job: Job = handover.loads(Job, sys.stdin.read(), rig=kind.params_type)
    mailbox = Mailbox(job.mailbox, Request)
    terminated = False

    def abort(*_: object) -> None:
        nonlocal terminated
        terminated = True

    def overseer() -> int:
        if terminated:
            return safety.REQUEST_ABORT
        return 0 if os.getppid() == job.supervisor else safety.REQUEST_SUPERVISOR_LOST

    def hurried() -> bool:
        mail = mailbox.read()
        return overseer() != 0 or (mail is not None and mail.request != safety.REQUEST_NONE)

    signal.signal(signal.SIGTERM, abort)
    ring = Writer(job.ring, kind.row_type, wait=job.real_clock == 0, hurried=hurried)
    try:
        try:
            devices = connect(json.loads(job.devices), job.dt)
        except OSError as error:
            _refuse(error)
        granted = _privileges(job)
        if granted is not None and granted.refused and job.realtime_required == 1:
            say(event="refused", privileges=granted._asdict())
            sys.exit(REFUSED)
        if overseer() == safety.REQUEST_SUPERVISOR_LOST:  # while the devices came up
            devices.stop(safety.Reason.SUPERVISOR_LOST.value)
            devices.close()
            sys.exit(ALONE)
        try:
            devices.warm_up(job.dt)  # whatever takes its time has been done
        except OSError as error:
            devices.close()
            _refuse(error)
        clock: Clock = RealClock(job.dt) if job.real_clock == 1 else VirtualClock(job.dt)
        ring.start(utc_of_zero(clock))
        say(event="start", privileges=granted and granted._asdict())
        end = loop.run(
            kind,
            job.params,
            devices,
            clock,
            ring,
            mailbox,
            overseer,
            measure_work=job.real_clock == 1,
        )
    finally:
        ring.finish()  # or the logger would wait for rows that never come
    say(event="end", ticks=end.ticks, skipped=end.skipped, reason=end.reason)


def _refuse(error: OSError) -> NoReturn:
    """End before the first tick, and say why."""
    say(event="refused", why=str(error))
    sys.exit(UNREADY)


def _privileges(job: Job) -> realtime.Privileges | None:
    """Ask for what the clock needs; None on the virtual clock, which must not be given it."""
    if job.real_clock == 1:
        return realtime.acquire()
    realtime.quiet_memory()
    return None
