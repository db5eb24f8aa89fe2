"""What every loop process does besides its devices: take the job, tick, say how it ended.

The supervisor hands a job over on standard input and inherited file descriptors; the process
answers with one JSON line when it is about to tick and one at the end. It ignores Ctrl-C (the
supervisor decides what that means) and takes a termination as an abort. A supervisor that is gone,
or on the real clock has shown no sign of life for too long (suspended, hung), is a stop: nobody
could ask for one any more. On the virtual clock nothing moves, and a suspended rehearsal waits.
"""

import json
import os
import signal
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn

from rig.processes import handover
from rig.processes.io_process import leave_terminal_alone, report
from rig.processes.last_logger import LastLogger
from rig.processes.mailbox import Mailbox, Request
from rig.realtime import cycle, loop, safety, scheduling
from rig.realtime.clock import Clock, RealClock, VirtualClock, utc_of_zero
from rig.realtime.devices import Devices
from rig.recording.ring import RingWriter


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
    supervisor_timeout: float  # s without a sign of life of the supervisor that are a stop
    last_logger: str = (
        ""  # JSON for `rig.processes.last_logger`; empty: rows that nobody saves are lost
    )


ALONE = 76  # exit code: the supervisor was gone before the first tick
UNREADY = 78  # exit code: the devices are not there
_ALONE = (
    "`rig run` gave no sign of life before the first tick (suspended, or a busy host): start it "
    "again; `rig doctor` looks at the host"
)
REFUSED = 77  # exit code: the host did not grant what the rig file requires


def main(kind: cycle.Kind, connect: Callable[[Any, float], Devices]) -> None:
    """Run the job on standard input with the devices that ``connect(config, dt)`` makes."""
    leave_terminal_alone()
    job: Job = handover.loads(Job, sys.stdin.read(), rig=kind.params_type)
    mailbox = Mailbox(job.mailbox, Request)
    last = LastLogger(job.last_logger, job.supervisor)
    terminated = False

    def abort(*_: object) -> None:
        nonlocal terminated
        terminated = True

    def overseer() -> int:
        if terminated:
            return safety.REQUEST_ABORT
        if os.getppid() != job.supervisor or (job.real_clock == 1 and silent()):
            return safety.REQUEST_SUPERVISOR_LOST
        return safety.REQUEST_NONE

    def silent() -> bool:
        mail = mailbox.read()
        return mail is not None and time.monotonic() - mail.heartbeat > job.supervisor_timeout

    def hurried() -> bool:
        mail = mailbox.read()
        if last.helps():
            return False  # there will be room
        return overseer() != 0 or (mail is not None and mail.request != safety.REQUEST_NONE)

    signal.signal(signal.SIGTERM, abort)
    ring = RingWriter(job.ring, kind.row_type, wait=job.real_clock == 0, stop_requested=hurried)
    end: loop.LoopResult | None = None
    try:
        try:
            devices = connect(json.loads(job.devices), job.dt)
        except OSError as error:
            _refuse(error)
        granted = _privileges(job)
        if granted is not None and granted.refused and job.realtime_required == 1:
            report(event="refused", privileges=granted._asdict())
            sys.exit(REFUSED)
        if overseer() == safety.REQUEST_SUPERVISOR_LOST:  # while the devices came up
            devices.stop(safety.Reason.SUPERVISOR_LOST.value)
            devices.close()
            report(event="refused", why=_ALONE)  # heard if it was suspended only
            sys.exit(ALONE)
        try:
            devices.warm_up(job.dt)  # whatever takes its time has been done
        except OSError as error:
            devices.close()
            _refuse(error)
        clock: Clock = RealClock(job.dt) if job.real_clock == 1 else VirtualClock(job.dt)
        ring.start(utc_of_zero(clock))
        report(event="start", privileges=granted and granted._asdict())
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
        report(event="end", ticks=end.ticks, skipped=end.skipped, reason=end.reason)
    finally:
        ring.finish()  # or the logger would wait for rows that never come
        last.see_out(ring, end)


def _refuse(error: OSError) -> NoReturn:
    """End before the first tick, and say why."""
    report(event="refused", why=str(error))
    sys.exit(UNREADY)


def _privileges(job: Job) -> scheduling.Privileges | None:
    """Ask for what the clock needs; None on the virtual clock, which must not be given it."""
    if job.real_clock == 1:
        return scheduling.acquire()
    scheduling.freeze_garbage_collector()
    return None
