"""The loop: the only place that ticks."""

import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from rig.processes.mailbox import Mailbox
from rig.realtime import cycle
from rig.realtime.clock import Clock
from rig.realtime.devices import Devices
from rig.realtime.safety import STOP_0, Reason
from rig.recording.ring import Writer

STOPS = 5  # how often the stop is repeated at the end: one lost frame must not matter
LINGER = 20  # ticks logged after power was removed, so that the record shows it
WATCH = 0.05  # s of ticks between looks at what comes from outside the mailbox


class End(NamedTuple):
    """How the loop ended."""

    ticks: int  # executed
    skipped: int  # periods lost
    reason: int  # rig.realtime.safety.Reason


def run(
    kind: cycle.Kind,
    params: cycle.Params,
    devices: Devices,
    clock: Clock,
    ring: Writer,
    mailbox: Mailbox,
    overseer: Callable[[], int],
    *,
    measure_work: bool,
) -> End:
    """Tick until the safety machine has removed the power, then a few ticks more.

    Every way out of here, an exception included, ends in repeated stops: when this returns or
    raises, the last thing every device was told is to stop. ``overseer`` is asked now and then for
    a request that does not come by mailbox (supervisor lost, process terminated).
    ``measure_work``: log how long each tick took (real clock only, so that rehearsals repeat to
    the bit).
    """
    step = cycle.make(kind)
    reason = Reason.EXCEPTION.value
    try:
        state = cycle.start(kind, params, 0)
        ticks = skipped = linger = imposed = 0
        work, dt = 0.0, clock.dt
        timing = cycle.Timing(0.0, 0.0, 0)
        watch = max(1, round(WATCH / dt))
        while linger < LINGER:
            tick, now, periods, lateness = clock.wait_next()
            began = time.perf_counter() if measure_work else 0.0
            ticks += 1
            skipped += periods - 1
            if ticks % watch == 0:
                imposed = overseer()
            mail = mailbox.read()
            request = imposed or (0 if mail is None else mail.request)

            sense = devices.read(now)
            if measure_work or periods != 1:  # else it is what it was
                timing = cycle.Timing(lateness, work, skipped)
            state, command, row = step(params, state, sense, request, tick, timing, periods, dt)
            devices.write(command)
            ring.put(row)

            if state.safety.mode == STOP_0:
                linger += 1
            work = time.perf_counter() - began if measure_work else 0.0
        reason = state.safety.reason
        return End(ticks, skipped, reason)
    finally:
        try:
            for _ in range(STOPS):
                with suppress(Exception):  # it must not raise; if it does, the others still count
                    devices.stop(reason)
        finally:
            ring.finish()
            devices.close()
