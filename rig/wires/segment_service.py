"""The service process of an EtherCAT segment, beside the loop: set-up, homing, states, emergencies.

It finds the slaves, refuses a line that is not that of the rig file, writes and reads back their
objects, maps the process data, and asks for OP once the loop sends frames. A slave that leaves OP
later gets it back by the next run only: nothing is armed again by itself.
"""

import json
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from typing import Any

from drivers.cia402 import homing, homing_run
from drivers.cia402.arming import SetupStep, format_mismatches
from drivers.cia402.homing_run import HomingSettings
from drivers.errors import ServiceError
from drivers.ethercat import position_actuator
from drivers.ethercat.clock import ClockParams, Follower
from drivers.ethercat.cycle import SegmentCycle
from drivers.ethercat.frames import SYSTEM_TIME, Command, CyclicFrame, Datagram, encode
from drivers.ethercat.link import TICK_INDICES, Link
from drivers.ethercat.process_image import Values, expected_wkc, image_bytes
from drivers.ethercat.service import (
    AlState,
    Service,
    SlaveIdentity,
    SlaveSetup,
    SlaveStatus,
    state_name,
)
from drivers.ethercat.synchronisation import sync0_problem
from rig.processes import handover
from rig.processes.io_process import end_condition, run_io_process
from rig.processes.mailbox import Mailbox
from rig.processes.messages import IoJob, Notice, Ready, report
from rig.wires.messages import HEALTH_SUFFIX, NodeHealth, open_mailboxes
from rig.wires.pace import Pace

_POLL_INTERVAL_S = 0.02  # s between two looks at the states
_SILENT_S = 0.3  # s without an answer of a slave until people read of it
_OP_TIMEOUT_S = 3.0  # s
_NO_FRAMES = 0x001B  # AL status code
# Frames that bring the clocks together: at most, between two looks, and what they must reach.
_MAX_ALIGNING, _ALIGNING, _ALIGNED_NS = 15_000, 100, 1_000
_ANSWER_S = 0.002  # s

Slaves = Sequence[dict[str, Any]]
"""The set-up of each slave, as of `rig.wires.segment_slaves`."""


def serve(job: IoJob) -> None:
    """Set up and monitor the slaves until terminated or until the loop has ended."""
    config, ended = job.config, end_condition(job.lifeline)
    slaves: Slaves = config["slaves"]
    with closing(Service(config["interface"])) as service:
        facts = set_up_slaves(service, config)
        homing_slaves = [slave for slave in slaves if slave["homes"]]
        for slave in homing_slaves:
            home_slave(service, config, facts, slave, ended)
        watch = _Watch(service, slaves, open_mailboxes(job.mailboxes))
        if homing_slaves:  # with its last frames a slave would take OP once more, and lose it
            time.sleep(watch.watchdog_s)
        watch.look()
        report(Ready(facts))
        while not ended():
            time.sleep(_POLL_INTERVAL_S)
            watch.look()
        watch.look_last()


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
    is another one or does not take its settings; LinkError if the interface cannot be opened.
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
        if cycle := slave["sync0_ns"]:
            problem = sync0_problem(partial(service.read, place), cycle)
            problems += [f"{slave['name']}: {problem}"] if problem else []
    if problems:
        raise ServiceError("\n".join(problems))
    areas = service.areas()
    reference = service.reference_clock() if distributed else 0
    if reference:
        _align_clocks(service, config["interface"], slaves, reference)
    return {
        "drives": values,
        "segment": [
            [list(each.outputs or ()) for each in areas],
            [list(each.inputs or ()) for each in areas],
            reference,
        ],
        "slaves": [each._asdict() for each in found],
    }


def _align_clocks(service: Service, interface: str, slaves: Slaves, reference: int) -> None:
    """Bring all clocks to that of the reference, a station, before any slave relies on them.

    A controller removes a small part of its difference with each frame, so masters send many of
    them at the start. ServiceError names the slaves whose clocks stay away.
    """
    address = reference | SYSTEM_TIME << 16
    frame = bytearray(encode((Datagram(Command.FRMW, TICK_INDICES[0], address, bytes(8)),)))
    away: list[str] = []
    with closing(Link(interface)) as link:
        for _ in range(_MAX_ALIGNING // _ALIGNING):
            for _ in range(_ALIGNING):
                link.send(frame)
                until = time.monotonic() + _ANSWER_S
                while not link.receive() and time.monotonic() < until:
                    time.sleep(0.0)
            away = [
                f"{slave['name']}: its clock is {ns} ns from that of the reference; allowed "
                f"{_ALIGNED_NS} ns"
                for slave, ns in zip(slaves, service.clock_differences(), strict=True)
                if ns is not None and ns > _ALIGNED_NS
            ]
            if not away:
                return
    raise ServiceError("\n".join(away))


def home_slave(
    service: Service,
    config: dict[str, Any],
    facts: dict[str, Any],
    slave: dict[str, Any],
    stopped: Callable[[], bool],
) -> bool:
    """Home an actuator with frames of this process; return whether it moved.

    ``config``, ``facts``: of the service, and of `set_up_slaves`. Its watchdog stops it if this
    process dies. ServiceError names the failure.
    """
    access = _FrameAccess(service, config, facts["segment"][2], slave["node"] - 1)
    try:
        settings = handover.loads(HomingSettings, json.dumps(slave["homing"]))
        return homing_run.home(access, slave["name"], settings, stopped)
    finally:
        access.close()
        service.request(AlState.SAFE_OPERATIONAL)


class _FrameAccess:
    """A drive as `homing_run` needs it, in frames of this process."""

    def __init__(
        self, service: Service, config: dict[str, Any], reference: int, place: int
    ) -> None:
        """``reference``: station whose clock leads, 0: none."""
        self._service, areas = service, service.areas()
        frame = CyclicFrame(image_bytes(areas), reference or None)
        self._cycle = SegmentCycle(Link(config["interface"]), frame, expected_wkc(areas))
        self._names = [slave["name"] for slave in config["slaves"]]
        self._clock = Follower(ClockParams(**config["pace"]))
        self._pace = Pace(self._clock.params.cycle_ns)
        outputs, inputs = areas[place]
        assert outputs is not None
        assert inputs is not None
        self._outputs = Values(position_actuator.OUTPUTS, outputs)
        self._inputs = Values(position_actuator.INPUTS, inputs)
        self._mode = self._controlword = 0

    def select_mode(self) -> None:
        until, refusals = time.monotonic() + _OP_TIMEOUT_S, _Refusals(self._service, self._names)
        while not self._cycle.state.is_operational(len(self._names)):
            refusals.take(self._service.status())
            if time.monotonic() > until:
                missing = self._service.missing(self._names, AlState.OPERATIONAL)
                problems = refusals.texts or missing
                raise ServiceError("\n".join(problems) or f"no OP in {_OP_TIMEOUT_S:g} s")
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
        cycle, end = self._cycle, time.monotonic() + homing_run.PERIOD_S
        while time.monotonic() < end:
            sampled = cycle.sampled
            cycle.receive()
            if cycle.state.time_ns and cycle.sampled != sampled:
                self._clock.take(cycle.state.time_ns)
            self._outputs.write(cycle.outputs, 0, 0, self._controlword, self._mode)
            cycle.send()
            self._pace.wait(self._clock.correction())

    def close(self) -> None:
        self._cycle.close()


class _Refusals:
    """The reasons with which slaves refuse OP, or leave it before all have reached it."""

    def __init__(self, service: Service, names: Sequence[str], *ignored: int) -> None:
        """``ignored``: AL status codes that are none."""
        self.texts: list[str] = []  # each once
        self._service, self._names, self._ignored = service, names, (0, *ignored)

    def take(self, status: Sequence[SlaveStatus]) -> list[str]:
        """Return the reasons that are new."""
        found = [
            f"{name} refuses OP: AL status code {self._service.meaning(each.error)}"
            for name, each in zip(self._names, status, strict=True)
            if each.error not in self._ignored
        ]
        new = [text for text in found if text not in self.texts]
        self.texts += new
        return new


class _Watch:
    """The slaves' states while the loop runs."""

    def __init__(self, service: Service, slaves: Slaves, slots: dict[str, Mailbox]) -> None:
        self._service, self._slaves, self._slots = service, slaves, slots
        now = time.monotonic()
        self._alive = [now] * len(slaves)  # s, when each was last in OP; before that, the start
        self._falls = [0] * len(slaves)  # times that each left OP
        self._states = [AlState.SAFE_OPERATIONAL.value] * len(slaves)
        # OP counts once it outlasts every watchdog: before, it may rest on frames of a homing.
        self.watchdog_s = max(1e-3 * slave["watchdog_ms"] for slave in slaves)
        self._must_last = 2.0 * self.watchdog_s + _POLL_INTERVAL_S
        self._since = now  # s, all have been in OP from then on
        self._reached = False  # all were in OP for that long
        self._answered = [now] * len(slaves)
        self._reported: set[str] = set()  # names of slaves that did not answer for too long
        names = [slave["name"] for slave in slaves]
        self._refusals = _Refusals(service, names, _NO_FRAMES)  # the loop may not have begun

    def look(self) -> None:
        """Post each drive's health; ask for OP until all slaves have reached it."""
        status = self._service.status()
        now = time.monotonic()
        if not self._reached:
            if not all(each.state == AlState.OPERATIONAL for each in status):
                self._since = now
                for text in self._refusals.take(status):
                    report(Notice(text))
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

    def look_last(self) -> None:
        """Report which slaves left OP in the last cycles, which is why the loop may have ended.

        A slave whose watchdog lapsed misses the frames of the loop that has ended.
        """
        status, now = self._service.status(), time.monotonic()
        for place, each in enumerate(status):
            if each.state != AlState.NONE and each.error != _NO_FRAMES:
                self._note(place, self._states[place], each, now)

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
