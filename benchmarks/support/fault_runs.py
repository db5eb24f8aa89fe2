"""Run the table of faults on the real stacks: loop, I/O processes and emulated devices.

One process of emulated devices serves many runs; before each its world is put to rest and its nodes
are switched on anew. A run tares, and the fault comes when the motors have had power for some time,
or else when what they move is moving fast.
"""

import os
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ruamel.yaml import YAML

from benchmarks.support import process_faults
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
from rig.emulation.control_client import ControlClient
from rig.execution.task import RunResult, View
from rig.processes import handover
from rig.processes.child import Child
from rig.processes.io_processes import IoProcess
from rig.processes.messages import IoJob, Ready
from rig.processes.run_types import Snapshot
from rig.realtime.reasons import Reason
from rig.realtime.safety import RUN
from rig.recording.runs.create import BusyError

FREE_TIMEOUT = 120.0  # s for the host's one real-time place
NO_RUN = "no run"  # it ended before the fault came
ONSET_DELAY = 1.5  # s of rig time from power on to the fault


class EmulatedRig(Protocol):
    """Emulated devices that are there, and something to run on their wires."""

    @property
    def control(self) -> ControlClient:
        """Their control port."""
        ...

    @property
    def io_processes(self) -> tuple[str, ...]:
        """Names of the I/O processes."""
        ...

    def is_moving(self, row: Mapping[str, float]) -> bool:
        """Return True if the moved body is fast in this row of the record."""
        ...

    def run(self, view: View, long: bool = False) -> RunResult:
        """One run on them, as they are; ``long``: one that measures for longer."""
        ...


class Finding(NamedTuple):
    """Result of one fault."""

    verdict: str  # name of rig.realtime.safety.Reason, REFUSED, GOES_ON, LOOP_LOST or NO_RUN
    message: str  # reason of the refusal, and messages of the I/O processes
    category: int | None
    seconds: float | None  # from the fault until no motor had power
    rows_lost: int  # rows
    run_result: RunResult
    affected: int | None = None  # pieces that a link's fault spoilt; None: no fault of a link


class CallbackView:
    """A view that shows nothing and may act on each snapshot."""

    def __init__(self, see: Callable[[Snapshot], None]) -> None:
        self.notice = ""
        self._callback = see

    def __call__(self, snapshot: Snapshot) -> None:
        self._callback(snapshot)


def free_port() -> int:
    """A TCP port of loopback that nobody has now."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


@contextmanager
def emulated_devices(one: IoProcess, folder: Path) -> Iterator[tuple[ControlClient, Child]]:
    """Emulated devices and their control port, for as long as the context lasts."""
    lifeline, ours = os.pipe()  # whoever dies here takes them along
    job = handover.dumps(IoJob(one.config, {}, lifeline))
    devices = Child(one.module, job, (lifeline,), folder / "emulation.stderr")
    try:
        with ControlClient(_address(devices)) as control:
            yield control, devices
    finally:
        devices.process.terminate()
        devices.end(5.0)
        os.close(lifeline)
        os.close(ours)


def _address(devices: Child) -> str:
    until = time.monotonic() + FREE_TIMEOUT
    while time.monotonic() < until and devices.alive():
        for report in devices.read_reports():
            if isinstance(report, Ready):
                return str(report.facts["control"])
        time.sleep(0.02)
    raise RuntimeError(f"no emulated devices: {devices.last_message()}")


def restart_and_run(
    on: EmulatedRig, see: Callable[[Snapshot], None], long: bool = False
) -> RunResult:
    """One run on the staged devices, put to rest before."""
    on.control.request("restart")
    return run_when_free(lambda: on.run(CallbackView(see), long))


def run_when_free(run: Callable[[], RunResult]) -> RunResult:
    """Run when nobody else has the host's real-time place; BusyError after two minutes."""
    until = time.monotonic() + FREE_TIMEOUT
    while True:
        try:
            return run()
        except BusyError:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)


class Trigger:
    """Does something once: when the motors have had power for so many seconds of rig time.

    With ``ready`` not before that is so of the newest row, which is 0.1 s old at most.
    """

    def __init__(
        self,
        action: Callable[[], float],
        after: float = ONSET_DELAY,
        condition: Callable[[Mapping[str, float]], bool] = lambda row: True,
    ) -> None:
        self.time: float | None = None  # s, monotonic, when it was done
        self._action, self._after, self._condition = action, after, condition
        self._since: float | None = None

    def __call__(self, snapshot: Snapshot) -> None:
        row = snapshot.row
        if self.time is not None or not row or row["safety.mode"] != RUN:
            return
        if self._since is None:
            self._since = float(row["time"])
        if row["time"] - self._since >= self._after and self._condition(row):
            self.time = self._action()


def available_faults(on: EmulatedRig) -> dict[str, tuple[str, ...]]:
    """Every fault that can be given, by device, link or process."""
    listed = on.control.request("faults")["faults"]
    devices = {device: tuple(faults) for device, faults in listed.items()}
    return devices | process_faults.faults_by_process(on.io_processes)


def measure_once(on: EmulatedRig, row: FaultRow) -> Finding:
    """Give a device its fault, and see what comes of it."""

    def strike() -> float:
        if row.device.startswith(process_faults.PREFIX):
            return process_faults.inject(row.device, row.fault)
        return on.control.switch(row.device, row.fault, True, row.value, row.toward)

    before = _affected_pieces(on, row)
    trigger = Trigger(strike, condition=on.is_moving) if row.onset == MOTION else Trigger(strike)
    if row.onset == START:
        on.control.request("restart")
        trigger.time = strike()
        ended = run_when_free(lambda: on.run(CallbackView(lambda snapshot: None), row.long_run))
    else:
        ended = restart_and_run(on, trigger, row.long_run)
    after = _affected_pieces(on, row)
    on.control.request("clear")
    found = classify_run(on, ended, trigger.time)
    return found if before is None or after is None else found._replace(affected=after - before)


def _affected_pieces(on: EmulatedRig, row: FaultRow) -> int | None:
    """How often a link's fault has struck so far."""
    counts: dict[str, int] | None = on.control.request("world")["struck"].get(row.device)
    if counts is None:
        return None
    return sum(counts.get(f"{way}.{row.fault}", 0) for way in ("host", "device"))


def measure_fault(on: EmulatedRig, row: FaultRow, tries: int = 3) -> Finding:
    """Like `walk`, again when the run ended before the fault came: a loaded host does that."""
    for _ in range(tries - 1):
        found = measure_once(on, row)
        if found.verdict != NO_RUN:
            return found
    return measure_once(on, row)


def classify_run(on: EmulatedRig, ended: RunResult, at: float | None) -> Finding:
    """What came of a fault that was given ``at`` a time (s; None: it never was)."""
    outcome = ended.outcome
    if outcome.reason in (Reason.OPERATOR_STOP.name, Reason.OPERATOR_ABORT.name):
        raise KeyboardInterrupt  # the run takes a Ctrl-C for its own
    said = (*outcome.messages, outcome.died)
    told = "; ".join(text for text in said if text)
    lost = outcome.dropped + outcome.unsaved
    if at is None or outcome.status == "refused":
        verdict = REFUSED if outcome.status == "refused" else NO_RUN
        return Finding(verdict, f"{outcome.reason} {told}", None, None, lost, ended)
    if outcome.reason == Reason.PLAN_END.name:
        return Finding(GOES_ON, told, None, None, lost, ended)
    gone = power_off_time(on)
    # A motor that never had any power does not count below zero.
    seconds = None if gone is None else max(0.0, gone - at)
    if outcome.status == "crashed":
        return Finding(LOOP_LOST, f"{outcome.reason} {told}", None, seconds, lost, ended)
    category = CATEGORY[outcome.reason]
    return Finding(outcome.reason, told, category, seconds, lost, ended)


class Powered(Protocol):
    """Motors whose power can be read."""

    @property
    def control(self) -> ControlClient:
        """The control port of their emulated drives."""
        ...


def power_off_time(on: Powered, timeout_s: float = 2.0) -> float | None:
    """When the last motor was without power (s, monotonic); None: one still has it."""
    until = time.monotonic() + timeout_s
    while True:
        gone = on.control.request("power")["gone"].values()
        if None not in gone:
            return float(max(gone))
        if time.monotonic() > until:
            return None
        time.sleep(0.02)


def mismatches(row: FaultRow, found: Finding) -> list[str]:
    """What of a finding is not as the table has it."""
    claims = []
    if found.verdict not in row.verdicts:
        claims.append(f"{row.expected} was due, it was {found.verdict} ({found.message})")
    if found.verdict == GOES_ON and found.affected == 0:
        claims.append("the fault struck nothing")
    if found.rows_lost:
        claims.append(f"{found.rows_lost} rows lost")
    if row.expected not in NO_STOP and found.verdict != GOES_ON:
        if found.seconds is None or found.seconds > row.max_seconds:
            claims.append(f"safe after {found.seconds} s, not {row.max_seconds:g} s")
        if found.verdict == row.expected and found.category != row.category:
            claims.append(f"category {found.category}, not {row.category}")
    return claims


def write_yaml(path: Path, tree: dict[str, Any]) -> Path:
    with path.open("w") as file:
        YAML(typ="safe").dump(tree, file)
    return path
