"""Run faults of a table on the real processes: loop, I/O processes and emulated devices.

One process of emulated devices serves many runs; before each run the simulated rig is brought to
rest and the nodes are switched on again. A run tares, and the fault is injected when the motors
have had power for `ONSET_DELAY`, or when the body or shaft moves fast.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

from rig.emulation.control_client import ControlClient
from rig.execution import process_faults
from rig.execution.emulated_rig import EmulatedRig
from rig.execution.fault_table import GOES_ON, LOOP_LOST, MOTION, NO_STOP, REFUSED, START, FaultRow
from rig.execution.task import RunResult
from rig.processes.run_types import Snapshot
from rig.realtime.reasons import Reason
from rig.realtime.safety import RUN
from rig.recording.runs.create import BusyError

FREE_TIMEOUT = 120.0  # s, wait for the host's only real-time slot
NO_RUN = "no run"  # the run ended before the fault was injected
ONSET_DELAY = 1.5  # s of rig time from power on to the fault


class Finding(NamedTuple):
    """Result of one fault."""

    verdict: str  # name of rig.realtime.safety.Reason, REFUSED, GOES_ON, LOOP_LOST or NO_RUN
    message: str  # reason of the refusal, and messages of the I/O processes
    category: int | None
    seconds: float | None  # from the fault until no motor had power
    rows_lost: int
    run_result: RunResult
    affected: int | None = None  # messages that a link's fault affected; None: no fault of a link


class CallbackView:
    """A view that shows nothing and calls a function with each snapshot."""

    def __init__(self, callback: Callable[[Snapshot], None]) -> None:
        self.notice = ""  # set by Ctrl-C
        self._callback = callback

    def __call__(self, snapshot: Snapshot) -> None:
        self._callback(snapshot)


def run_when_free(run: Callable[[], RunResult]) -> RunResult:
    """Run as soon as the host's real-time slot is free; raises BusyError after two minutes."""
    until = time.monotonic() + FREE_TIMEOUT
    while True:
        try:
            return run()
        except BusyError:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)


class Trigger:
    """Snapshot callback that acts once, when the motors have had power for a given rig time.

    ``action`` returns its time (s, monotonic). ``delay`` is in seconds; ``condition`` must also
    hold for the newest row, which is 0.1 s old at most.
    """

    def __init__(
        self,
        action: Callable[[], float],
        delay: float = ONSET_DELAY,
        condition: Callable[[Mapping[str, float]], bool] = lambda row: True,
    ) -> None:
        self.time: float | None = None  # s, monotonic, of the action
        self._action, self._delay, self._condition = action, delay, condition
        self._power_on: float | None = None  # s of rig time

    def __call__(self, snapshot: Snapshot) -> None:
        row = snapshot.row
        if self.time is not None or not row or row["safety.mode"] != RUN:
            return
        if self._power_on is None:
            self._power_on = float(row["time"])
        if row["time"] - self._power_on >= self._delay and self._condition(row):
            self.time = self._action()


def available_faults(rig: EmulatedRig) -> dict[str, tuple[str, ...]]:
    """Return the faults that can be injected, by device, link or process; OSError if lost."""
    by_device = rig.control.request("faults")["faults"]
    devices = {device: tuple(faults) for device, faults in by_device.items()}
    return devices | process_faults.faults_by_process(rig.io_processes)


def measure_fault(rig: EmulatedRig, row: FaultRow, tries: int = 3) -> Finding:
    """Inject the fault of a row in a run, and return the reaction of the rig.

    A run that ends before its fault, as on a loaded host, is repeated up to ``tries`` times.
    """
    for _ in range(tries - 1):
        finding = _measure_once(rig, row)
        if finding.verdict != NO_RUN:
            return finding
    return _measure_once(rig, row)


class RehearsedFault(NamedTuple):
    """A row of a table, and the reaction of the rig."""

    row: FaultRow
    finding: Finding
    mismatches: tuple[str, ...]  # differences from the required reaction; empty: as required
    at_first: tuple[str, ...] = ()  # those of the first try, if there was a second one


def rehearse_faults(rig: EmulatedRig, rows: Iterable[FaultRow]) -> Iterator[RehearsedFault]:
    """Yield the reaction to each fault; an unexpected one is measured twice, and the second counts.

    The host may have delayed the first one. KeyboardInterrupt after a run that Ctrl-C stopped.
    """
    for row in rows:
        finding = measure_fault(rig, row)
        at_first = tuple(mismatches(row, finding))
        if at_first:
            finding = measure_fault(rig, row)
        yield RehearsedFault(row, finding, tuple(mismatches(row, finding)), at_first)


def _measure_once(rig: EmulatedRig, row: FaultRow) -> Finding:
    def inject() -> float:
        if row.device.startswith(process_faults.PREFIX):
            return process_faults.inject(row.device, row.fault)
        return rig.control.switch(row.device, row.fault, True, row.value, row.toward)

    before = _affected_messages(rig, row)
    trigger = Trigger(inject, condition=rig.is_moving) if row.onset == MOTION else Trigger(inject)
    rig.control.request("restart")
    if row.onset == START:
        trigger.time = inject()
    view = CallbackView(trigger)  # which acts once
    result = run_when_free(lambda: rig.run(view, row.long_run))
    if view.notice:
        raise KeyboardInterrupt  # the run has handled the Ctrl-C as its own
    after = _affected_messages(rig, row)
    rig.control.request("clear")
    finding = _classify(rig, result, trigger.time)
    if before is None or after is None:
        return finding
    return finding._replace(affected=after - before)


def _affected_messages(rig: EmulatedRig, row: FaultRow) -> int | None:
    """Return how many messages a link's fault has affected so far; None for other faults."""
    counts: dict[str, int] | None = rig.control.request("world")["struck"].get(row.device)
    if counts is None:
        return None
    return sum(counts.get(f"{side}.{row.fault}", 0) for side in ("host", "device"))


def _classify(rig: EmulatedRig, result: RunResult, injected: float | None) -> Finding:
    """Return the finding of a run whose fault was injected at a time (s; None: it was not)."""
    outcome = result.outcome
    messages = "; ".join(text for text in (*outcome.messages, outcome.died) if text)
    with_reason = f"{outcome.reason} {messages}"
    lost = outcome.dropped + outcome.unsaved
    if injected is None or outcome.status == "refused":
        verdict = REFUSED if outcome.status == "refused" else NO_RUN
        return Finding(verdict, with_reason, None, None, lost, result)
    if outcome.reason == Reason.PLAN_END.name:
        return Finding(GOES_ON, messages, None, None, lost, result)
    power_off = power_off_time(rig.control)
    # A motor that never had power would give a negative time.
    seconds = None if power_off is None else max(0.0, power_off - injected)
    if outcome.status == "crashed":
        return Finding(LOOP_LOST, with_reason, None, seconds, lost, result)
    category = result.reasons.category(outcome.reason)
    return Finding(outcome.reason, messages, category, seconds, lost, result)


def power_off_time(control: ControlClient, timeout_s: float = 2.0) -> float | None:
    """Return when the last motor lost its power (s, monotonic); None if one still has power."""
    deadline = time.monotonic() + timeout_s
    while True:
        times = control.request("power")["gone"].values()
        if None not in times:
            return float(max(times))
        if time.monotonic() > deadline:
            return None
        time.sleep(0.02)


def mismatches(row: FaultRow, finding: Finding) -> list[str]:
    """Return the differences of a finding from its row of the table, as messages."""
    messages = []
    if finding.verdict not in row.verdicts:
        messages.append(f"expected {row.expected}, not {finding.verdict} ({finding.message})")
    if finding.verdict == GOES_ON and finding.affected == 0:
        messages.append("the fault affected no message")
    if finding.rows_lost:
        messages.append(f"{finding.rows_lost} rows lost")
    if row.expected not in NO_STOP and finding.verdict != GOES_ON:
        if finding.seconds is None and finding.verdict not in (REFUSED, NO_RUN):
            messages.append("a motor kept its power")
        elif finding.seconds is not None and finding.seconds > row.max_seconds:
            messages.append(f"no power after {finding.seconds:g} s, not {row.max_seconds:g} s")
        if finding.verdict == row.expected and finding.category != row.category:
            messages.append(f"category {finding.category}, not {row.category}")
    return messages
