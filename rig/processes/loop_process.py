"""The loop process: read the job, connect the devices, run the loop, report its end.

The command names the package of the kind's tick and the module of its devices, so that this process
imports no other part of the kind. The supervisor sends a job on standard input and inherited file
descriptors. The process reports before the first tick and at the end. It ignores Ctrl-C, to which
the supervisor reacts, and treats a termination signal as an abort. The loop stops when the
supervisor is gone, or on the real clock when its heartbeat is too old (suspended, hung): nobody
could request a stop any more. On the virtual clock nothing moves, and a suspended rehearsal waits.
"""

import importlib
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from rig import laws
from rig.plug_ins import error_text
from rig.processes import handover
from rig.processes.io_process import ignore_terminal_signals
from rig.processes.last_logger import LastLogger
from rig.processes.mailbox import LoopMailbox
from rig.processes.messages import (
    CodeMissing,
    Compiled,
    LoopJob,
    LoopPrivileges,
    Refused,
    WireReport,
    report,
)
from rig.realtime import cycle, loop, safety, scheduling
from rig.realtime.clock import Clock, RealClock, VirtualClock, utc_of_zero
from rig.realtime.compiled_tick import EXCEPTION_TEXT, is_complete
from rig.realtime.coupled_ticks import Coupling
from rig.realtime.devices import Devices, FlatDevices
from rig.realtime.live_setpoints import live_columns
from rig.realtime.reasons import Reason
from rig.recording.ring import RingWriter

EXIT_ORPHANED = 76  # exit code: the supervisor was gone before the first tick
EXIT_NOT_READY = 78  # exit code: the devices do not answer
_ORPHANED_MESSAGE = (
    "`rig run` sent no heartbeat before the first tick (suspended, or a busy host): start it "
    "again; `rig doctor` checks the host"
)
EXIT_NO_PRIVILEGES = 77  # exit code: the host did not grant what the rig file requires


def main(tick: Any, device_module: Any) -> None:
    """Run the job on standard input for the package of a kind's tick and the module of its devices.

    `find_kind` of the package returns the kind of rig for the job's law; its `LawError` refuses the
    run. ``connect(config, dt)`` of the module returns the devices. For a job that is `coupled` they
    are `rig.emulation.in_process.CoupledDevices`, interpreted with "compiled": false.
    """
    ignore_terminal_signals()
    kind, job = _read_job(tick.find_kind, sys.stdin.read())
    mailbox = LoopMailbox(job.mailbox, job.live, live_columns(job.params))
    last_logger = LastLogger(job.logger[0] if job.logger else None, job.supervisor)
    terminated = False

    def abort(*_: object) -> None:
        nonlocal terminated
        terminated = True

    def external_request() -> int:
        if terminated:
            return safety.REQUEST_ABORT
        if os.getppid() != job.supervisor or (job.real_clock and supervisor_timed_out()):
            return safety.REQUEST_SUPERVISOR_LOST
        return safety.REQUEST_NONE

    def supervisor_timed_out() -> bool:
        heartbeat = mailbox.heartbeat()
        return heartbeat is not None and time.monotonic() - heartbeat > job.supervisor_timeout

    def must_not_wait() -> bool:
        if last_logger.ensure_logger():
            return False  # the logger will make room in the ring
        return external_request() != 0 or safety.stop_reason(mailbox.read().code) != 0

    signal.signal(signal.SIGTERM, abort)
    ring = RingWriter(
        job.ring, kind.row_type, wait=not job.real_clock, stop_requested=must_not_wait
    )
    end: loop.LoopResult | None = None
    try:
        try:
            devices, code, couple = _connect(tick.__name__, device_module, job)
        except OSError as error:
            _refuse(error)
        granted = _privileges(job)
        if granted is not None and granted.refused and job.realtime_required:
            report(LoopPrivileges((granted,)))
            _refuse(f"the host did not grant {', '.join(granted.refused)}", EXIT_NO_PRIVILEGES)
        if external_request() == safety.REQUEST_SUPERVISOR_LOST:  # while the devices started
            devices.stop(Reason.SUPERVISOR_LOST.value)
            devices.close()
            # A supervisor that was only suspended reads this later.
            _refuse(_ORPHANED_MESSAGE, EXIT_ORPHANED)
        try:
            devices.warm_up(job.dt)  # the last slow step before the first tick
        except OSError as error:
            devices.close()
            _refuse(error)
        clock: Clock = RealClock(job.dt) if job.real_clock else VirtualClock(job.dt)
        ring.start(utc_of_zero(clock))
        report(LoopPrivileges((granted,) if granted is not None else ()))
        end = loop.run(
            kind,
            job.params,
            devices,
            clock,
            ring,
            mailbox,
            external_request,
            measure_work=job.real_clock,
            code=code,
            couple=couple,
            on_compiled=lambda tick: report(Compiled(tick)),
        )
        report(end)
    finally:
        ring.finish()  # otherwise the logger would wait for rows that never come
        last_logger.save_remaining_rows(ring, end)
    # At the very end: a supervisor that does not read would block it.
    if isinstance(devices, FlatDevices) and (values := devices.wire_report()):
        report(WireReport(values))


def _read_job(find_kind: Callable[[str], cycle.Kind], text: str) -> tuple[cycle.Kind, LoopJob]:
    """Return the kind of rig for the job's law, and the job with the types of this kind."""
    try:
        kind = find_kind(handover.read_field(LoopJob, text, "law"))
    except laws.LawError as error:
        _refuse(error)
    return kind, handover.loads(LoopJob, text, rig=kind.params_type, **dict(kind.any_types))


def _connect(
    tick: str, module: Any, job: LoopJob
) -> tuple[Devices, Path | None, Callable[[], Coupling] | None]:
    """Return the devices, the folder of the compiled ticks, and the plant that is part of them.

    Report code that is missing.
    """
    if not (job.code or job.coupled):
        return module.connect(job.devices, job.dt), None, None
    folder, devices = Path(job.code), None
    if job.coupled:
        devices = module.connect(job.devices | {"compiled": False}, job.dt)
        try:
            folder = devices.coupled_source(tick, job.law, job.params).folder
        except (OSError, TypeError, ValueError) as error:  # as for the tick: it stays interpreted
            print(f"the tick runs interpreted, it has no source: {error}", file=sys.stderr)
            return devices, None, None
    missing = not is_complete(folder)
    if missing:
        report(CodeMissing())
    if devices is None or (missing and not job.compiles):
        # The compiled step of a plant alone: it takes less to compile, but more time in a tick.
        devices = module.connect(job.devices, job.dt)
    return devices, folder, devices.coupling if job.coupled else None


def _refuse(why: object, code: int = EXIT_NOT_READY) -> NoReturn:
    """Report the reason and exit before the first tick."""
    report(Refused(str(why)))
    sys.exit(code)


def _privileges(job: LoopJob) -> scheduling.Privileges | None:
    """Acquire real-time privileges; return None on the virtual clock, which must run without."""
    if job.real_clock:
        return scheduling.acquire()
    scheduling.freeze_garbage_collector()
    return None


def _failure_text(error: Exception) -> str:
    """Return an exception with file and line, those of a law if it was one that raised."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    paths = [each.f_code.co_filename for each in frames if each.f_globals.keys() >= laws.NAMES]
    if paths:
        return f"the law raised an exception: {error_text(error, paths[-1])}"
    if str(error) == EXCEPTION_TEXT:
        return f"{EXCEPTION_TEXT}; `rig run --interpreted` names its file and line"
    return error_text(error)


if __name__ == "__main__":
    try:
        main(*map(importlib.import_module, sys.argv[1:]))
    except Exception as error:  # noqa: BLE001  a law may raise anything
        traceback.print_exc()
        sys.exit(_failure_text(error))  # the last line, which the supervisor reads
