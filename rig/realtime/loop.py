"""The control loop: the only code that ticks."""

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from rig.realtime import cycle
from rig.realtime.clock import Clock
from rig.realtime.coupled_ticks import CoupledChangeover, CoupledTicks, Coupling
from rig.realtime.devices import Devices
from rig.realtime.reasons import Reason
from rig.realtime.requests import NO_REQUEST, Request, RequestSource
from rig.realtime.safety import STOP_0
from rig.realtime.tick import Changeover, InterpretedTick, RowSink, Tick

STOP_REPEATS = 5  # repetitions of the stop at the end, so that one lost frame does not matter
LINGER_TICKS = 20  # ticks logged after power was removed, so that the record shows it
EXTERNAL_REQUEST_INTERVAL = 0.05  # s of ticks between calls of ``external_request``


class LoopResult(NamedTuple):
    """The end of a loop."""

    ticks: int  # executed
    skipped: int  # periods lost
    reason: int  # `rig.realtime.reasons`
    compiled_from: int = -1  # first tick that ran compiled; -1: all ran interpreted
    code_problem: str = ""  # why code that is there was not used


def run(
    kind: cycle.Kind,
    params: cycle.Params,
    devices: Devices,
    clock: Clock,
    ring: RowSink,
    requests: RequestSource,
    external_request: Callable[[], int],
    *,
    measure_work: bool,
    code: Path | None = None,
    couple: Callable[[], Coupling] | None = None,
    on_compiled: Callable[[int], None] = lambda tick: None,
) -> LoopResult:
    """Run ticks until the safety machine has removed the power, then `LINGER_TICKS` more.

    When this function returns or raises, the last command to every device is a stop, repeated. The
    loop calls ``external_request`` every `EXTERNAL_REQUEST_INTERVAL` for a request that does not
    come by mailbox (supervisor lost, process terminated). ``measure_work``: log how long each tick
    took (real clock only, so that rehearsals repeat bit for bit). ``code``: folder where the code
    of the compiled tick is or will be; without one the tick stays interpreted. ``couple`` returns
    the simulated plant, on the virtual clock: then the code is that of loop and plant together.
    ``on_compiled`` is called before the first compiled tick.
    """
    reason = Reason.EXCEPTION.value

    try:
        work, dt = 0.0, clock.dt
        interpreted = InterpretedTick(kind, params, dt, ring)
        execution: Tick = interpreted
        reader = _RequestReader(
            requests, execution, lambda: not external_request() and clock.stands_still()
        )
        exchange = execution.connect(devices, clock)
        if correction := getattr(devices, "clock_correction", None):
            clock.follow(correction)
        changeover: Changeover | CoupledChangeover | None = None
        if code:
            changeover = (
                CoupledChangeover(code, couple, dt, ring, interpreted)
                if couple
                else Changeover(code, kind, params, dt, ring, interpreted)
            )
        ticks = skipped = linger = external = 0
        compiled_from, problem = -1, ""
        timing = cycle.Timing(0.0, 0.0, 0)
        request_ticks = max(1, round(EXTERNAL_REQUEST_INTERVAL / dt))
        while linger < LINGER_TICKS:
            tick, now, periods, lateness = clock.wait_next()
            began = time.perf_counter() if measure_work else 0.0
            ticks += 1
            skipped += periods - 1
            if ticks % request_ticks == 0:
                external = external_request()
            request = reader.read(external)
            if measure_work or periods != 1:  # otherwise the timing has not changed
                timing = cycle.Timing(lateness, work, skipped)
            exchange(now, request, tick, timing, periods)
            execution.log()

            if execution.mode == STOP_0:
                linger += 1
            elif changeover and (found := changeover.advance()) is not None:
                if not (problem := changeover.problem):
                    on_compiled(compiled_from := tick + 1)
                reader.execution = found
                if isinstance(found, CoupledTicks):
                    ticks += _execute_to_end(
                        found, tick + 1, request_ticks, lambda: reader.read(external_request())
                    )
                    reason = found.reason
                    return LoopResult(ticks, skipped, reason, compiled_from)
                execution, exchange, changeover = found, found.connect(devices, clock), None
            work = time.perf_counter() - began if measure_work else 0.0
        reason = execution.reason
        return LoopResult(ticks, skipped, reason, compiled_from, problem)
    finally:
        try:
            for _ in range(STOP_REPEATS):
                with suppress(Exception):  # stop must not raise; if it does, repeat it all the same
                    devices.stop(reason)
        finally:
            ring.finish()
            devices.close()


class _RequestReader:
    """Reads the requests before a tick, and stores set points that people chose."""

    def __init__(
        self,
        source: RequestSource,
        execution: Tick | CoupledTicks,
        stands_still: Callable[[], bool] = lambda: False,
    ) -> None:
        """``stands_still``: of the clock, while the next row is being chosen."""
        self._source, self.execution, self._stands_still = source, execution, stands_still
        self._last = NO_REQUEST
        self._live = 0  # number of the set point in the last request

    def read(self, external: int) -> Request:
        """Return the requests in force; ``external``: a code that overrides them, or 0."""
        request = self._source.read()
        while request == self._last and self.execution.awaits_choice and self._stands_still():
            request = self._source.read()
        self._last = request
        if request.live != self._live:
            numbers = self._source.live_numbers(request.live) if request.live else None
            if numbers is not None:
                self.execution.set_live(request.live, numbers)
            elif request.live:  # not there yet: keep the one before
                request = request._replace(live=self._live)
            self._live = request.live
        return request._replace(code=external) if external else request


def _execute_to_end(
    coupled: CoupledTicks, tick: int, most: int, get_request: Callable[[], Request]
) -> int:
    """Execute ticks from ``tick`` on, to the end as `run` does; return their number.

    ``get_request`` is called every ``most`` ticks.
    """
    first, linger = tick, 0
    while linger < LINGER_TICKS:
        tick += coupled.execute(tick, get_request(), most)
        linger += coupled.mode == STOP_0  # which ends a chunk
    return tick - first
