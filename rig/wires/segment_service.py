"""The service process of an EtherCAT segment, beside the loop: set-up, homing, states, emergencies.

It finds the slaves, refuses a line that is not that of the rig file, writes and reads back their
objects, maps the process data, and asks for OP once the loop sends frames. A slave that leaves OP
later gets it back by the next run only: nothing is armed again by itself.
"""

import json
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Any

from drivers.cia402 import homing, homing_run
from drivers.cia402.arming import SetupStep, format_mismatches
from drivers.cia402.homing_run import HomingSettings
from drivers.errors import ServiceError
from drivers.ethercat import position_actuator
from drivers.ethercat.cycle import SegmentCycle
from drivers.ethercat.frames import CyclicFrame
from drivers.ethercat.link import Link
from drivers.ethercat.process_image import Values, expected_wkc, image_bytes
from drivers.ethercat.service import (
    AlState,
    Service,
    SlaveIdentity,
    SlaveSetup,
    SlaveStatus,
    state_name,
)
from rig.processes import handover
from rig.processes.io_process import end_condition, run_io_process
from rig.processes.mailbox import Mailbox
from rig.processes.messages import IoJob, Notice, Ready, report
from rig.wires.messages import HEALTH_SUFFIX, NodeHealth, open_mailboxes

_POLL_INTERVAL_S = 0.02  # s between two looks at the states
_SILENT_S = 0.3  # s without an answer of a slave until people read of it
_TICK_S = 0.001  # s between two frames while an actuator homes
_OP_TIMEOUT_S = 3.0  # s

Slaves = Sequence[dict[str, Any]]
"""The set-up of each slave, as of `rig.wires.segment_slaves`."""


def serve(job: IoJob) -> None:
    """Set up and monitor the slaves until terminated or until the loop has ended."""
    config, ended = job.config, end_condition(job.lifeline)
    slaves: Slaves = config["slaves"]
    with closing(Service(config["interface"])) as service:
        facts = set_up_slaves(service, config)
        for slave in slaves:
            if slave["homes"]:
                home_slave(service, config, slave, ended)
        watch = _Watch(service, slaves, open_mailboxes(job.mailboxes))
        watch.look()
        report(Ready(facts))
        while not ended():
            time.sleep(_POLL_INTERVAL_S)
            watch.look()


def identity_problems(found: Sequence[SlaveIdentity], slaves: Slaves) -> list[str]:
    """Return how a line differs from that of the rig file."""
    problems = []
    for place, (slave, seen) in enumerate(zip(slaves, found, strict=False), 1):
        expected = (slave["vendor"], slave["product"], slave["revision"])
        if (seen.vendor, seen.product) == expected[:2] and expected[2] in (None, seen.revision):
            continue
        revision = "any revision" if expected[2] is None else f"revision {expected[2]:#x}"
        problems.append(
            f"{slave['name']} (slave {place}): {seen.name or 'a slave'} is there: vendor "
            f"{seen.vendor:#x}, product {seen.product:#x}, revision {seen.revision:#x}; expected "
            f"vendor {expected[0]:#x}, product {expected[1]:#x}, {revision}"
        )
    missing = [slave["name"] for slave in slaves[len(found) :]]
    if missing:
        problems.append(
            f"only {len(found)} of {len(slaves)} slaves answer; {', '.join(missing)} are missing: "
            "the cable is cut, or a slave has no power"
        )
    if len(found) > len(slaves):
        extra = ", ".join(each.name or f"{each.product:#x}" for each in found[len(slaves) :])
        problems.append(f"{len(found)} slaves answer, the rig file has {len(slaves)}: {extra}")
    return problems


def set_up_slaves(service: Service, config: dict[str, Any]) -> dict[str, Any]:
    """Bring the slaves to SAFE_OPERATIONAL; return what the loop needs to know of them.

    ``config``: of `rig.wires.segment_slaves.segment_service`. ServiceError lists every slave that
    is another one or does not take its settings.
    """
    slaves: Slaves = config["slaves"]
    distributed = config["clock"] == "distributed"  # the loop follows the clock of the segment
    found = service.find()
    if problems := identity_problems(found, slaves):
        raise ServiceError("\n".join(problems))
    mismatches = service.configure(
        [
            SlaveSetup(
                slave["name"],
                tuple(SetupStep(*step) for step in slave["steps"]),
                slave["watchdog_ms"],
                slave["sync0_ns"],
            )
            for slave in slaves
        ],
        distributed=distributed,
    )
    problems = [
        f"{slave['name']}:\n{format_mismatches(each)}"
        for slave, each in zip(slaves, mismatches, strict=True)
        if each
    ]
    values: dict[str, dict[str, int | None]] = {}
    for place, slave in enumerate(slaves):
        facts = {
            name: service.read(place, index, sub, kind) for name, index, sub, kind in slave["facts"]
        }
        values[slave["name"]] = facts
        if missing := [name for name, value in facts.items() if value is None]:
            problems.append(f"{slave['name']} does not give {', '.join(missing)}")
    if problems:
        raise ServiceError("\n".join(problems))
    areas = service.areas()
    return {
        "drives": values,
        "segment": [
            [list(each.outputs or ()) for each in areas],
            [list(each.inputs or ()) for each in areas],
            service.reference_clock() if distributed else 0,
        ],
        "slaves": [each._asdict() for each in found],
    }


def home_slave(
    service: Service, config: dict[str, Any], slave: dict[str, Any], stopped: Callable[[], bool]
) -> bool:
    """Home an actuator with frames of this process; return whether it moved.

    Its watchdog stops it if this process dies. ServiceError names the failure.
    """
    access = _FrameAccess(service, config["interface"], slave["node"] - 1)
    try:
        settings = handover.loads(HomingSettings, json.dumps(slave["homing"]))
        return homing_run.home(access, slave["name"], settings, stopped)
    finally:
        access.close()
        service.request(AlState.SAFE_OPERATIONAL)


class _FrameAccess:
    """A drive as `homing_run` needs it, in frames of this process."""

    def __init__(self, service: Service, interface: str, place: int) -> None:
        self._service, areas = service, service.areas()
        frame = CyclicFrame(image_bytes(areas), None)
        self._cycle = SegmentCycle(Link(interface), frame, expected_wkc(areas))
        self._slaves = len(areas)
        outputs, inputs = areas[place]
        assert outputs is not None
        assert inputs is not None
        self._outputs = Values(position_actuator.OUTPUTS, outputs)
        self._inputs = Values(position_actuator.INPUTS, inputs)
        self._mode = self._controlword = 0

    def select_mode(self) -> None:
        until = time.monotonic() + _OP_TIMEOUT_S
        while not self._cycle.state.is_operational(self._slaves):
            if time.monotonic() > until:
                raise ServiceError(f"the slaves do not reach OP in {_OP_TIMEOUT_S:g} s")
            self._service.status()
            self._service.request_operational()
            self.wait()
        self._mode = homing.MODE

    def force_power_off(self) -> str:
        return ""

    def statusword(self) -> int | None:
        statusword, _ = self._status()
        return statusword

    def mode_display(self) -> int | None:
        _, mode_display = self._status()
        return mode_display

    def _status(self) -> tuple[int | None, int | None]:
        self._cycle.receive()
        if time.monotonic() - self._cycle.sampled > _OP_TIMEOUT_S:
            return None, None
        statusword, mode_display, _ = self._inputs.read(self._cycle.inputs)
        return statusword, mode_display

    def command(self, controlword: int) -> None:
        self._controlword = controlword

    def wait(self) -> None:
        end = time.monotonic() + homing_run.PERIOD_S
        while time.monotonic() < end:
            self._cycle.receive()
            self._outputs.write(self._cycle.outputs, 0, 0, self._controlword, self._mode)
            self._cycle.send()
            time.sleep(_TICK_S)

    def close(self) -> None:
        self._cycle.close()


class _Watch:
    """The slaves' states while the loop runs."""

    def __init__(self, service: Service, slaves: Slaves, slots: dict[str, Mailbox]) -> None:
        self._service, self._slaves, self._slots = service, slaves, slots
        now = time.monotonic()
        self._alive = [now] * len(slaves)  # s, when each was last in OP; before that, the start
        self._falls = [0] * len(slaves)  # times that each left OP
        self._states = [AlState.SAFE_OPERATIONAL.value] * len(slaves)
        # OP counts once it outlasts every watchdog: before, it may rest on frames of a homing.
        watchdog = max((1e-3 * slave["watchdog_ms"] for slave in slaves), default=0.0)
        self._must_last = 2.0 * watchdog + _POLL_INTERVAL_S
        self._since = now  # s, all have been in OP from then on
        self._reached = False  # all were in OP for that long
        self._answered = [now] * len(slaves)
        self._reported: set[str] = set()  # names of slaves that did not answer for too long

    def look(self) -> None:
        """Post each drive's health; ask for OP until all slaves have reached it."""
        status = self._service.status()
        now = time.monotonic()
        if not self._reached:
            if not all(each.state == AlState.OPERATIONAL for each in status):
                self._since = now
                self._service.request_operational()
            self._reached = now - self._since > self._must_last
        silent: set[str] = set()
        for place, (slave, each) in enumerate(zip(self._slaves, status, strict=True)):
            if each.state != AlState.NONE:  # pysoem gives up after 2 ms: a stall of the host
                was, self._states[place] = self._states[place], each.state
                self._note(place, was, each, now)
                self._answered[place] = now
            elif self._reached and now - self._answered[place] > _SILENT_S:
                silent.add(slave["name"])
            if slot := self._slots.get(f"{slave['name']}{HEALTH_SUFFIX}"):
                slot.post(NodeHealth(self._alive[place], self._falls[place], now))
        if new := silent - self._reported:
            self._reported |= new
            report(Notice(f"{', '.join(sorted(new))}: no answer for {_SILENT_S:g} s"))

    def _note(self, place: int, was: int, status: SlaveStatus, now: float) -> None:
        """Take the state of a slave that answers."""
        if status.state == AlState.OPERATIONAL or not self._reached:
            self._alive[place] = now
        elif was == AlState.OPERATIONAL:
            self._falls[place] += 1
            text = _state_text(status.state, status.error)
            report(Notice(f"{self._slaves[place]['name']} left OP: {text}"))


def _state_text(state: int, error: int) -> str:
    text = f"is in {state_name(state)}"
    return f"{text}, AL status code {error:#06x}" if error else text


if __name__ == "__main__":
    run_io_process(serve)
