"""Run faults of a table on the real processes: loop, I/O processes and emulated devices.

One process of emulated devices serves many runs; before each run the simulated rig is brought to
rest and the nodes are switched on again. A run tares, and the fault is injected when the motors
have had power for `ONSET_DELAY`, or when the body or shaft moves fast.
"""

import os
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, Protocol

from benchmarks.support import process_faults
from benchmarks.support.campaigns import SilentView
from benchmarks.support.control_client import ControlClient
from benchmarks.support.fault_table import (
    CATEGORY,
    GOES_ON,
    LOOP_LOST,
    MOTION,
    NO_STOP,
    REFUSED,
    START,
    FaultRow,
)
from rig.execution.task import RunResult, View
from rig.processes import handover
from rig.processes.child import Child
from rig.processes.io_processes import IoProcess
from rig.processes.messages import IoJob, Ready
from rig.processes.run_types import Snapshot
from rig.realtime.reasons import Reason
from rig.realtime.safety import RUN
from rig.recording.runs.create import BusyError

FREE_TIMEOUT = 120.0  # s, wait for the host's only real-time slot
NO_RUN = "no run"  # the run ended before the fault was injected
ONSET_DELAY = 1.5  # s of rig time from power on to the fault


class EmulatedRig(Protocol):
    """Running emulated devices, and a task on their wires."""

    @property
    def control(self) -> ControlClient:
        """Client of their control port."""
        ...

    @property
    def io_processes(self) -> tuple[str, ...]:
        """Names of the I/O processes."""
        ...

    def is_moving(self, row: Mapping[str, float]) -> bool:
        """Return True if the body or shaft moves fast in this row of the record."""
        ...

    def run(self, view: View, long: bool = False) -> RunResult:
        """Run the task on the devices in their present state; ``long``: measure for longer."""
        ...


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
        self.notice = ""
        self._callback = callback

    def __call__(self, snapshot: Snapshot) -> None:
        self._callback(snapshot)


def free_port() -> int:
    """Return a TCP port of loopback that is free now."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port: int = listener.getsockname()[1]
        return port


@contextmanager
def emulated_devices(emulator: IoProcess, folder: Path) -> Iterator[tuple[ControlClient, Child]]:
    """Start emulated devices; give the client of their control port, and their process."""
    lifeline, parent_end = os.pipe()  # the devices end when this process dies
    job = handover.dumps(IoJob(emulator.config, {}, lifeline))
    devices = Child(emulator.module, job, (lifeline,), folder / "emulation.stderr")
    try:
        with ControlClient(_address(devices)) as control:
            yield control, devices
    finally:
        devices.process.terminate()
        devices.end(5.0)
        os.close(lifeline)
        os.close(parent_end)


def _address(devices: Child) -> str:
    until = time.monotonic() + FREE_TIMEOUT
    while time.monotonic() < until and devices.alive():
        for report in devices.read_reports():
            if isinstance(report, Ready):
                return str(report.facts["control"])
        time.sleep(0.02)
    raise RuntimeError(f"no emulated devices: {devices.last_message()}")


def restart_and_run(
    rig: EmulatedRig, callback: Callable[[Snapshot], None], long: bool = False
) -> RunResult:
    """Bring the devices to rest and run the task; ``callback`` gets each snapshot."""
    rig.control.request("restart")
    return run_when_free(lambda: rig.run(CallbackView(callback), long))


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
    """Return the faults that can be injected, by device, link or process."""
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


def _measure_once(rig: EmulatedRig, row: FaultRow) -> Finding:
    def inject() -> float:
        if row.device.startswith(process_faults.PREFIX):
            return process_faults.inject(row.device, row.fault)
        return rig.control.switch(row.device, row.fault, True, row.value, row.toward)

    before = _affected_messages(rig, row)
    trigger = Trigger(inject, condition=rig.is_moving) if row.onset == MOTION else Trigger(inject)
    if row.onset == START:
        rig.control.request("restart")
        trigger.time = inject()
        result = run_when_free(lambda: rig.run(SilentView(), row.long_run))
    else:
        result = restart_and_run(rig, trigger, row.long_run)
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
    if outcome.reason in (Reason.OPERATOR_STOP.name, Reason.OPERATOR_ABORT.name):
        raise KeyboardInterrupt  # the run has handled the Ctrl-C as its own
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
    return Finding(outcome.reason, messages, CATEGORY[outcome.reason], seconds, lost, result)


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
        if finding.seconds is None or finding.seconds > row.max_seconds:
            messages.append(f"safe after {finding.seconds} s, not {row.max_seconds:g} s")
        if finding.verdict == row.expected and finding.category != row.category:
            messages.append(f"category {finding.category}, not {row.category}")
    return messages
