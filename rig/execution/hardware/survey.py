"""Who answers on a rig's wires, and whether what must stand there does. It only reads."""

import time
from collections.abc import Iterator
from typing import Any, NamedTuple

from drivers.canopen import arming, emcy, statusword
from drivers.canopen.arming import Mismatch, Step
from drivers.canopen.bus_settings import Bus
from drivers.canopen.drive_objects import Access
from drivers.canopen.link import LinkError
from drivers.canopen.service import Health, Identity, Service
from rig.execution.hardware.job import Job
from rig.execution.hardware.line_survey import LineFound, look_at_line, unit_troubles
from rig.execution.hardware.wire_check import bus_trouble

SCAN = 0.4  # s in which every node of the bus has answered a first question
_BEATS = 2.5  # periods of a heartbeat in which one must have come
_LONGEST = 3.0  # s that are waited for heartbeats
_LOOK, _PATIENCE = 0.02, 2.0  # s; for one answer: beside a run it waits behind process data
_MASTER_LOST = 0x11  # generic and communication, in the error register


class NodeFound(NamedTuple):
    """One node of the rig; None for what it did not give."""

    name: str
    node: int
    answers: bool
    identity: Identity
    nmt: int | None  # `heartbeat.Nmt`, as its heartbeat says; None: none came
    heartbeat_age: float | None  # s
    heartbeat_every: float | None  # s, 0x1017; 0: it sends none
    error_code: int | None  # 0x603F
    statusword: int | None  # 0x6041
    emergency: int  # code of the last one that came while it was looked at
    checked: int  # objects that were read and compared
    wrong: tuple[Mismatch, ...]  # of those no run writes: it would be refused
    unset: tuple[Mismatch, ...]  # of those every run writes before it arms
    trouble: tuple[str, ...]

    @property
    def waits(self) -> bool:
        """Whether all it misses is its master: so every run leaves it behind."""
        only = (self.identity.error_register or 0) & ~_MASTER_LOST == 0
        return only and not self.error_code and self.statusword is not None


class BusFound(NamedTuple):
    """The CAN bus."""

    bus: Bus
    load: float  # of a run, in the worst case, 0 to 1
    trouble: str  # why nobody could be asked
    nodes: tuple[NodeFound, ...]
    strangers: tuple[int, ...]  # nodes that are not in the rig file


class Found(NamedTuple):
    """All wires of a rig."""

    can: BusFound
    lines: tuple[LineFound, ...]
    at: float  # s, monotonic, when all had been looked at

    @property
    def trouble(self) -> tuple[str, ...]:
        """Everything that does not answer or does not agree; empty if all is well."""
        return tuple(self._trouble())

    def _trouble(self) -> Iterator[str]:
        if self.can.trouble:
            yield f"CAN: {self.can.trouble}"
        for node in self.can.nodes:
            for text in node.trouble if not self.can.trouble else ():
                yield f"{node.name} (node {node.node}) {text}"
        for line in self.lines:
            yield from unit_troubles(line)


def survey(job: Job) -> Found:
    """Look at every wire of a rig's job; what cannot be reached is told, never raised."""
    can = None
    lines = []
    for companion in job.io_processes:
        if companion.module == "rig.execution.hardware.can_service":
            can = _bus(companion.config, job.load.total)
        else:
            lines.append(look_at_line(companion.name.removeprefix("line "), companion.config))
    assert can is not None
    return Found(can, tuple(lines), time.monotonic())


def _bus(config: dict[str, Any], load: float) -> BusFound:
    interface, channel, bit_rate, options = config["bus"]
    bus = Bus(interface, channel, bit_rate, tuple((key, value) for key, value in options))
    nodes = config["nodes"]
    absent = tuple(_silent(one) for one in nodes)
    if why := bus_trouble(bus):
        return BusFound(bus, load, why, absent, ())
    try:
        service = Service(bus, _PATIENCE)
    except LinkError as error:
        return BusFound(bus, load, str(error), absent, ())
    try:
        for one in nodes:
            service.watch(one["node"])
        strangers = set(service.scan(SCAN)) - {one["node"] for one in nodes}
        service.narrow()
        found = [_node(service, one) for one in nodes]
        _hear(service, found)
        health, now = service.health(), time.monotonic()
        found = [_with_health(one, health[one.node], now) for one in found]
    except LinkError as error:
        return BusFound(bus, load, str(error), absent, ())
    finally:
        service.close()
    return BusFound(bus, load, "", tuple(found), tuple(sorted(strangers)))


def _silent(one: dict[str, Any]) -> NodeFound:
    nobody = Identity(None, None, None, None, None, None, None)
    return NodeFound(
        one["name"], one["node"], False, nobody, None, None, None, None, None, 0, 0, (), (),
        ("does not answer",),
    )  # fmt: skip


def _node(service: Service, one: dict[str, Any]) -> NodeFound:
    """Ask one node for everything; heartbeats are still to come."""
    node, found = one["node"], _silent(one)
    if service.read(node, 0x1000, 0, "u32") is None:
        return found
    steps = tuple(Step(*step) for step in one["steps"])
    wanted = arming.read_back(steps)
    answers = {(s.object, s.sub): service.read(node, s.object, s.sub, s.type) for s in wanted}
    verified = {(s.object, s.sub) for s in wanted if s.access == Access.VERIFY}
    differing = arming.compare(steps, answers)
    wrong = tuple(m for m in differing if (m.object, m.sub) in verified)
    every = service.read(node, 0x1017, 0, "u16")
    found = found._replace(
        answers=True,
        identity=service.identity(node),
        heartbeat_every=None if every is None else 1e-3 * every,
        error_code=service.read(node, 0x603F, 0, "u16"),
        statusword=service.read(node, 0x6041, 0, "u16"),
        checked=len(wanted),
        wrong=wrong,
        unset=tuple(m for m in differing if (m.object, m.sub) not in verified),
    )
    lacking = [
        f"does not give {name}, without which its command has no scale"
        for name, index, sub, kind in one["facts"]
        if service.read(node, index, sub, kind) is None
    ]
    return found._replace(
        trouble=(*_at_fault(found), *arming.refusal(wrong).splitlines(), *lacking)
    )


def _at_fault(found: NodeFound) -> Iterator[str]:
    code, register = found.error_code or 0, found.identity.error_register or 0
    if code:
        yield f"reports error {code:#06x}, {emcy.meaning(code)}"
    elif register and not found.waits:
        yield f"has error register {register:#04x}, {register_words(register)}"
    word = found.statusword
    if word is None:
        yield "gives no statusword 0x6041"
    elif not code and statusword.decode(word) in (statusword.FAULT, statusword.FAULT_REACTION):
        yield f"is in fault: {statusword.describe(word)}"


def register_words(register: int) -> str:
    """The bits of an error register 0x1001 that are set."""
    return ", ".join(name for bit, name in enumerate(emcy.REGISTER) if register >> bit & 1)


def _hear(service: Service, nodes: list[NodeFound]) -> None:
    """Wait until every node that sends heartbeats has sent one, but not for ever."""
    until = {
        one.node: time.monotonic() + min(_LONGEST, _BEATS * one.heartbeat_every)
        for one in nodes
        if one.heartbeat_every
    }
    while until and time.monotonic() < max(until.values()):
        health = service.health()
        until = {node: end for node, end in until.items() if health[node].nmt < 0}
        time.sleep(_LOOK)


def _with_health(found: NodeFound, health: Health, now: float) -> NodeFound:
    heard = health.nmt >= 0
    trouble = list(found.trouble)
    if found.heartbeat_every and not heard:
        trouble.append(f"sends no heartbeat, though told to, every {found.heartbeat_every:g} s")
    return found._replace(
        nmt=health.nmt if heard else None,
        heartbeat_age=now - health.heard if heard else None,
        emergency=health.code,
        trouble=tuple(trouble),
    )
