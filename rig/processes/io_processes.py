"""Processes that serve the loop from beside it: pollers of slow lines, the service end of a bus.

Each is started before the loop and says in JSON lines that it is ready, or why it will not be.
Values go through mailboxes (shared slots); a companion that dies leaves its last values behind,
which age, and the loop stops for their age.

They live as long as the loop: all read from a pipe, the lifeline, whose writing end the loop
inherits. When the last process that holds that end is gone, each sees the end of the pipe.
"""

import json
import os
import time
from pathlib import Path
from typing import Any, NamedTuple

from rig.processes import mailbox
from rig.processes.child import Child
from rig.recording.runs.create import write_json

FACTS = "companions.json"  # in the run's folder: addresses, and what the devices said of themselves
READY = 10.0  # s in which a companion says that it is ready, when it asks for no more
_LOOK = 0.02  # s between looks while they come up


class IoProcess(NamedTuple):
    """One process beside the loop."""

    name: str  # for people, and for its file of errors
    module: str  # python -m ...
    config: dict[str, Any]  # JSON values
    mailboxes: tuple[str, ...]  # names of the slots it uses, shared by name with the loop
    ready_timeout_s: float = READY  # s in which it must be ready
    first: bool = False  # the others are started when it is ready: they need it


class IoProcessError(RuntimeError):
    """A companion that is not ready, named, with what it said."""


class IoProcesses:
    """All of a run's companions, from start to end."""

    def __init__(
        self, wanted: tuple[IoProcess, ...], folder: Path, locks: tuple[int, ...] = ()
    ) -> None:
        """``locks``: file descriptors of the wires' locks, held by every companion."""
        self._wanted = wanted
        self._locks = locks
        self._folder = folder
        self._slots = {name: mailbox.create() for one in wanted for name in one.mailboxes}
        self._lifeline, self.loop_end = os.pipe()  # `loop_end`: for the loop to inherit
        self._children: list[tuple[IoProcess, Child]] = []
        self.facts: dict[str, Any] = {}  # by companion: what it found out for the loop
        self.said: list[str] = []  # what they had to tell since

    @property
    def slots(self) -> dict[str, int]:
        """File descriptors of the mailboxes by name."""
        return dict(self._slots)

    def start(self) -> None:
        """Start those that the others need, then all others at once; all are ready after it.

        CompanionError names the first that is not.
        """
        for several in (
            [one for one in self._wanted if one.first],
            [one for one in self._wanted if not one.first],
        ):
            began = [(one, self._begin(one)) for one in several]
            for one, child in began:
                self._wait(one, child)
        if self._wanted:
            write_json(self._folder, FACTS, self.facts)

    def _begin(self, one: IoProcess) -> Child:
        job = {
            "config": one.config,
            "mailboxes": {name: self._slots[name] for name in one.mailboxes},
            "lifeline": self._lifeline,
        }
        slots = (self._slots[name] for name in one.mailboxes)
        fds = (self._lifeline, *slots, *self._locks)
        child = Child(one.module, json.dumps(job), fds, self._folder / f"{one.name}.stderr")
        self._children.append((one, child))
        return child

    def _wait(self, one: IoProcess, child: Child) -> None:
        began = time.monotonic()
        while True:
            alive = child.alive()
            ready, refused = False, ""
            for event in child.heard():
                if event["event"] == "ready":
                    self.facts[one.name] = event.get("facts", {})
                    ready = True
                if event["event"] == "refused":
                    refused = event["why"]
                if event["event"] == "say":
                    self.said.append(f"{one.name}: {event['text']}")
            if refused:
                raise IoProcessError(f"{one.name}: {refused}")
            if ready:
                return
            if not alive:
                raise IoProcessError(f"{one.name}: {child.last_message()}")
            if time.monotonic() - began > one.ready_timeout_s:
                raise IoProcessError(f"{one.name}: not ready after {one.ready_timeout_s:g} s")
            time.sleep(_LOOK)

    def listen(self) -> str:
        """What is wrong with them now, empty if nothing is; a dead one is named."""
        trouble = []
        for one, child in self._children:
            alive = child.alive()
            self.said += [
                f"{one.name}: {event['text']}" for event in child.heard() if event["event"] == "say"
            ]
            if not alive:
                trouble.append(f"{one.name} ended: {child.last_message()}")
        return "; ".join(trouble)

    def leave_to_the_loop(self) -> None:
        """Let go of the lifeline: the loop has inherited it, and they now end with the loop."""
        if self.loop_end >= 0:
            os.close(self.loop_end)
            self.loop_end = -1

    def end(self, patience: float) -> None:
        """End all in the opposite order, those that will not be killed; give the mailboxes back."""
        for _, child in reversed(self._children):
            if child.alive():
                child.process.terminate()
            child.end(patience)
        self.leave_to_the_loop()
        for fd in (self._lifeline, *self._slots.values()):
            os.close(fd)
        self._slots = {}
