"""I/O processes, which serve the loop: pollers of slow lines, the service process of a CAN bus.

The supervisor starts each I/O process before the loop. The process reports that it is ready, or why
it refuses. Values go through mailboxes (shared slots). An I/O process that dies
leaves its last values in its mailboxes; their age grows, and the loop stops for it.

I/O processes live as long as the loop: all read from a pipe, the lifeline, whose writing end the
loop inherits. When the last process that holds that end is gone, each sees the end of the pipe.
"""

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from rig.processes import handover, mailbox
from rig.processes.child import Child
from rig.processes.messages import IoJob, MessageFields, Notice, Ready, Refused, Slot
from rig.recording.runs.create import write_json

FACTS_FILE = "io_processes.json"  # in the run's folder: addresses, values read from the devices
READY_TIMEOUT_S = 10.0  # s until an I/O process must report that it is ready, by default
_POLL_INTERVAL_S = 0.02  # s between polls during start-up


class IoProcess(NamedTuple):
    """One I/O process of a run."""

    name: str  # in messages, and of its error file
    module: str  # python -m ...
    config: dict[str, Any]  # JSON values
    mailboxes: Mapping[str, MessageFields] = {}  # message of each, by name
    ready_timeout_s: float = READY_TIMEOUT_S  # s until it must be ready
    starts_first: bool = False  # the others need it and are started once it is ready


class IoProcessError(RuntimeError):
    """An I/O process did not become ready; the message has its name and its reason."""


class IoProcesses:
    """All I/O processes of a run, from start to end."""

    def __init__(
        self, processes: tuple[IoProcess, ...], folder: Path, locks: tuple[int, ...] = ()
    ) -> None:
        """``locks``: file descriptors of the wires' locks; every I/O process holds them."""
        self._processes = processes
        self._locks = locks
        self._folder = folder
        self.slots = {  # by name
            name: Slot(mailbox.create(), fields)
            for each in processes
            for name, fields in each.mailboxes.items()
        }
        self._lifeline, self.loop_end = os.pipe()  # the loop inherits `loop_end`
        self._children: list[tuple[IoProcess, Child]] = []
        self.facts: dict[str, Any] = {}  # by I/O process: values read from devices, for the loop
        self.messages: list[str] = []  # for people, in the order in which they came

    def start(self) -> None:
        """Start the processes that others need, then all others at once; wait until all are ready.

        IoProcessError names the first that does not become ready.
        """
        for group in (
            [each for each in self._processes if each.starts_first],
            [each for each in self._processes if not each.starts_first],
        ):
            started = [(each, self._start_child(each)) for each in group]
            for process, child in started:
                self._wait_until_ready(process, child)
        if self._processes:
            write_json(self._folder, FACTS_FILE, self.facts)

    def _start_child(self, process: IoProcess) -> Child:
        slots = {name: self.slots[name] for name in process.mailboxes}
        job = handover.dumps(IoJob(process.config, slots, self._lifeline))
        fds = (self._lifeline, *(slot.fd for slot in slots.values()), *self._locks)
        child = Child(process.module, job, fds, self._folder / f"{process.name}.stderr")
        self._children.append((process, child))
        return child

    def _wait_until_ready(self, process: IoProcess, child: Child) -> None:
        began = time.monotonic()
        while True:
            alive = child.alive()
            self._read_reports(process, child)
            if process.name in self.facts:
                return
            if not alive:
                raise IoProcessError(f"{process.name}: {child.last_message()}")
            if time.monotonic() - began > process.ready_timeout_s:
                timeout = process.ready_timeout_s
                raise IoProcessError(f"{process.name}: not ready after {timeout:g} s")
            time.sleep(_POLL_INTERVAL_S)

    def _read_reports(self, process: IoProcess, child: Child) -> None:
        for report in child.read_reports():
            match report:
                case Ready(facts):
                    self.facts[process.name] = facts
                case Refused(why) if process.name not in self.facts:
                    raise IoProcessError(f"{process.name}: {why}")
                case Notice(text) | Refused(text):
                    self.messages.append(f"{process.name}: {text}")

    def check(self) -> str:
        """Collect messages and return which processes have died, empty if all live."""
        failures = []
        for process, child in self._children:
            alive = child.alive()
            self._read_reports(process, child)
            if not alive:
                failures.append(f"{process.name} ended: {child.last_message()}")
        return "; ".join(failures)

    def release_lifeline(self) -> None:
        """Close our end of the lifeline, so that all processes end with the loop, its heir."""
        if self.loop_end >= 0:
            os.close(self.loop_end)
            self.loop_end = -1

    def end(self, timeout_s: float) -> None:
        """End all processes in reverse order, kill those that do not end, close the mailboxes.

        Their last messages may be the cause of the loop's end.
        """
        for process, child in reversed(self._children):
            if child.alive():
                child.process.terminate()
            child.end(timeout_s)
            notices = (each for each in child.read_reports() if isinstance(each, Notice))
            self.messages += (f"{process.name}: {notice.text}" for notice in notices)
        self.release_lifeline()
        for fd in (self._lifeline, *(slot.fd for slot in self.slots.values())):
            os.close(fd)
        self.slots = {}
